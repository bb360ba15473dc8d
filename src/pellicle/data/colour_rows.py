"""Colours in CSV: R, G, B, or X, Y, Z, or x, y, Y, or L*, a*, b*, of one film or several, and their scale."""

import os
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from pellicle.data.options import SPACES
from pellicle.data.tabular.table import Table, plain_columns
from pellicle.data.tabular.text import Line, TextFile, is_number, open_binary, read_bytes, split, text_file
from pellicle.data.tabular.units import colour_unit
from pellicle.errors import DataError, UsageError
from pellicle.signals.limits import Where, refuse_first

_ANGLES = ("angle", "aoi", "angle of incidence")
_NAMES = ("name", "film", "sample", "patch", "label", "id")
_HEAD = 65_536
"""Bytes in which the header is looked for."""
_STATED = re.compile(r"signal (rgb|srgb|xyz|lab)\b")
_SIGHT = re.compile(r"observer (1931|1964) under (E|A|D50|D55|D65|D75)")
"""Comment of pellicle's own files on the observer and the illuminant."""
MEANING = {
    "srgb": "display values of sRGB",
    "rgb": "channels of a camera",
    "xyz": "CIE XYZ",
    "lab": "CIE 1976 L*, a*, b*",
}
_SETS = {
    "rgb": (("r", "red"), ("g", "green"), ("b", "blue")),
    "xyz": (("X",), ("Y",), ("Z",)),
    "xyY": (("x",), ("y",), ("Y",)),
    "lab": (("L*", "L", "l*"), ("a*", "a"), ("b*", "b")),
}
"""Names of the channels of each set; case matters where it tells X, Y, Z from x, y, Y."""
_UNITS = {"%": "percent", "percent": "percent", "8 bit": "8-bit", "8-bit": "8-bit", "8bit": "8-bit"}
_EXAMPLE = '`columns=["angle_deg", "R", "G", "B"]`'
_FULL = {"fraction": 1.0, "percent": 100.0, "8-bit": 255.0, "16-bit": 65535.0}
_HIGHEST = 1.5
"""Largest fraction: calibrations are off by half at most."""


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
    balance: float | None = None  # relative standard uncertainty of the white balance
    sight: str = ""  # "observer 1964 under D65", where the file states it


@dataclass(frozen=True)
class ColourCells:
    """Cells of a file of colours, and the names of its columns.

    `sets` are the positions of the channels of every set that the names have: rgb, xyz, xyY and lab.
    """

    file: TextFile
    names: list[str]
    rows: list[Line]
    cells: list[list[str]]
    delimiter: str
    sets: dict[str, list[int]]

    def table(self, positions: Sequence[int]) -> Table:
        """Return the table of the cells, whose numbers are at these positions."""
        comma = self.delimiter != "," and any("," in row[i] for row in self.cells for i in positions)
        rows = list(zip(self.rows, self.cells, strict=True))
        table = plain_columns(self.names, rows, [], decimal="," if comma else ".")
        return replace(table, path=self.file.path, sha256=self.file.sha256)


class _Columns(NamedTuple):
    kind: str  # a key of _SETS
    channels: list[int]
    sigma: list[int]  # none, one for all, or three
    angle: list[int]  # one or none
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
    cells = colour_cells(path, columns)
    file, chosen = cells.file, _recognised(cells)
    space = _space(file, chosen.kind, space)
    table = cells.table(chosen.channels)
    numbers = table.numbers([*chosen.channels, *chosen.sigma, *chosen.angle])
    values, errors = np.stack(numbers[:3], axis=1), numbers[3 : 3 + len(chosen.sigma)]
    if chosen.kind == "xyY":
        values = _from_chromaticity(table, chosen.channels, values)
    sigma = np.stack((errors * 3)[:3], axis=1) if errors else None
    where = [table.places(position) for position in chosen.channels]
    values, sigma, note = scaled(values, sigma, space, unit or chosen.unit, where, file.path)
    shown = ", ".join(cells.names[i].strip() for i in chosen.channels)
    notes = [*table.notes, f"{shown} read as {MEANING[space]}", *([note] if note else [])]
    notes += [f"ignored: {', '.join(chosen.ignored)}"] if chosen.ignored else []
    films = np.array(["" if chosen.name is None else row[chosen.name] for row in cells.cells])
    lines = np.array([row.number for row in cells.rows])
    sight = next((c.text.strip() for c in file.comments if _SIGHT.fullmatch(c.text.strip())), "")
    made = []
    for film in dict.fromkeys(films.tolist()):
        of_film = films == film
        spread = None if sigma is None else sigma[of_film]
        angle = numbers[-1][of_film] if chosen.angle else None
        rows = ColourRows(space, values[of_film], spread, angle, lines[of_film], tuple(notes), film)
        made.append(rows._replace(path=file.path, sha256=file.sha256, sight=sight))
    return made


