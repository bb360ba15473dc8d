"""Tables with a row for each time: traces of one or a few wavelengths, and spectra."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from pellicle.data.cubes.raw_cube import WAVELENGTH, Asked, RawCube, Stored
from pellicle.data.formats.detect import read_tables
from pellicle.data.tabular.text import decoded, is_number, open_binary
from pellicle.errors import DataError, UsageError

TIME = "time"
FEW = 4
"""Most wavelengths of a trace; more are spectra, and each of them has a fit of its own first."""
_HEAD = 2**16
_TIME = re.compile(
    r"(?:elapsed |process |run |etch |growth )?(?:time|zeit|temps|tiempo|t)"
    r"(?:[\s_/]*[(\[]?\s*([a-z]*)\s*[)\]]?)?"
)
_SECONDS = {"s": "s", "sec": "s", "second": "s", "seconds": "s", "min": "min", "minutes": "min", "h": "h"}
_COLOUR = re.compile(r"(\d+(?:[.,]\d+)?)\s*_?(nm|um|µm)(?![a-z])", re.IGNORECASE)
_REFLECTED = re.compile(r"\b(reflect\w*|reflexion\w*|r)\b", re.IGNORECASE)
_PASSED = re.compile(r"\b(transm\w*|t)\b", re.IGNORECASE)


def is_trace(path: Path) -> bool:
    """True for a text table whose first column is a time, and another one's head names a wavelength, or all
    others are numbers."""
    return path.is_file() and bool(_heads(path))


def _heads(path: Path) -> list[str]:
    """Heads of such a table, none of any other file."""
    with open_binary(path) as opened:
        head = opened.read(_HEAD)
    if b"\0" in head:
        return []
    for line in decoded(head).splitlines():
        first, *others = (cell.strip(" \"'") for cell in re.split(r"[\t;,]", line.strip("# \r")))
        named = others and _is_time(first)
        if named and (_COLOUR.search(" ".join(others)) or all(map(is_number, others))):
            return [first, *others]
    return []


def _is_time(head: str) -> bool:
    return _TIME.fullmatch(head.lower()) is not None


def read_trace(path: Path, asked: Asked) -> RawCube:
    """Read a trace.

    **Raises:** DataError, one sentence with the file and the remedy.
    """
    table = read_tables(path)[0]
    heads = [name.strip(" \"'") for name in table.names or _heads(path)]
    found = _TIME.fullmatch(heads[0].lower())
    if found is None:
        raise DataError(f"{path}: the first column must be the time: head it Time (s)")
    unit = _SECONDS.get(found[1] or "")
    if unit is None:
        raise DataError(f"{path}: {table.label(0)} has no unit of s, min or h: head it Time (s)")
    columns = {i: match for i, head in enumerate(heads) if i and (match := _COLOUR.search(head))}
    nm = [float(m[1].replace(",", ".")) * (1.0 if m[2].lower() == "nm" else 1000.0) for m in columns.values()]
    plain = not columns
    if plain:
        columns, nm = dict.fromkeys(range(1, len(heads))), [float(head) for head in heads[1:]]
    if len(set(nm)) < len(nm):
        raise DataError(f"{path}: has a wavelength twice: keep one column of each")
    time, *values = table.numbers([0, *columns])
    texts = ["" if plain else _COLOUR.sub(" ", heads[i]).replace("_", " ") for i in columns]
    order = np.argsort(nm)
    reflected = all(_REFLECTED.search(text) for text in texts)
    passed = not reflected and all(_PASSED.search(text) for text in texts)
    stated = len(nm) > FEW and asked.signal is not None  # the light of a trace may be any of them
    calibrated = reflected or passed or stated
    if len(nm) > FEW and not calibrated:
        raise UsageError(
            f'{path}: its heads name no quantity; state it with `signal="R"` or `signal="T"` (unit:'
            ' `signal_unit="percent"`, ...)'
        )
    note = "" if calibrated else "values in an arbitrary unit: no head names a reflectance R"
    left = [heads[i] for i in range(1, len(heads)) if i not in columns]
    what = "trace" if len(nm) <= FEW else "spectra"
    notes = [f"{what}: {len(time)} times, wavelengths: {len(nm)}, a column for each", note, *table.notes]
    notes += [f"columns left out, whose heads name no wavelength: {', '.join(left)}"] if left else []
    rows = np.stack(values, axis=1)[:, order]
    return RawCube(
        str(path),
        {"values": Stored(rows, (TIME, WAVELENGTH))},
        (TIME,),
        np.asarray(nm)[order],
        None if plain else "nm",
        files=(path,),
        signal=asked.signal or ("T" if passed else "R"),
        signal_unit="percent" if all("%" in text for text in texts) else None if stated else "fraction",
        calibrated=calibrated,
        coords={TIME: time},
        units={TIME: unit},
        notes=tuple(filter(None, notes)),
    )
