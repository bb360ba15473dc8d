"""Thickness maps of photographs: text, JSON, figure, and their folder."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pellicle.files import replacing
from pellicle.mapping.photograph import ThicknessMap
from pellicle.reporting.json_record import strict, versions, write_result
from pellicle.reporting.matplotlib_figure import BLUE, GREY, ORANGE, new_figure, plain
from pellicle.reporting.plain_text import csv_rows

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SCHEMA = "pellicle.map/1"
LEAST = 1e-3
"""Least probability of a thickness that is listed and drawn."""
_HEADER = (
    *("position_px", "R", "G", "B"),
    *("order", "thickness_nm", "stderr_nm", "probability", "delta_e", "status"),
)


def report(made: ThicknessMap) -> str:
    """Describe a map: its positions, thicknesses and how many of them are sure."""
    films = made.found
    names, counts = np.unique(films.status, return_counts=True)
    share = ", ".join(
        f"{100 * n / films.status.size:.3g} % {name}" for name, n in zip(names, counts, strict=True)
    )
    low, middle, high = np.percentile(films.thickness[..., 0], [0, 50, 100])
    rows = [
        ("thickness", f"{low:.1f} to {high:.1f} nm, {middle:.1f} nm in the median"),
        ("errors", f"{np.median(films.stderr[..., 0]):.2g} nm in the median (noise and camera)"),
        ("status", share),
        ("misfit", f"ΔE*ab {np.median(films.delta_e[..., 0]):.2g} in the median (CIE 1976)"),
        *(("" if i else "read", note) for i, note in enumerate(made.notes)),
    ]
    return "\n".join([made.path, *(f"    {label:<9}  {text}" for label, text in rows), ""])


def to_json(made: ThicknessMap) -> dict[str, Any]:
    """Convert to a dictionary: a summary, and for a strip the most probable thickness at each position."""
    names, counts = np.unique(made.found.status, return_counts=True)
    best = made.found.thickness[..., 0]
    record = {
        "schema": SCHEMA,
        "data": {"path": made.path, "sha256": made.sha256, "signal": made.space, "points": best.size},
        "strip" if made.position is not None else "region": made.where,
        "status": dict(zip(names, counts, strict=True)),
        "converged": made.converged,
        "thickness": {"least": best.min(), "median": np.median(best), "largest": best.max()},
        "unit": "nm",
        "notes": made.notes,
        "versions": versions(),
    }
    if made.position is not None:
        columns = zip(("thickness", "stderr", "probability", "delta_e"), made.found, strict=False)
        record["positions"] = {
            "position_px": made.position,
            **{name: values[:, 0] for name, values in columns},
            "status": made.found.status,
        }
    return strict(record)


def to_csv(made: ThicknessMap) -> str:
    """Format a strip as rows, one for each admissible thickness of each position."""
    films, rows = made.found, []
    assert made.position is not None
    for i, (position, colour) in enumerate(zip(made.position, made.colours, strict=True)):
        for order in np.flatnonzero(np.nan_to_num(films.probability[i]) >= LEAST):
            values = [f"{float(x[i, order]):.6g}" for x in films[:4]]
            rgb = (f"{x:.5f}" for x in colour)
            rows.append([f"{position:.6g}", *rgb, order + 1, *values, films.status[i]])
    return csv_rows(_HEADER, rows)


def write_map(folder: str | os.PathLike[str], made: ThicknessMap, recipe_path: str = "") -> Path:
    """Write result.json, report.txt, map.png, and strip.csv or arrays (.npy, nm), each complete or not.

    `recipe_path` is that of the scene.

    **Raises:** UsageError where the folder holds files that pellicle did not write, or cannot be written.
    """
    name = Path(made.path).name
    contents = {"report.txt": report(made), "map.png": draw(made, name)}
    contents |= {} if made.position is None else {"strip.csv": to_csv(made)}
    record = to_json(made) | ({"scene": {"recipe": recipe_path}} if recipe_path else {})
    target = write_result(folder, record, contents)
    if made.position is None:
        for key in ("thickness", "stderr", "probability"):
            values = getattr(made.found, key)[..., 0].astype(np.float32)
            with replacing(target / f"{key}.npy", overwrite=True) as draft, draft.open("wb") as file:
                np.save(file, values)
    return target


def draw(made: ThicknessMap, name: str = "") -> Figure:
    """Draw a strip with every admissible thickness, or a map with its probability."""
    if made.position is None:
        height, width = made.found.status.shape
        figure = new_figure(10.0, float(np.clip(0.6 + 3.0 * height / width, 2.4, 8.0)))
        panels = figure.subplots(1, 3)
        panels[0].imshow(np.clip(made.colours, 0, 1), interpolation="nearest")
        panels[0].set_title(plain(name))
        parts = (
            ("thickness (nm)", made.found.thickness, {"cmap": "viridis"}),
            ("probability", made.found.probability, {"cmap": "cividis", "vmin": 0, "vmax": 1}),
        )
        for axes, (label, values, style) in zip(panels[1:], parts, strict=True):
            image = axes.imshow(values[..., 0], interpolation="nearest", **style)
            axes.set_title(label)
            figure.colorbar(image, ax=axes, shrink=0.8)
        for axes in panels:
            axes.set_xlabel("x (pixels)")
        panels[0].set_ylabel("y (pixels)")
        return figure
    figure, position, films = new_figure(7.0, 4.6), made.position, made.found
    shown, axes = figure.subplots(2, 1, sharex=True, height_ratios=[1, 4])
    extent = (position[0] - 0.5, position[-1] + 0.5, 1.5, -0.5)
    patches = np.clip(np.stack([made.colours, made.fitted]), 0, 1)
    shown.imshow(patches, aspect="auto", interpolation="nearest", extent=extent)
    shown.set_yticks([0, 1], ["data", "fit"])
    shown.tick_params(length=0)
    shown.set_title(plain(name))
    for order in reversed(range(films.thickness.shape[1])):
        seen = np.nan_to_num(films.probability[:, order]) >= LEAST
        if not seen.any():
            continue
        style: dict[str, Any] = {"color": GREY, "alpha": 0.5, "label": "other orders" if order == 1 else None}
        if order == 0:
            style = {"color": BLUE, "label": "most probable"}
        errors = films.stderr[seen, order]
        style |= {"fmt": ".", "markersize": 3, "elinewidth": 0.6}
        axes.errorbar(position[seen], films.thickness[seen, order], errors, **style)
    if (misfit := films.status == "misfit").any():
        marked = position[misfit], films.thickness[misfit, 0]
        axes.plot(*marked, "x", color=ORANGE, markersize=4, label="misfit")
    axes.set(xlabel="position along the strip (pixels)", ylabel="thickness (nm)")
    axes.legend(frameon=False, fontsize="small")
    return figure
