"""Quantities and axes as formats name them, and the choice of the spectra that can be read.

A format that stores several curves, such as a sample, a dark and a reference spectrum, gives a `Curve` for
each; `readable` keeps reflectances, transmittances and absorbances, and names what it leaves out.
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Sequence
from dataclasses import dataclass

from pellicle.data.tabular.columns import Column, recognise
from pellicle.data.tabular.declarations import Statement
from pellicle.data.tabular.layout import Layout
from pellicle.data.tabular.units import wavelength_unit
from pellicle.errors import DataError

UNNAMED = "intensity"
"""Column name of a quantity that a file calls arbitrary: the user may state what it is."""
_NO_NAME = "ordinate"
_SPECTRAL = ("R", "T")
_NOT_STATED = "not stated"


@dataclass(frozen=True)
class Curve:
    """One curve of a file: its layout, the names that the file gives to axis and quantity, and their line."""

    layout: Layout
    axis: str
    quantity: str
    line: int = 0


def axis_column(text: str) -> str | None:
    """Return the column name of an axis such as `1/CM` or `Wavelength (nm)`; None for another quantity.

    An axis without a unit gets the unit "not stated", which is then asked for.

    >>> axis_column("NANOMETERS")
    'wavelength (nm)'
    """
    unit = wavelength_unit(text)
    column = recognise(text)
    if unit is None and column.role == "wavelength":
        unit = column.unit or column.unknown_unit or _NOT_STATED
    if unit is None and not text.strip():
        unit = _NOT_STATED
    return f"wavelength ({unit})" if unit else None


def signal_column(text: str) -> str | None:
    """Return the column name of a quantity such as `% TRANSMITTANCE`; None for one that is neither R nor T.

    What the user may state keeps its place: a percentage of an unnamed quantity, a relative intensity
    ("intensity"), and no name at all ("ordinate").

    >>> signal_column("Transmission (%)")
    'T (%)'
    """
    plain = re.sub(r"^percent\b|^per cent\b", "%", text.strip(), flags=re.IGNORECASE)
    plain = re.sub(r"\s+units?$", "", plain, flags=re.IGNORECASE)
    column = recognise(plain)
    if not plain:
        return _NO_NAME
    if column.role not in _SPECTRAL:
        if column.role == "other" and column.unit == "percent":
            return text
        return UNNAMED if column.role == "intensity" and "count" not in plain.lower() else None
    if column.unit == "absorbance":
        return "absorbance" if column.role == "T" else "log(1/R)"
    unit = {"percent": " (%)", "fraction": " (-)"}.get(column.unit or "", "")
    return f"{column.role}{column.polarisation or ''}{unit}" if not column.unknown_unit else text


def readable(curves: Sequence[Curve], path: str) -> list[Layout]:
    """Return the layouts of the curves that are spectra of R, T or absorbance, under different names.

    Where there is none, the quantity of the first is declared, and refused when it is read. Raises DataError
    for curves along another axis, such as time.
    """
    along = [curve for curve in curves if axis_column(curve.axis)]
    if not along:
        raise DataError(
            f"{path}: its axis is {curves[0].axis!r}, which is no wavelength, energy or wavenumber; export a "
            "spectrum as CSV"
        )
    named = [(curve, signal_column(curve.quantity)) for curve in along]
    kept = [curve for curve, name in named if name and name not in (UNNAMED, _NO_NAME)] or [
        c for c, name in named if name
    ]
    left_out = [curve.quantity for curve in curves if curve not in kept]
    if not kept:
        declared = Statement(Column(0, along[0].quantity, "foreign"), along[0].line)
        layout = along[0].layout
        return [dataclasses.replace(layout, declared=dataclasses.replace(layout.declared, signal=declared))]
    notes = (f"left out: {', '.join(map(repr, dict.fromkeys(left_out)))}",) if left_out else ()
    names = _different([curve.layout.name or curve.quantity for curve in kept]) if len(kept) > 1 else [""]
    return [
        dataclasses.replace(curve.layout, name=name, notes=(*curve.layout.notes, *notes))
        for curve, name in zip(kept, names, strict=True)
    ]


def _different(names: Sequence[str]) -> list[str]:
    """The names, with a number behind those that are not the first of their kind."""
    seen: dict[str, int] = {}
    found = []
    for name in names:
        seen[name] = seen.get(name, 0) + 1
        found.append(name if seen[name] == 1 else f"{name} ({seen[name]})")
    return found