def is_colour_table(path: str | os.PathLike[str]) -> bool:
    """Return True for a text file whose header names three channels of a colour, and no wavelength or angle.

    Raises DataError for an unreadable file.
    """
    with open_binary(path) as file:
        head = file.read(_HEAD)
    names, _ = _first_cells(text_file(head, "", path))
    plain = {name.strip().lower().split("_")[0].split(" ")[0] for name in names}
    foreign = plain & {"wavelength", "wl", "lambda", "energy", "wavenumber", "frequency", "theta", "phi"}
    return not foreign and bool(_channel_sets(names))


def _recognised(cells: ColourCells) -> _Columns:
    """The columns by their names. Raises UsageError where they name no colour, or several."""
    names, path = cells.names, cells.file.path
    listed = ", ".join(repr(name) for name in names)
    if not cells.sets:
        raise UsageError(
            f"{path}: no three columns are a colour among {listed}: name them R, G, B or X, Y, Z or x, y, Y"
            f" or L*, a*, b*, as in {_EXAMPLE}"
        )
    if len(cells.sets) > 1:
        raise UsageError(
            f"{path}: has more than one colour ({listed}): choose with `columns`, _ for the others"
        )
    [(kind, channels)] = cells.sets.items()
    bare, units = zip(*map(bare_name, names), strict=True)
    twice = next((x for i, x in enumerate(bare) if x not in ("", "_") and x in bare[:i]), None)
    if twice is not None:
        raise DataError(f"{path}: the header names {twice!r} twice; rename one")
    plain = [re.sub(r"[\s_]+", " ", name).lower() for name in bare]
    common = [plain.index("sigma")] if "sigma" in plain else []
    single = [plain.index(name) for i in channels if (name := f"sigma {bare[i].lower()}") in plain]
    if single and (len(single) != 3 or common):
        raise DataError(f"{path}: needs sigma, or one of each channel ({listed}); add the missing columns")
    if kind == "xyY" and (common or single):
        raise UsageError(f"{path}: has standard deviations of x, y, Y: convert them to X, Y, Z")
    angle, name = ([plain.index(x) for x in known if x in plain][:1] for known in (_ANGLES, _NAMES))
    used = {*channels, *common, *single, *angle, *name}
    ignored = [name for i, name in enumerate(names) if i not in used and name.strip() not in ("", "_")]
    if len({units[i] for i in channels}) > 1:
        raise DataError(f"{path}: the channels are in different units ({listed}); write them in one")
    return _Columns(
        kind, channels, single or common, angle, next(iter(name), None), units[channels[0]], ignored
    )


