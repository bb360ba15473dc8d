"""Reading of colours from CSV: R, G, B, or X, Y, Z, or x, y, Y, or L*, a*, b*, of one film or several."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from pellicle.data.colour_columns import (
    EXAMPLE,
    bare_name,
    channel_sets,
    colour_table,
    first_cells,
    is_colour_header,
    named_cells,
)
from pellicle.data.colour_scale import scaled
from pellicle.data.colours import SPACES
from pellicle.data.tabular.table import Table
from pellicle.data.tabular.text import TextFile, open_binary, read_bytes, text_file
from pellicle.errors import DataError, UsageError

_ANGLES = ("angle", "aoi", "angle of incidence")
_NAMES = ("name", "film", "sample", "patch", "label", "id")
_HEAD = 65_536
"""Bytes in which the header is looked for."""
_STATED = re.compile(r"signal (rgb|srgb|xyz|lab)\b")


class ColourRows(NamedTuple):
    """Colours of one film as a file gives them, in the units of `pellicle.data.colours.Colours`."""

    space: str
    values: np.ndarray  # (colours, 3)
    sigma: np.ndarray | None  # (colours, 3)
    angle: np.ndarray | None  # (colours,), degrees
    lines: np.ndarray | None
    notes: tuple[str, ...]
    name: str = ""
    path: str = ""
    sha256: str = ""
    sight: str = ""  # "observer 1964 under D65", where the file states it


class _Columns(NamedTuple):
    kind: str  # a key of _SETS
    channels: list[int]
    sigma: list[int]  # none, one for all, or three
    angle: int | None
    name: int | None
    unit: str | None
    ignored: list[str]


def read_colour_rows(
    path: str | os.PathLike[str],
    space: str | None = None,
    *,
    unit: str | None = None,
    columns: str | Sequence[str] | None = None,
) -> list[ColourRows]:
    """Read colours from CSV, those of each film by itself.

    The header names three channels: R, G, B (sRGB unless `space` or the file says "rgb"), X, Y, Z, or x, y,
    Y, or L*, a*, b*. It may name angle_deg; sigma for all channels, or sigma_R and so on; and name, which
    tells films apart: rows of one name are one film at several angles.

    **Arguments:**

    - `space`: "rgb", "srgb", "xyz" or "lab" where the file does not say it.
    - `unit` of the values, "fraction", "percent" or "8-bit", where they do not show it.
    - `columns`: names in the order of the columns, "_" to skip one; replaces the header.

    **Raises:** DataError or UsageError: one sentence with file, line and remedy.
    """
    file = text_file(*read_bytes(path), path)
    names, rows, cells, delimiter = named_cells(file, columns)
    found = _recognised(names, file.path)
    space = _space(file, found.kind, space)
    comma = delimiter != "," and any("," in row[i] for row in cells for i in found.channels)
    table = colour_table(file, names, rows, cells, comma)
    numbers = table.numbers([*found.channels, *found.sigma, *([] if found.angle is None else [found.angle])])
    values, rest = np.stack(numbers[:3], axis=1), numbers[3:]
    sigma = np.stack((rest[: len(found.sigma)] * 3)[:3], axis=1) if found.sigma else None
    angle = rest[-1] if found.angle is not None else None
    if found.kind == "xyY":
        values = _from_chromaticity(table, found.channels, values)
    where = [table.places(position) for position in found.channels]
    values, sigma, note = scaled(values, sigma, space, unit or found.unit, where, file.path)
    shown = ", ".join(names[i].strip() for i in found.channels)
    notes = [*table.notes, f"{shown} read as {_MEANING[space]}", *([note] if note else [])]
    notes += [f"ignored: {', '.join(found.ignored)}"] if found.ignored else []
    films = np.array(["" if found.name is None else row[found.name] for row in cells])
    lines = np.array([row.number for row in rows])
    sight = next((c.text.strip() for c in file.comments if _SIGHT.fullmatch(c.text.strip())), "")
    return [
        ColourRows(
            space,
            values[own],
            None if sigma is None else sigma[own],
            None if angle is None else angle[own],
            lines[own],
            tuple(notes),
            film,
            file.path,
            file.sha256,
            sight,
        )
        for film in dict.fromkeys(films.tolist())
        for own in [films == film]
    ]


_SIGHT = re.compile(r"observer (1931|1964) under (E|A|D50|D55|D65|D75)")
"""Comment of pellicle's own files on the observer and the illuminant."""
_MEANING = {
    "srgb": "display values of sRGB",
    "rgb": "channels of a camera",
    "xyz": "CIE XYZ",
    "lab": "CIE 1976 L*, a*, b*",
}


