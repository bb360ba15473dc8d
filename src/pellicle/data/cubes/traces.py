"""Tables of a trace: time, and the light of one or a few wavelengths in a column each."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from pellicle.data.cubes.raw_cube import WAVELENGTH, Asked, RawCube, Stored
from pellicle.data.formats.detect import read_tables
from pellicle.data.tabular.text import decoded, open_binary
from pellicle.errors import DataError

TIME = "time"
_HEAD = 2**14
_TIME = re.compile(
    r"(?:elapsed |process |run |etch |growth )?(?:time|zeit|temps|tiempo|t)"
    r"(?:[\s_/]*[(\[]?\s*([a-z]*)\s*[)\]]?)?"
)
_SECONDS = {"s": "s", "sec": "s", "second": "s", "seconds": "s", "min": "min", "minutes": "min", "h": "h"}
_COLOUR = re.compile(r"(\d+(?:[.,]\d+)?)\s*_?(nm|um|µm)(?![a-z])", re.IGNORECASE)
_REFLECTED = re.compile(r"\b(reflect\w*|reflexion\w*|r)\b", re.IGNORECASE)
_PASSED = re.compile(r"\b(transm\w*|t)\b", re.IGNORECASE)


def is_trace(path: Path) -> bool:
    """True for a text table whose first column is a time, and another one's head names a wavelength."""
    if not path.is_file():
        return False
    with open_binary(path) as opened:
        head = opened.read(_HEAD)
    if b"\0" in head:
        return False
    cells = [re.split(r"[\t;,]", line.strip("# \r\"'")) for line in decoded(head).splitlines()]
    return any(_is_time(row[0]) and _COLOUR.search(" ".join(row[1:])) for row in cells if len(row) > 1)


def _is_time(head: str) -> bool:
    return _TIME.fullmatch(head.strip(" \"'").lower()) is not None


def read_trace(path: Path, asked: Asked) -> RawCube:
    """Read a trace.

    **Raises:** DataError, one sentence with the file and the remedy.
    """
    table = read_tables(path)[0]
    heads = [name.strip(" \"'") for name in table.names or ()]
    found = _TIME.fullmatch(heads[0].lower()) if heads else None
    if found is None:
        raise DataError(f"{path}: the first column must be the time: head it Time (s)")
    unit = _SECONDS.get(found[1] or "")
    if unit is None:
        raise DataError(f"{path}: {table.label(0)} has no unit of s, min or h: head it Time (s)")
    columns = [(i, match) for i, head in enumerate(heads) if i and (match := _COLOUR.search(head))]
    nm = [float(m[1].replace(",", ".")) * (1.0 if m[2].lower() == "nm" else 1000.0) for _, m in columns]
    if len(set(nm)) < len(nm):
        raise DataError(f"{path}: has a wavelength twice: keep one column of each")
    time, *values = table.numbers([0, *(i for i, _ in columns)])
    texts = [_COLOUR.sub(" ", heads[i]).replace("_", " ") for i, _ in columns]
    order = np.argsort(nm)
    reflected = all(_REFLECTED.search(text) for text in texts)
    passed = not reflected and all(_PASSED.search(text) for text in texts)
    calibrated = reflected or passed
    note = "" if calibrated else "values in an arbitrary unit: no head names a reflectance R"
    left = [heads[i] for i in range(1, len(heads)) if i not in [at for at, _ in columns]]
    notes = [f"trace: {len(time)} times, wavelengths: {len(nm)}, a column for each", note, *table.notes]
    notes += [f"columns left out, whose heads name no wavelength: {', '.join(left)}"] if left else []
    rows = np.stack(values, axis=1)[:, order]
    return RawCube(
        str(path),
        {"values": Stored(rows, (TIME, WAVELENGTH))},
        (TIME,),
        np.asarray(nm)[order],
        "nm",
        files=(path,),
        signal=asked.signal or ("T" if passed else "R"),
        signal_unit="percent" if all("%" in text for text in texts) else "fraction",
        calibrated=calibrated,
        coords={TIME: time},
        units={TIME: unit},
        notes=tuple(filter(None, notes)),
    )
