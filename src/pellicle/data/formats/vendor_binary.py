"""Binary files of spectrometers: GRAMS SPC, Bruker OPUS, PerkinElmer `.sp` and JASCO `.jws`.

They are recognised by their first bytes and decoded by the package openreadout (extra `formats`), from
memory. It gives each trace with the quantity and the unit of both axes; what it does not name is not guessed.
"""

import struct
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from pellicle.data.formats.exports import Curve, axis_column, first_stated, readable, signal_column
from pellicle.data.tabular.columns import recognise
from pellicle.data.tabular.table import Table, array_columns
from pellicle.errors import DataError, install_command

_OLE = b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1"
_JASCO_STREAM = "DataInfo".encode("utf-16-le")
_SPC_VERSIONS = (0x4B, 0x4C, 0x4D)
_SPC_HEADERS = {0x4B: "<4xIdd", 0x4C: ">4xIdd", 0x4D: "<4xfff"}
_SPC_OLD = 0x4D
_SPC_SHORTEST = {0x4B: 512, 0x4C: 512, 0x4D: 256}  # bytes of the header
_SPC_SMALLEST, _SPC_LARGEST = 1e-6, 1e9
"""Ends of a plausible axis; text read as numbers lies outside."""
_FORMATS = {
    "spc": "GRAMS SPC",
    "0": "Bruker OPUS",
    "sp": "PerkinElmer .sp",
    "jws": "JASCO .jws",
}
_FACTS = {
    "instrument": ("instrument", "source_instrument", "instrument_model"),
    "date": ("acquired_at", "recorded_at", "measured_at"),
    "sample": ("sample_name", "title"),
}
_JASCO_INVALID = -1.2e-38
"""JASCO writes about -1.18e-38 for a point that was not measured."""
_MOST_SPECTRA = 1000

_SPECTRAL = ("wavelength", "wavenumber", "energy")
_OF_QUANTITY = {"transmittance": "T", "reflectance": "R", "absorbance": "absorbance", "log_1_r": "log(1/R)"}


def layouts(content: bytes, path: str) -> list[Table] | None:
    """Return the spectra of such a file, or None for another format.

    Raises DataError where openreadout is absent or cannot read the file, and for other quantities.
    """
    kind = _kind(content)
    if kind is None:
        return None
    name = _FORMATS[kind]
    try:
        import openreadout
    except ImportError:
        raise DataError(
            f"{path}: is a {name} file, which needs the package openreadout: {install_command('formats')}; "
            "or export the spectrum as CSV"
        ) from None
    try:
        with openreadout.File(content, name=f"file.{kind}") as file:
            _check(file, name, path)
            curves = list(_curves(file, name, len(content), path))
    except DataError:
        raise
    except Exception as error:  # a foreign reader on a damaged file may raise anything
        reason = " ".join(str(error).partition(" (hint")[0].split()) or type(error).__name__
        raise DataError(
            f"{path}: is a {name} file that cannot be read ({reason}); export it as CSV"
        ) from None
    if not curves:
        raise DataError(f"{path}: is a {name} file without a spectrum; export it as CSV")
    return readable(curves, path)


def _kind(content: bytes) -> str | None:
    """The usual suffix of the format whose first bytes these are, which openreadout takes as a hint."""
    if content.startswith(b"\n\n\xfe\xfe"):
        return "0"
    if content.startswith(b"PEPE"):
        return "sp"
    if content.startswith(b"L~S ") or (content.startswith(_OLE) and _JASCO_STREAM in content):
        return "jws"
    return "spc" if _is_spc(content) else None


def _is_spc(content: bytes) -> bool:
    """True for a plausible header of SPC: its version is one byte, which text may have too."""
    version = content[1] if len(content) > 1 else 0
    if version not in _SPC_VERSIONS or len(content) < _SPC_SHORTEST[version] or b"\0" not in content[:32]:
        return False
    points, first, last = struct.unpack_from(_SPC_HEADERS[version], content)
    axis_code, signal_code = content[16:18] if version == _SPC_OLD else content[28:30]
    ends = (abs(first), abs(last))
    plausible = (
        first != last and all(x == 0 or _SPC_SMALLEST < x < _SPC_LARGEST for x in ends) and points >= 1
    )
    return plausible and axis_code <= 31 and (signal_code <= 32 or signal_code >= 128)


