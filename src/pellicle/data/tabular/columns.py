"""Columns of a table by their names, and what the lines above its rows declare.

Names are matched without regard to case, with the unit in brackets (`R (%)`, `Wavelength [um]`),
after a separator (`wavelength_nm`, `R_percent`, `lambda / nm`) or as a sign (`%R`). Of the lines above the
rows only those of a keyword and a value count, as `Y-axis mode: %T` or `##XUNITS=1/CM`; free text does not.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

from pellicle.data.tabular.column_names import FOREIGN, NAMES, RATIO_COLUMNS
from pellicle.data.tabular.text import Line
from pellicle.data.tabular.units import angle_unit, signal_unit, wavelength_unit
from pellicle.errors import UsageError
from pellicle.signals.registry import ONE_COLUMN

SIGNALS = ONE_COLUMN
"""Roles of the signals of one column; psi-delta has two."""
COUNTS = ("sample counts", "reference counts", "dark counts")
"""Raw counts of a sample, of a reference and without light, as some programs write beside their quotient."""
DIRECTIONS = ("theta_i", "phi_i", "theta_o", "phi_o")
"""Angles of a BRDF sample: to the light and to the viewer."""
_IMPLIED_UNIT = {"energy": "eV", "wavenumber": "cm-1", "angle": "deg"}
_AXES = ("energy", "wavenumber", "frequency")
_ABSORBANCES = {"absorbance": "T", "log(1/R)": "R"}
_OF_ABSORBANCE = {"a", "au", "a.u.", "abs", "abs.", "absorbance", "od", "o.d.", "-", "1", ""}
"""Units that programs write behind an absorbance."""
_MEASURED = ("measured", "meas", "meas.", "exp", "exp.", "experimental")
_MODELLED = ("calculated", "calc", "calc.", "modelled", "modeled", "simulated", "fit", "fitted", "model")
"""Words that some programs write in the place of a unit, for the measurement and for their fit to it."""
_OTHER_UNITS = ("a.u.", "abs", "abs.", "a", "counts", "deg", "°")
_UNIT_OF = {
    "wavelength": wavelength_unit,
    "angle": angle_unit,
    "azimuth": angle_unit,
    "psi": angle_unit,
    "delta": angle_unit,
    "analyser": angle_unit,
    "sigma_psi": angle_unit,
    "sigma_delta": angle_unit,
    **dict.fromkeys(DIRECTIONS, angle_unit),
    **dict.fromkeys(RATIO_COLUMNS, angle_unit),
    **dict.fromkeys((f"sigma_{role}" for role in RATIO_COLUMNS), angle_unit),
    "counts": lambda text: None,
    "intensity": lambda text: None,
}
_ALIASES: dict[str, list[tuple[str, str]]] = {}
"""Names and their roles by their first letter, the longest first: each cell of a file is looked up."""
for _role, _names in (*NAMES.items(), ("foreign", FOREIGN)):
    for _name in _names:
        _ALIASES.setdefault(_name[:1], []).append((_name, _role))
for _of_letter in _ALIASES.values():
    _of_letter.sort(key=lambda alias: -len(alias[0]))
_TAIL = re.compile(
    r"\s*(?:(?P<open>[(\[])\s*(?P<inside>[^()\[\]]*?)\s*[)\]]|[_\s/,:-]+(?:in\s+)?(?P<after>.+?))\s*"
)

_QUALIFIER = re.compile(r"^(specular|regular|total|absolute|measured|mean|averaged?|corrected) +(?=\S)")
_NAMED = re.compile(r".*\S\s*%\s*([rt])")  # `film 1 %R`

_PERCENT_INSIDE = re.compile(r"[(\[]\s*%\s*[)\]]")

SKIP = "_"
UNSTATED = "unit not stated"
"""Unit in the name of a column whose unit must be asked for."""

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
    "light": r"light",  # "transmitted" of psi and delta
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
class Column:
    """One column: position, name, role and unit.

    `role` is a key of `NAMES`, "foreign" for a quantity that is not read, or "other"; energies, wavenumbers
    and frequencies have the role "wavelength", Rs, Rp, Ts, Tp the roles "R" and "T" with a polarisation, an
    absorbance the role "T" with that unit. `unit` is None where the name states none;
    `unknown_unit` keeps a unit that was not understood.
    """

    position: int
    name: str
    role: str
    unit: str | None = None
    polarisation: str | None = None
    unknown_unit: str | None = None


# every file of a batch has the same names, and several formats are tried on its lines
@lru_cache(4096)
def recognise(name: str, position: int = 0) -> Column:
    """Return the column that `name` describes; role "other" for an unknown name."""
    plain = name.strip().strip("\"'").strip().lower()
    unit_alone = wavelength_unit(plain)
    if unit_alone and plain != "a":
        return Column(position, name, "wavelength", unit_alone)
    percent = plain.startswith(("%", "percent ")) or plain.endswith("%")
    if percent:
        plain = plain.strip("% _/,:-").removesuffix(" in").removeprefix("percent ")
    plain = _QUALIFIER.sub("", plain)
    for alias, role in _ALIASES.get(plain[:1], ()):
        if plain == alias:
            return _column(position, name, role, "%" if percent else None, bracketed=False)
        tail = _TAIL.fullmatch(plain[len(alias) :]) if plain.startswith(alias) else None
        if tail:
            written = tail["inside"] if tail["open"] else tail["after"]
            column = _column(position, name, role, written, bracketed=bool(tail["open"]))
            if column.role != "other":
                return column
    percent = percent or bool(_PERCENT_INSIDE.search(plain))
    if named := _NAMED.fullmatch(plain):
        return Column(position, name, named[1].upper(), "percent")
    return Column(position, name, "other", "percent" if percent else None)


def _column(position: int, name: str, role: str, written: str | None, *, bracketed: bool) -> Column:
    if role in _ABSORBANCES:
        known = written is None or written.replace(" ", "").lower() in _OF_ABSORBANCE
        if not known and not bracketed:
            return Column(position, name, "other")
        unit = "absorbance" if known else None
        return Column(position, name, _ABSORBANCES[role], unit, unknown_unit=None if known else written)
    polarisation = role[1] if role in ("Rs", "Rp", "Ts", "Tp") else None
    base = "wavelength" if role in _AXES else role[0] if polarisation else role
    unit = _IMPLIED_UNIT.get(role)
    if written in _MODELLED:
        return Column(position, name, "other")
    if written in _MEASURED:
        written = None
    if written is None and role == "frequency":
        return Column(position, name, base, unknown_unit="frequency")
    if written is None:
        return Column(position, name, base, unit, polarisation)
    if base in ("foreign", *COUNTS):
        return Column(position, name, base if bracketed else "other")
    known = _UNIT_OF.get(base, signal_unit)(written)
    if known:
        return Column(position, name, base, known, polarisation)
    if base in ("intensity", "counts"):  # arbitrary units are what these are for
        return Column(position, name, base)
    if bracketed:
        return Column(position, name, base, None, polarisation, unknown_unit=written)
    return Column(position, name, "other")  # `R_sigma_as_stated`, `t_sample`: another quantity


def recognise_all(names: Sequence[str]) -> tuple[Column, ...]:
    """Apply `recognise` to a header, positions counted from 0.

    `sample` beside `reference` means counts of both.
    """
    plain = {name.strip().lower() for name in names}
    if {"sample", "reference"} <= plain:
        parts = ("sample", "reference", "dark")
        names = [f"{name} counts" if name.strip().lower() in parts else name for name in names]
    return tuple(recognise(name, position) for position, name in enumerate(names))


def is_header(names: Sequence[str]) -> bool:
    """Return True if `names` include a wavelength and a signal, or directions, as no free text does."""
    roles = {column.role for column in recognise_all(names)}
    measured = bool(roles & {*SIGNALS, "intensity", "counts", "psi"})
    measured = measured or {"N", "C", "S"} <= roles or {"alpha", "beta"} <= roles
    measured = measured or {"tan_psi", "cos_delta"} <= roles or bool(roles & set(RATIO_COLUMNS))
    return ("wavelength" in roles and measured) or roles.issuperset(DIRECTIONS)


def is_unit_row(names: Sequence[str]) -> bool:
    """Return True for a line of units only, as some programs write below the names (`nm,%`, `[nm];[%]`)."""
    plain = [name.strip("[]() ").lower() for name in names]
    return bool(plain) and all(
        wavelength_unit(name) or signal_unit(name) or name in _OTHER_UNITS for name in plain
    )


def parse_columns(columns: str | Sequence[str], path: str, width: int) -> tuple[Column, ...]:
    """Parse a caller's columns, a list or as in `wavelength,R` or `_,energy,R_percent`; `_` skips one.

    Raises UsageError for an unknown name, or more names than the file has columns.
    """
    names = [name.strip() for name in (columns.split(",") if isinstance(columns, str) else columns)]
    if len(names) > width:
        raise UsageError(
            f"{path}: `columns` has {len(names)} names but the file has {width} columns; give at most {width}"
        )
    parsed = tuple(
        Column(position, name, "other") if name in (SKIP, "") else recognise(name, position)
        for position, name in enumerate(names)
    )
    for column in parsed:
        if column.role == "other" and column.name not in (SKIP, ""):
            raise UsageError(
                f"{path}: `columns` has the unknown name {column.name!r}; use {', '.join(NAMES)}, or "
                f"{SKIP} to skip a column"
            )
    return parsed


def unknown_unit(column: Column) -> str:
    """Say of a column that its unit is unknown, for a message."""
    if column.unknown_unit == UNSTATED:
        return "states no unit"
    return f"is in an unknown unit {column.unknown_unit!r}"


def listed(columns: Sequence[Column]) -> str:
    """Return the names of columns, for a message."""
    return ", ".join(repr(column.name) for column in columns)


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
            stated = (name for name, words in _POLARISED.items() if words.fullmatch(value.lower()))
            polarisation = polarisation or next(stated, None)
        else:
            fact = next((name for name, words in _FACTS.items() if re.fullmatch(words, key)), None)
            if fact:
                facts.setdefault(fact, value)
    return Declared(axis, signal, tuple(facts.items()), angle, polarisation)
