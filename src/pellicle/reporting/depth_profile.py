"""Depth profiles: text, JSON, tables and figure, and their folder."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pellicle.files import MARKER, new_folder, write_text
from pellicle.reporting.json_record import indented, number, versions
from pellicle.reporting.matplotlib_figure import (
    ABOVE,
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    new_figure,
    save_figure,
)
from pellicle.simulation.depth_profile import DepthProfile, Section

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SCHEMA = "pellicle.depth/1"
COLOURS = (BLACK, ORANGE, BLUE, GREEN, "#CC79A7", "#56B4E9", "#E69F00")
"""Okabe and Ito's; further lines repeat them."""
NARROW = 0.07
"""Layers thinner than this share of their panel have their names upright."""


def report(profile: DepthProfile, title: str) -> str:
    """Describe what each layer absorbs at the chosen wavelengths, in percent of the incident power."""
    rows = profile.shares
    width = max(len("share of"), *(len(name) for name in rows)) + 2
    lines = [title, f"    {'share of':<{width}}" + "".join(f"{nm:>10g} nm" for nm in profile.at)]
    for name, row in rows.items():
        lines.append(f"    {name:<{width}}" + "".join(f"{100 * x:>11.3f} %" for x in row))
    return "\n".join([*lines, ""])


def to_json(profile: DepthProfile, path: str) -> dict[str, Any]:
    """Convert to a dictionary: spectra of R, T and absorptances, and the field of each section."""
    return {
        "schema": SCHEMA,
        "data": {"path": path},
        "wavelength_nm": _numbers(profile.wavelength),
        "R": _numbers(profile.R),
        "T": _numbers(profile.T),
        "absorptance": {
            name: _numbers(row) for name, row in zip(profile.media, profile.absorptance, strict=True)
        },
        "at_nm": _numbers(profile.at),
        "shares": {name: _numbers(row) for name, row in profile.shares.items()},
        "sections": [
            {
                "above": section.above,
                "below": section.below,
                "layers": [
                    {"name": name, "upper_nm": number(upper), "lower_nm": number(lower)}
                    for name, upper, lower in section.layers
                ],
                "depth_nm": _numbers(section.depth),
                "intensity": [_numbers(row) for row in section.intensity],
                "absorbed_per_nm": [_numbers(row) for row in section.absorbed],
            }
            for section in profile.sections
        ],
        "versions": versions(),
    }


def write_depth_profile(
    folder: str | os.PathLike[str], profile: DepthProfile, path: str, comments: list[str]
) -> Path:
    """Write result.json, absorptance.csv, depth.csv and depth.png into a folder, and return it.

    **Raises:** UsageError where the folder holds files that pellicle did not write.
    """
    target = new_folder(folder)
    write_text(target / MARKER, indented(to_json(profile, path)), overwrite=True)
    write_text(target / "absorptance.csv", _absorptance_csv(profile, comments), overwrite=True)
    write_text(target / "depth.csv", _depth_csv(profile, comments), overwrite=True)
    save_figure(draw(profile), target / "depth.png", overwrite=True)
    return target


def _numbers(row: np.ndarray) -> list[float | None]:
    return [number(float(x)) for x in row]


def _absorptance_csv(profile: DepthProfile, comments: list[str]) -> str:
    names = [name.replace(",", ";") for name in profile.media]
    table = np.column_stack([profile.wavelength, profile.R, profile.T, *profile.absorptance])
    rows = [",".join(f"{x:.10g}" for x in row) for row in table]
    header = ",".join(["wavelength_nm", "R", "T", *(f"A of {name}" for name in names)])
    return "\n".join([*(f"# {line}" for line in comments), header, *rows, ""])


def _depth_csv(profile: DepthProfile, comments: list[str]) -> str:
    lines = [
        *(f"# {line}" for line in comments),
        "# depth from the uppermost interface of each group of layers",
    ]
    lines.append("wavelength_nm,group,medium,depth_nm,intensity,absorbed_per_nm")
    for i, nm in enumerate(profile.at):
        for j, section in enumerate(profile.sections, start=1):
            columns = (section.medium, section.depth, section.intensity[i], section.absorbed[i])
            for medium, depth, intensity, absorbed in zip(*columns, strict=True):
                name = medium.replace(",", ";")
                lines.append(f"{nm:.10g},{j},{name},{depth:.10g},{intensity:.8g},{absorbed:.8g}")
    return "\n".join([*lines, ""])


