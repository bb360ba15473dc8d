"""Depth profiles: text, JSON, tables and figure, and their folder."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pellicle.reporting import matplotlib_figure
from pellicle.reporting.drawable import Band, Line, Panel, Place, Section, Table
from pellicle.reporting.json_record import strict, taken, versions, write_result
from pellicle.reporting.plain_text import csv_rows, csv_text
from pellicle.simulation.depth_profile import DepthProfile
from pellicle.simulation.depth_profile import Section as Group

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SCHEMA = "pellicle.depth/1"
COLOURS = ("residual", "fit", "blue", "green", "#CC79A7", "#56B4E9", "#E69F00")
"""Okabe and Ito's; further lines repeat them."""


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
    record = {
        "schema": SCHEMA,
        "data": {"path": path},
        "wavelength_nm": profile.wavelength,
        **taken(profile, "R", "T"),
        "absorptance": dict(zip(profile.media, profile.absorptance, strict=True)),
        "at_nm": profile.at,
        "shares": profile.shares,
        "sections": [
            {
                **taken(section, "above", "below"),
                "layers": [
                    dict(zip(("name", "upper_nm", "lower_nm"), x, strict=True)) for x in section.layers
                ],
                "depth_nm": section.depth,
                "intensity": section.intensity,
                "absorbed_per_nm": section.absorbed,
            }
            for section in profile.sections
        ],
        "versions": versions(),
    }
    return strict(record)


def write_depth_profile(
    folder: str | os.PathLike[str], profile: DepthProfile, path: str, comments: list[str]
) -> Path:
    """Write result.json, absorptance.csv, depth.csv and depth.png into a folder, and return it.

    **Raises:** UsageError where the folder holds files that pellicle did not write.
    """
    columns = {"wavelength_nm": profile.wavelength, "R": profile.R, "T": profile.T}
    for name, row in zip(profile.media, profile.absorptance, strict=True):
        columns[f"A of {name.replace(',', ';')}"] = row
    contents = {
        "absorptance.csv": csv_text(Table(columns, comments)),
        "depth.csv": _depth_csv(profile, comments),
        "depth.png": draw(profile),
    }
    return write_result(folder, to_json(profile, path), contents)


def _depth_csv(profile: DepthProfile, comments: list[str]) -> str:
    about = "depth from the uppermost interface of each group of layers"
    names = ("wavelength_nm", "group", "medium", "depth_nm", "intensity", "absorbed_per_nm")
    rows = []
    for i, nm in enumerate(profile.at):
        for j, section in enumerate(profile.sections, start=1):
            columns = (section.medium, section.depth, section.intensity[i], section.absorbed[i])
            for medium, depth, *shares in zip(*columns, strict=True):
                numbers = f"{depth:.10g}", *(f"{x:.8g}" for x in shares)
                rows.append((nm, j, medium.replace(",", ";"), *numbers))
    return csv_rows(names, rows, [*comments, about])


def draw(profile: DepthProfile) -> Figure:
    """Draw |E|² and the absorbed power against depth for each group of layers, absorptances below."""
    rows: list[list[Panel]] = [[], []]
    for i, group in enumerate(profile.sections):
        names = ("|E|², incident wave = 1", "absorbed power (% per nm)") if i == 0 else ("", "")
        for row, values, label in zip(rows, (group.intensity, 100 * group.absorbed), names, strict=True):
            # a line for each wavelength, interrupted at the interfaces: E_z and the absorbed power jump there
            medium = np.array(group.medium)
            breaks = np.flatnonzero(medium[1:] != medium[:-1]) + 1
            depth = np.insert(group.depth.astype(float), breaks, np.nan)
            lines = [
                Line(depth, np.insert(values[i], breaks, np.nan), f"{nm:g} nm", COLOURS[i % len(COLOURS)])
                for i, nm in enumerate(profile.at)
            ]
            legend: Place = "above" if not i and row is rows[0] else ""
            ends = group.depth[0], group.depth[-1]
            top = max(float(np.nanmax(line.y)) for line in lines)
            axes: Any = {"legend": legend, "limits": (0.0, 1.35 * top or 1.0), "span": ends}
            row.append(Panel(label, lines, [], 2.2, spans=_layers(group, named=row is rows[0]), **axes))
    sections = [Section("depth (nm)", rows), _against_wavelength(profile)]
    return matplotlib_figure.draw(sections, "", max(8.0, 4.2 * len(profile.sections)))


def _layers(group: Group, named: bool = True) -> list[tuple[float, float, str, float]]:
    """Ranges of depth with the names of their media, and the shades of layers."""
    low, high = group.depth[0], group.depth[-1]
    media = [(group.above, low, 0.0), *group.layers, (group.below, group.layers[-1][2], high)]
    shades = [0.0, *((0.22, 0.1)[j % 2] for j in range(len(group.layers))), 0.0]
    return [
        (left, right, name if named else "", shade)
        for (name, left, right), shade in zip(media, shades, strict=True)
    ]


def _against_wavelength(profile: DepthProfile) -> Section:
    """Absorptances above each other, transmittance and reflectance above them."""
    nm, bottom, bands = profile.wavelength, np.zeros_like(profile.wavelength), []
    rows = [*zip(profile.media, profile.absorptance, strict=True), ("T", profile.T), ("R", profile.R)]
    rows = [(name, row) for name, row in rows if np.max(np.abs(row)) > 1e-4]
    for i, (name, row) in enumerate(rows):
        colour = {"T": "#DDDDDD", "R": "#BBBBBB"}.get(name, (*COLOURS[1:], COLOURS[0])[i % len(COLOURS)])
        label = f"absorbed: {name}" if name not in "RT" else name
        bands.append(Band(nm, 100 * bottom, 100 * (bottom + row), label, colour, 1.0))
        bottom = bottom + row
    marks = [Line(np.full(2, at), np.array([0.0, 100.0]), "", "residual", "dotted", 0.7) for at in profile.at]
    label = "share of the incident\npower (%)"
    panel = Panel(label, marks, bands, 2.6, legend="above", limits=(0.0, 100.0), span=(nm[0], nm[-1]))
    return Section("wavelength (nm)", [[panel]])
