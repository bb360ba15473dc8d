"""Thickness maps of photographs: text, JSON, figure, and their folder."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pellicle.files import MARKER, new_folder, replacing, write_text
from pellicle.mapping.photograph import ThicknessMap
from pellicle.reporting.csv_text import csv_rows
from pellicle.reporting.json_record import indented, number, versions
from pellicle.reporting.matplotlib_figure import BLUE, GREY, ORANGE, new_figure, save_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SCHEMA = "pellicle.map/1"
LEAST = 1e-3
"""Least probability of a thickness that is listed and drawn."""
_HEADER = (
    "position_px",
    "R",
    "G",
    "B",
    "order",
    "thickness_nm",
    "stderr_nm",
    "probability",
    "delta_e",
    "status",
)


def report(made: ThicknessMap) -> str:
    """Describe a map: its positions, thicknesses and how many of them are sure."""
    best, status = made.found.thickness[..., 0], made.found.status
    names, counts = np.unique(status, return_counts=True)
    share = ", ".join(f"{100 * n / status.size:.3g} % {name}" for name, n in zip(names, counts, strict=True))
    low, middle, high = np.percentile(best, [0, 50, 100])
    lines = [
        made.path,
        f"    thickness  {low:.1f} to {high:.1f} nm, {middle:.1f} nm in the median",
        f"    errors     {np.median(made.found.stderr[..., 0]):.2g} nm in the median (noise alone)",
        f"    status     {share}",
        f"    misfit     ΔE*ab {np.median(made.found.delta_e[..., 0]):.2g} in the median (CIE 1976)",
    ]
    lines += [f"    {'' if i else 'read':<9}  {note}" for i, note in enumerate(made.notes)]
    return "\n".join([*lines, ""])


def to_json(made: ThicknessMap) -> dict[str, Any]:
    """Convert to a dictionary: a summary, and for a strip the most probable thickness at each position."""
    names, counts = np.unique(made.found.status, return_counts=True)
    best = made.found.thickness[..., 0]
    record: dict[str, Any] = {
        "schema": SCHEMA,
        "data": {"path": made.path, "sha256": made.sha256, "signal": made.space, "points": best.size},
        "strip" if made.position is not None else "region": made.where,
        "status": {str(name): int(n) for name, n in zip(names, counts, strict=True)},
        "converged": made.converged,
        "thickness": {
            "least": number(best.min()),
            "median": number(np.median(best)),
            "largest": number(best.max()),
        },
        "unit": "nm",
        "notes": list(made.notes),
        "versions": versions(),
    }
    if made.position is not None:
        columns = zip(("thickness", "stderr", "probability", "delta_e"), made.found, strict=False)
        record["positions"] = {
            "position_px": [number(x) for x in made.position],
            **{name: [number(x) for x in values[:, 0]] for name, values in columns},
            "status": made.found.status.tolist(),
        }
    return record


def to_csv(made: ThicknessMap) -> str:
    """Format a strip as rows, one for each admissible thickness of each position."""
    films, rows = made.found, []
    assert made.position is not None
    for i, (at, colour) in enumerate(zip(made.position, made.colours, strict=True)):
        for order in np.flatnonzero(np.nan_to_num(films.probability[i]) >= LEAST):
            columns = (films.thickness, films.stderr, films.probability, films.delta_e)
            values = [f"{float(x[i, order]):.6g}" for x in columns]
            rows.append([f"{at:.6g}", *(f"{x:.5f}" for x in colour), order + 1, *values, films.status[i]])
    return csv_rows(_HEADER, rows)


def draw(made: ThicknessMap, name: str = "") -> Figure:
    """Draw a strip with every admissible thickness, or a map with its probability."""
    return _strip(made, name) if made.position is not None else _region(made, name)


def write_map(folder: str | os.PathLike[str], made: ThicknessMap) -> Path:
    """Write result.json, report.txt, map.png, and strip.csv or arrays (.npy, nm), each complete or not.

    **Raises:** UsageError where the folder holds files that pellicle did not write, or cannot be written.
    """
    target = new_folder(folder)
    write_text(target / MARKER, indented(to_json(made)), overwrite=True)  # first: it marks the folder
    write_text(target / "report.txt", report(made), overwrite=True)
    if made.position is not None:
        write_text(target / "strip.csv", to_csv(made), overwrite=True)
    else:
        arrays = zip(("thickness", "stderr", "probability"), made.found, strict=False)
        for key, values in arrays:
            with replacing(target / f"{key}.npy", overwrite=True) as draft, draft.open("wb") as file:
                np.save(file, values[..., 0].astype(np.float32))
    save_figure(draw(made, Path(made.path).name), target / "map.png", overwrite=True)
    return target


def _strip(made: ThicknessMap, name: str) -> Figure:
    figure = new_figure(7.0, 4.6)
    shown, axes = figure.subplots(2, 1, sharex=True, height_ratios=[1, 4])
    position = made.position
    assert position is not None
    extent = (position[0] - 0.5, position[-1] + 0.5, 1.5, -0.5)
    shown.imshow(
        np.clip(np.stack([made.colours, made.fitted]), 0, 1),
        aspect="auto",
        interpolation="nearest",
        extent=extent,
    )
    shown.set_yticks([0, 1], ["data", "fit"])
    shown.tick_params(length=0)
    shown.set_title(name.replace("$", r"\$"))
    films = made.found
    for order in range(films.thickness.shape[1] - 1, -1, -1):
        probability = np.nan_to_num(films.probability[:, order])
        seen = probability >= LEAST
        if not seen.any():
            continue
        colour, label = (
            (BLUE, "most probable") if order == 0 else (GREY, "other orders" if order == 1 else None)
        )
        axes.errorbar(
            position[seen],
            films.thickness[seen, order],
            films.stderr[seen, order],
            fmt=".",
            color=colour,
            alpha=1.0 if order == 0 else 0.5,
            markersize=3,
            elinewidth=0.6,
            label=label,
        )
    misfit = films.status == "misfit"
    if misfit.any():
        axes.plot(
            position[misfit], films.thickness[misfit, 0], "x", color=ORANGE, markersize=4, label="misfit"
        )
    axes.set(xlabel="position along the strip (pixels)", ylabel="thickness (nm)")
    axes.legend(frameon=False, fontsize="small")
    return figure


def _region(made: ThicknessMap, name: str) -> Figure:
    height, width = made.found.status.shape
    figure = new_figure(10.0, float(np.clip(0.6 + 3.0 * height / width, 2.4, 8.0)))
    panels = figure.subplots(1, 3)
    panels[0].imshow(np.clip(made.colours, 0, 1), interpolation="nearest")
    panels[0].set_title(name.replace("$", r"\$"))
    parts = (
        ("thickness (nm)", made.found.thickness, "viridis"),
        ("probability", made.found.probability, "cividis"),
    )
    for axes, (label, values, colours) in zip(panels[1:], parts, strict=True):
        limits = {"vmin": 0, "vmax": 1} if label == "probability" else {}
        image = axes.imshow(values[..., 0], cmap=colours, interpolation="nearest", **limits)
        axes.set_title(label)
        figure.colorbar(image, ax=axes, shrink=0.8)
    for axes in panels:
        axes.set_xlabel("x (pixels)")
    panels[0].set_ylabel("y (pixels)")
    return figure