def _check(file: Any, name: str, path: str) -> None:
    """Refuse a file in which openreadout finds damage, of which it reads what is left. Raises DataError."""
    findings = file.check()["findings"]
    error = next((finding["message"] for finding in findings if finding["severity"] == "error"), None)
    if error is not None:
        raise DataError(
            f"{path}: is a damaged {name} file ({' '.join(error.split())}); copy or export it again"
        )


def _curves(file: Any, name: str, size: int, path: str) -> Iterator[Curve]:
    """The sweeps of each trace of an open file."""
    for index, trace in enumerate(file.traces):
        channels, sweeps, points = trace["channels"], trace["sweep_count"], trace["sample_count"]
        if points * sweeps > size or sweeps > _MOST_SPECTRA:  # no value takes less than a byte
            raise DataError(
                f"{path}: is a {name} file of {sweeps} spectra of {points} points, more than its {size} "
                "bytes hold or pellicle reads; export the spectrum as CSV"
            )
        extra = trace["extra"]
        axis = _axis(extra)
        for sweep in range(sweeps):
            values = np.asarray(file.read_trace(index, sweep))
            x = np.asarray(file.trace_axis(index))
            for position, channel in enumerate(channels):
                if extra["axis"].get("channel") == position:
                    continue
                quantity = _quantity(channel, extra)
                columns, notes = _measured(x, values[position], name, path)
                label = trace["name"] if sweeps == 1 else f"{trace['name']} {sweep + 1}"
                layout = array_columns(
                    (axis_column(axis) or axis, signal_column(quantity) or quantity),
                    columns,
                    [f"read as a {name} file", *notes],
                    name=label,
                    facts=[("format", name), *first_stated(_FACTS, extra.get)],
                )
                yield Curve(layout, axis, quantity)


def _axis(extra: dict[str, Any]) -> str:
    """The axis as a header would name it: `wavenumber (1/cm)`, or as the file does where it is unknown."""
    axis = extra["axis"]
    quantity, unit = axis.get("quantity") or "x", axis.get("unit")
    if quantity in _SPECTRAL and unit:
        return f"{quantity} ({unit})"
    if quantity == "x":  # the text of a .sp file, as `Wavenumber`
        return str(extra.get("x_units_text") or unit or "")
    return quantity.replace("_", " ") + (f" ({unit})" if unit else "")


def _quantity(channel: dict[str, Any], extra: dict[str, Any]) -> str:
    """The quantity of a channel as a header would name it."""
    name, unit = channel["name"], channel.get("unit")
    if name == "percent":
        return "signal %"  # SPC states percent without the quantity
    if name in _OF_QUANTITY:
        return f"{_OF_QUANTITY[name]} (%)" if unit == "%" else _OF_QUANTITY[name]
    text = str(extra.get("y_units_text") or "")
    if recognise(text).role in ("R", "T"):
        return text
    return "relative intensity" if name == "intensity" and not text else text or name.replace("_", " ")


def _measured(x: np.ndarray, y: np.ndarray, name: str, path: str) -> tuple[Sequence[np.ndarray], list[str]]:
    """The columns without points that JASCO marks as not measured, and a note on these."""
    if x.shape != y.shape:
        raise DataError(
            f"{path}: is a {name} file of {y.size} values for an axis of {x.size} points; export it as CSV"
        )
    invalid = (y < 0) & (y > _JASCO_INVALID) if name == _FORMATS["jws"] else np.zeros(y.shape, dtype=bool)
    notes = [f"{invalid.sum()} points marked as not measured left out"] if invalid.any() else []
    if invalid.all():
        raise DataError(f"{path}: is a {name} file without a measured point; export it again")
    return (x[~invalid], y[~invalid]), notes