def is_colour_table(path: str | os.PathLike[str]) -> bool:
    """Return True for a text file whose header names a colour. Raises DataError for an unreadable file."""
    with open_binary(path) as file:
        head = file.read(_HEAD)
    return is_colour_header(first_cells(text_file(head, "", path))[0])


def _recognised(names: Sequence[str], path: str) -> _Columns:
    """The columns by their names. Raises UsageError where they name no colour, or several."""
    sets = channel_sets(names)
    listed = ", ".join(repr(name) for name in names)
    if not sets:
        raise UsageError(
            f"{path}: no three columns are a colour among {listed}: name them R, G, B or X, Y, Z or x, y, Y"
            f" or L*, a*, b*, as in {EXAMPLE}"
        )
    if len(sets) > 1:
        raise UsageError(
            f"{path}: has more than one colour ({listed}): choose with `columns`, _ for the others"
        )
    [(kind, channels)] = sets.items()
    bare = [bare_name(name)[0] for name in names]
    twice = next((x for i, x in enumerate(bare) if x not in ("", "_") and x in bare[:i]), None)
    if twice is not None:
        raise DataError(f"{path}: the header names {twice!r} twice; rename one")
    plain = [re.sub(r"[\s_]+", " ", name).lower() for name in bare]
    one = [plain.index("sigma")] if "sigma" in plain else []
    each = [f"sigma {bare[i].lower()}" for i in channels]
    each = [plain.index(name) for name in each if name in plain]
    if each and (len(each) != 3 or one):
        raise DataError(f"{path}: needs sigma, or one of each channel ({listed}); add the missing columns")
    if kind == "xyY" and (one or each):
        raise UsageError(f"{path}: has standard deviations of x, y, Y: convert them to X, Y, Z")
    angle, name = (next((plain.index(x) for x in known if x in plain), None) for known in (_ANGLES, _NAMES))
    used = {*channels, *one, *each, angle, name}
    ignored = [name for i, name in enumerate(names) if i not in used and name.strip() not in ("", "_")]
    units = {bare_name(names[i])[1] for i in channels}
    if len(units) > 1:
        raise DataError(f"{path}: the channels are in different units ({listed}); write them in one")
    return _Columns(kind, channels, each or one, angle, name, units.pop(), ignored)


def _space(file: TextFile, kind: str, requested: str | None) -> str:
    """The space of the columns. Raises UsageError where it is not the requested one."""
    said = [match[1] for comment in file.comments if (match := _STATED.match(comment.text))]
    own = {"rgb": ("srgb", "rgb"), "xyz": ("xyz",), "xyY": ("xyz",), "lab": ("lab",)}[kind]
    stated = said[0] if said and said[0] in own else None
    if requested is None:
        return stated or own[0]
    if requested not in SPACES:
        raise UsageError(f"`signal` of colours must be one of {', '.join(SPACES)}, not {requested!r}")
    if requested not in own or (stated and requested != stated):
        raise UsageError(
            f"{file.path}: has colours in {stated or own[0]}, not in {requested}: leave `signal` out, or give"
            f" `signal={stated or own[0]!r}`"
        )
    return requested


def _from_chromaticity(table: Table, positions: list[int], values: np.ndarray) -> np.ndarray:
    """X, Y, Z of x, y, Y. Raises DataError for a chromaticity that cannot be."""
    x, y, luminance = values.T
    wrong = (y <= 0) | (x < 0) | (x + y > 1)
    if wrong.any():
        row = int(np.argmax(wrong))
        raise DataError(
            f"{table.where(row, positions[1])}: x = {x[row]:g}, y = {y[row]:g} are no chromaticity;"
            " correct them"
        )
    return np.stack([x / y * luminance, luminance, (1 - x - y) / y * luminance], axis=1)