def _space(file: TextFile, kind: str, requested: str | None) -> str:
    """The space of the columns. Raises UsageError where it is not the requested one."""
    said = [match[1] for comment in file.comments if (match := _STATED.match(comment.text))]
    spaces = {"rgb": ("srgb", "rgb"), "xyz": ("xyz",), "xyY": ("xyz",), "lab": ("lab",)}[kind]
    stated = said[0] if said and said[0] in spaces else None
    if requested is None:
        return stated or spaces[0]
    if requested not in SPACES:
        raise UsageError(f"`signal` of colours must be one of {', '.join(SPACES)}, not {requested!r}")
    if requested not in spaces or (stated and requested != stated):
        raise UsageError(
            f"{file.path}: has colours in {stated or spaces[0]}, not in {requested}: leave `signal` out, or"
            f" give `signal={stated or spaces[0]!r}`"
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


def _first_cells(file: TextFile) -> tuple[list[str], str]:
    """Cells of the first line and its delimiter, with which they name a colour if any does."""
    first = file.lines[0].text
    delimiter = max("\t;, ", key=lambda mark: (bool(_channel_sets(split(first, mark))), first.count(mark)))
    return split(first, delimiter), delimiter


def colour_cells(path: str | os.PathLike[str], columns: str | Sequence[str] | None = None) -> ColourCells:
    """Read the cells of a file of colours; rows are filled up with empty ones.

    `columns` names the columns in order, in place of the header.

    **Raises:** UsageError without a header, DataError without rows and for a row of too many cells.
    """
    file = text_file(*read_bytes(path), path)
    names, delimiter = _first_cells(file)
    headed = not any(is_number(cell, ",") for cell in names)
    if columns is not None:
        given = columns.split(",") if isinstance(columns, str) else columns
        names = [name.strip() for name in given]
    elif not headed:
        raise UsageError(f"{path}: has no header, so name its columns, as in {_EXAMPLE}")
    rows = list(file.lines[headed:])
    if not rows:
        raise DataError(f"{path}: has no row of colours below its header; expected rows as 0.41,0.35,0.22")
    cells = [split(line.bare, delimiter) for line in rows]
    for line, row in zip(rows, cells, strict=True):
        if len(row) > len(names):
            raise DataError(
                f"{path}: line {line.number} has {len(row)} values where {len(names)} columns are named;"
                " correct that line"
            )
        row += [""] * (len(names) - len(row))
    return ColourCells(file, names, rows, cells, delimiter, _channel_sets(names))


def bare_name(name: str) -> tuple[str, str | None]:
    """Return a column's name without its unit, and the unit."""
    plain = name.strip()
    for mark, unit in _UNITS.items():
        for written in (f"({mark})", f"[{mark}]", f"_{mark.replace(' ', '_')}", f" {mark}"):
            if plain.lower().endswith(written):
                return plain[: -len(written)].strip(), unit
    return re.sub(r"[\s_]*[(\[]?(deg|degrees|°)[)\]]?$", "", plain), None


def _channel_sets(names: Sequence[str]) -> dict[str, list[int]]:
    """The positions of the channels of every set that the names have: rgb, xyz, xyY and lab."""
    sets = {}
    bare = [bare_name(name)[0] for name in names]
    for kind, channels in _SETS.items():
        spelt = [name.lower() for name in bare] if kind == "rgb" else bare
        positions = [next((i for i, name in enumerate(spelt) if name in known), -1) for known in channels]
        if min(positions) >= 0:
            sets[kind] = positions
    return sets


def scaled(
    values: np.ndarray,
    sigma: np.ndarray | None,
    space: str,
    unit: str | None,
    where: Sequence[Where],
    path: str,
) -> tuple[np.ndarray, np.ndarray | None, str]:
    """Convert colours (colours, 3) of a file to those of `Colours`, with a sentence on what was done.

    R, G, B that are whole numbers above 1 are 8-bit, or 16-bit above 255; X, Y, Z are percent where a Y is
    above 1.5. L*, a*, b* are taken as they are. `where` are the places of each channel's values.

    **Raises:** UsageError where the unit is unclear or unknown, DataError for values beyond every unit.
    """
    if unit is not None and colour_unit(unit) not in _FULL:
        raise UsageError(f"`signal_unit` of colours must be one of {', '.join(_FULL)}, not {unit!r}")
    if space == "lab":
        lightness = values[:, 0]
        wrong = (lightness < -1) | (lightness > 150)
        refuse_first(lightness, wrong, where[0], "is no L*, of 0 to 100; correct it")
        if lightness.max() <= 1:
            raise DataError(
                f"{path}: L* is at most {lightness.max():g}, and runs from 0 to 100; multiply it by 100"
            )
        return values, sigma, ""
    chosen = (unit and colour_unit(unit)) or _unit_of(values, space, path)
    full = _FULL[chosen]
    if np.max(values) > _HIGHEST * full or (unit and chosen.endswith("bit") and np.max(values) > full):
        wrong = np.max(values, axis=1) == np.max(values)
        channel = int(np.argmax(np.max(values, axis=0)))
        reason = f"is beyond {full:g}, the {'white' if space == 'xyz' else 'largest'} in {chosen}; correct it"
        refuse_first(values[:, channel], wrong, where[channel], reason)
    white = "Y = 1" if space == "xyz" else "1"
    note = f"values divided by {full:g} ({chosen})" if full != 1 else f"values as they are: {white} is white"
    return values / full, None if sigma is None else sigma / full, note


def _unit_of(values: np.ndarray, space: str, path: str) -> str:
    """The unit that the values show. Raises UsageError where they show none, DataError beyond all."""
    if space == "xyz":
        highest = np.max(values[:, 1])
        if highest <= _HIGHEST * _FULL["percent"]:
            return "fraction" if highest <= _HIGHEST else "percent"
        raise DataError(
            f"{path}: Y goes up to {highest:g}, beyond the 100 of a perfect reflector in percent; divide X,"
            " Y, Z by the Y of that white"
        )
    highest, whole = np.max(values), bool(np.all(values == np.round(values)))
    if highest <= (1 if whole else _HIGHEST):
        return "fraction"
    if highest <= _FULL["8-bit"] and (whole or highest > _FULL["percent"]):
        return "8-bit"
    if whole and highest <= _FULL["16-bit"]:
        return "16-bit"
    raise UsageError(
        f'{path}: R, G, B go up to {highest:g}, in an unclear unit: state it, `signal_unit="8-bit"`,'
        ' `signal_unit="percent"` or `signal_unit="fraction"`'
    )
