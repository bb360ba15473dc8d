"""Declarations of a file: what the lines above its rows say of the axis, the quantity and the instrument.

Only lines of a keyword and a value count, as `Y-axis mode: %T` or `##XUNITS=1/CM`; free text does not.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from pellicle.data.tabular.columns import Column, recognise
from pellicle.data.tabular.text import Line

_ENTRY = re.compile(r"[#\s\"']*(?P<key>[^=:;,\t]{1,40}?)[\"']?\s*(?:[=:]|[\t;,])\s*(?P<value>.*?)[\s\"';,]*")
_AXIS = re.compile(
    r"(x[ _-]?(axis|unit|label|title)s?([ _-]?(mode|unit|label|title|type)s?)?"
    r"|(wavelength|axis|abscissa|spectral)[ _-]?(unit|type|mode|scale)s?)"
)
_SIGNAL = re.compile(
    r"(y[ _-]?(axis|unit|label|title)s?([ _-]?(mode|unit|label|title|type)s?)?"
    r"|(data|measurement|measuring|photometric|ordinate|display|acquisition)[ _-]?(mode|type|unit|scale)s?"
    r"|ordinate|quantity|technique|signal([ _-](type|unit))?|(spectrum|spectral)[ _-]type|measured quantity)"
)
_ANGLE = re.compile(
    r"(angle|(angle of|incidence|incident) (incidence|angle)|aoi|einfallswinkel)"
    r"( ?[(\[]?(deg(rees?)?|°)[)\]]?)?"
)
_DEGREES = re.compile(r"(\d+(?:[.,]\d+)?)\s*(?:°|deg(?:rees?)?\.?)?")
_POLARISATION = re.compile(r"polari[sz](ation|er)( (state|mode|position))?")
_POLARISED = {
    "s": re.compile(r"(s|te)([ -]?(pol.*|wave|light))?"),
    "p": re.compile(r"(p|tm)([ -]?(pol.*|wave|light))?"),
    "unpolarised": re.compile(r"none|random|un-?polari[sz]ed|non-?polari[sz]ed"),
}
_FACTS = {
    "instrument": r"instrument( (name|model|type|serial.*))?|spectrometers?( (name|model|type))?|model"
    r"|origin|spectrometer/data system",
    "date": r"date( (and|/) ?time)?|(acquired|measured|created)( (on|at))?|(measurement|acquisition) date"
    r"|time ?stamp|longdate|date of measurement",
    "delta": r"delta",  # "folded into 0 to 180 degrees"
    "sample": r"sample( (name|id|description))?|title|spectrum name",
}
_FOREIGN = re.compile(
    r"(kubelka|k/s\b|f\(r\)|irradiance|radiance|raman|fluorescence|emission|phosphorescence|power|"
    r"counts?\b|scope|raw|single beam|interferogram|intensity)",
    re.IGNORECASE,
)
"""Quantities that are neither a reflectance nor a transmittance."""


_NO_WAVELENGTH = re.compile(
    r"(raman|pixel|channel|points?\b|index|time|temperature|position|angle|seconds?\b)",
    re.IGNORECASE,
)
"""Axes that are no wavelength, energy or wavenumber."""


@dataclass(frozen=True)
class Statement:
    """A declared axis or quantity: the column that its words describe, and the line that declares it.

    For a quantity that is neither R nor T the column has the role "foreign".
    """

    column: Column
    line: int


@dataclass(frozen=True)
class Declared:
    """Axis, signal, angle of incidence (degrees), polarisation and facts (pairs of a key and a value) that a
    file declares; None where it does not."""

    axis: Statement | None = None
    signal: Statement | None = None
    facts: tuple[tuple[str, str], ...] = ()
    angle: float | None = None
    polarisation: str | None = None


NOTHING_DECLARED = Declared()


def declarations(lines: Sequence[Line]) -> Declared:
    """Return what the lines above the rows of a table declare; the first line of a kind counts.

    >>> declarations([Line(1, "Y-axis mode: %T", "")]).signal.column.unit
    'percent'
    """
    axis = signal = angle = polarisation = None
    facts: dict[str, str] = {}
    for line in lines:
        entry = _ENTRY.fullmatch(line.text)
        if entry is None or not entry["value"]:
            continue
        key, value = entry["key"].strip().lower(), entry["value"]
        column = recognise(value)
        if _AXIS.fullmatch(key) and column.role == "wavelength" and column.unit:
            axis = axis or Statement(column, line.number)
        elif _AXIS.fullmatch(key) and _NO_WAVELENGTH.match(value):
            axis = axis or Statement(Column(0, value, "wavelength", unknown_unit=value), line.number)
        elif _SIGNAL.fullmatch(key) and column.role in ("R", "T"):
            signal = signal or Statement(column, line.number)
        elif _SIGNAL.fullmatch(key) and (column.role == "foreign" or _FOREIGN.match(value)):
            signal = signal or Statement(Column(0, value, "foreign"), line.number)
        elif _ANGLE.fullmatch(key) and (degrees := _DEGREES.fullmatch(value)):
            angle = float(degrees[1].replace(",", ".")) if angle is None else angle
        elif _POLARISATION.fullmatch(key):
            found = (name for name, words in _POLARISED.items() if words.fullmatch(value.lower()))
            polarisation = polarisation or next(found, None)
        else:
            fact = next((name for name, words in _FACTS.items() if re.fullmatch(words, key)), None)
            if fact:
                facts.setdefault(fact, value)
    return Declared(axis, signal, tuple(facts.items()), angle, polarisation)