def draw(profile: DepthProfile) -> Figure:
    """Draw |E|² and the absorbed power against depth for each group of layers, and absorptances beside it."""
    count = len(profile.sections)
    figure = new_figure(4.2 * count + 4.4, 5.4)
    grid = figure.add_gridspec(2, count + 1)
    first: list[Axes | None] = [None, None]
    for i, section in enumerate(profile.sections):
        for row, (values, label) in enumerate(
            ((section.intensity, "|E|², incident wave = 1"), (section.absorbed, "absorbed power (% per nm)"))
        ):
            axes = figure.add_subplot(grid[row, i], sharey=first[row])
            first[row] = first[row] or axes
            _against_depth(axes, section, profile.at, values * (100 if row else 1))
            axes.set_ylabel(label if i == 0 else "")
            axes.set_ylim(bottom=0)
            if row == 0:
                _name_layers(axes, section)
            else:
                axes.set_xlabel("depth (nm)")
    _against_wavelength(figure.add_subplot(grid[:, -1]), profile)
    return figure


def _against_depth(axes: Axes, section: Section, at: np.ndarray, values: np.ndarray) -> None:
    for j, (_, upper, lower) in enumerate(section.layers):
        axes.axvspan(upper, lower, color=GREY, alpha=0.22 if j % 2 == 0 else 0.1, linewidth=0)
    medium = np.array(section.medium)
    for i, nm in enumerate(at):
        # each medium by itself: E_z and the absorbed power jump at the interfaces
        for name in dict.fromkeys(section.medium):
            here = medium == name
            line = axes.plot(section.depth[here], values[i][here], color=COLOURS[i % len(COLOURS)])[0]
            line.set_label(f"{nm:g} nm" if name == section.medium[0] else "_")
    axes.set_xlim(section.depth[0], section.depth[-1])


def _name_layers(axes: Axes, section: Section) -> None:
    low, high = section.depth[0], section.depth[-1]
    spans = [(section.above, low, 0.0), *section.layers, (section.below, section.layers[-1][2], high)]
    for name, upper, lower in spans:
        narrow = (lower - upper) / (high - low) < NARROW + 0.018 * len(name)
        axes.text(
            0.5 * (upper + lower),
            0.97,
            name.replace("$", r"\$"),
            transform=axes.get_xaxis_transform(),
            rotation=90 if narrow else 0,
            ha="center",
            va="top",
            fontsize="small",
        )
    bottom, top = axes.get_ylim()
    axes.set_ylim(bottom, bottom + 1.3 * (top - bottom))  # room for the names
    axes.legend(**ABOVE | {"loc": "lower right", "bbox_to_anchor": (1, 1)}, ncols=3, fontsize="small")


def _against_wavelength(axes: Axes, profile: DepthProfile) -> None:
    nm, bottom = profile.wavelength, np.zeros_like(profile.wavelength)
    rows = [*zip(profile.media, profile.absorptance, strict=True), ("T", profile.T), ("R", profile.R)]
    rows = [(name, row) for name, row in rows if np.max(np.abs(row)) > 1e-4]
    for i, (name, row) in enumerate(rows):
        colour = {"T": "#DDDDDD", "R": "#BBBBBB"}.get(name, (*COLOURS[1:], BLACK)[i % len(COLOURS)])
        label = f"absorbed: {name}" if name not in "RT" else name
        axes.fill_between(nm, 100 * bottom, 100 * (bottom + row), color=colour, linewidth=0, label=label)
        bottom = bottom + row
    for at in profile.at:
        axes.axvline(at, color=BLACK, linewidth=0.7, linestyle=":")
    axes.set(xlabel="wavelength (nm)", ylabel="share of the incident power (%)", ylim=(0, 100))
    axes.set_xlim(nm[0], nm[-1])
    axes.legend(fontsize="small", ncols=2, **ABOVE)
