"""Options of reading and fitting data: each is declared here once, with its type, help, limits and words.

From these records follow the flags of the command line (`cli/flags.py`), the keys of a recipe and its schema
(`recipes/schema.py`), and the recipe of a result. None is an option that is not given. This module imports
nothing heavy: `pellicle --help` loads it.
"""

import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, partial
from inspect import get_annotations
from typing import Annotated, Any, Literal, TypeVar, dataclass_transform, get_type_hints

from pellicle.errors import UsageError

SPECTRA, COLOURS, BRDF = "spectra", "colours", "BRDF samples"
"""Kinds of data to which an option applies."""
SPACES = ("srgb", "rgb", "xyz", "lab")
SIGNALS = ("R", "T", "psi-delta", "mueller", "generalised-psi-delta", "contrast", *SPACES)
"""Signals of films, beside "brdf" of a surface's recipe."""

CONDITIONS = ("calibration", "plate", "substrate")
"""Statements about a measurement that may be wrong, as an identification supposes."""

# fmt: off
Family = Literal[
    "metal", "semiconductor", "oxide", "fluoride", "halide", "sulfide", "selenide", "telluride", "nitride",
    "carbide", "carbonate", "carbon", "glass", "polymer", "liquid", "gas", "pigment",
]
# fmt: on
"""Family of materials; `materials/data/catalogue.toml` gives each of its names one or more of them."""

_ILLUMINANTS = ("E", "A", "D50", "D55", "D65", "D75")

Record = TypeVar("Record", bound="Options")


def named(names: Iterable[str]) -> list[str]:
    """The flags of arguments: `plate_mm` is --plate-mm."""
    return [f"--{name.replace('_', '-')}" for name in names]


def parse_number(text: str, name: str, expected: str = "a number") -> float:
    """Parse a finite number. Raises UsageError with the name of the argument and what was expected."""
    try:
        value = float(text)
    except ValueError:
        raise UsageError(f"{name} must be {expected}, not {text!r}") from None
    if not math.isfinite(value):
        raise UsageError(f"{name} must be a finite number, not {text!r}")
    return value


_LENGTHS = {"nm": 1.0, "um": 1e3, "µm": 1e3, "μm": 1e3, "A": 0.1, "Å": 0.1}
"""Units of a length that a flag may state, in nm."""
_LENGTH = re.compile(rf"(?P<number>.*?)\s*(?P<unit>{'|'.join(_LENGTHS)})\s*")
_LIKE_LENGTH = rf"\s*(\d[\d.]*\s*(?:{'|'.join(_LENGTHS)})?)\s*"
_DASHED = re.compile(rf"{_LIKE_LENGTH}(?:-|–|\.\.| to ){_LIKE_LENGTH}")
"""A range as people write it: 400-800, 0.4-0.8um, 400 nm to 800 nm."""


def parse_length(text: str, name: str, expected: str = "a number") -> float:
    """Parse a length in nm, or with its unit, as `1.5um`. Raises UsageError as `parse_number` does."""
    stated = _LENGTH.fullmatch(text)
    if stated is None:
        return parse_number(text, name, expected)
    return parse_number(stated["number"], name, expected) * _LENGTHS[stated["unit"]]


def length_range(text: str, name: str) -> tuple[float, float]:
    """Parse `LO:HI` in nm; a unit may follow both or the second, as in `1:2um`. Raises UsageError."""
    low, high = _parts(text, name)
    unit = _LENGTH.fullmatch(high)
    if unit is not None and _LENGTH.fullmatch(low) is None:
        low += unit["unit"]
    return _rising(parse_length(low, name), parse_length(high, name), text, name)


def parse_range(text: str, name: str) -> tuple[float, float]:
    """Parse `LO:HI` as two rising numbers. Raises UsageError with the name of the argument."""
    low, high = _parts(text, name)
    return _rising(parse_number(low, name), parse_number(high, name), text, name)


def is_range(text: str) -> bool:
    """True for `LO:HI`, also where it is written `LO-HI`."""
    return ":" in text or _DASHED.fullmatch(text) is not None


def _parts(text: str, name: str) -> tuple[str, str]:
    dashed = _DASHED.fullmatch(text)
    parts = text.split(":") if dashed is None else dashed.groups()
    if len(parts) != 2:
        raise UsageError(f"{name} must be LO:HI, as in 10:3000, not {text!r}")
    return parts[0], parts[1]


def _rising(low: float, high: float, text: str, name: str) -> tuple[float, float]:
    if not low < high:
        raise UsageError(f"{name} is reversed or empty: {text!r}; write the smaller number first")
    return low, high


_DEGREES = re.compile(r"\s*(°|deg(rees?)?)\s*$")


def parse_angles(text: str, name: str) -> float | list[float]:
    """Parse one angle in degrees, or several with commas between them. Raises UsageError."""
    words = [_DEGREES.sub("", word) for word in text.split(",")]
    angles = [parse_number(word, name, "degrees such as 70, or 0,30,60") for word in words]
    return angles[0] if len(angles) == 1 else angles


_SIGNAL_WORDS = {"reflectance": "R", "reflection": "R", "transmittance": "T", "transmission": "T"}
_SIGNAL_WORDS |= {"ellipsometry": "psi-delta", "psi,delta": "psi-delta"}


def parse_signal(text: str, name: str = "") -> str:
    """The signal that a word means, `R` for reflectance; another word as it is."""
    word = text.strip().lower()
    known = {signal.lower(): signal for signal in (*SIGNALS, "brdf")} | _SIGNAL_WORDS
    return known.get(word, text)


def _wavelength_unit(text: str) -> tuple[str | None, tuple[str, ...]]:
    from pellicle.data.tabular.units import WAVELENGTH_UNITS, wavelength_unit

    return wavelength_unit(text), WAVELENGTH_UNITS


def _signal_unit(text: str) -> tuple[str | None, tuple[str, ...]]:
    from pellicle.data.tabular.units import BITS, SIGNAL_UNITS, colour_unit

    return colour_unit(text), (*SIGNAL_UNITS, *BITS)


@dataclass(frozen=True)
class Option:
    """Declaration of an option, as metadata of its field's type.

    - `help`: one sentence, with unit and default, for `--help` and for editors of recipes.
    - `metavar`: form of the flag's value in `--help`.
    - `kinds`: kinds of data to which it applies.
    - `words`: its only values; or `find`, a function of a text to the value that it spells (None for none)
      and to all values.
    - `least`, `most`: limits, themselves allowed unless `exclusive`, in `unit`.
    - `parse`: function of a flag's text and the option's name to its value, where that is no text or number.
    - `is_file`: the value is a path, which a recipe gives relative to itself.
    - `negative`: the flag of a truth value also has a --no- form.
    - `flag`: False for an option that only recipes have.
    """

    help: str
    kinds: tuple[str, ...]
    metavar: str = ""
    words: tuple[str, ...] = ()
    find: Callable[[str], tuple[str | None, tuple[str, ...]]] | None = None
    least: float = -math.inf
    most: float = math.inf
    exclusive: bool = False
    unit: str = ""
    parse: Callable[[str, str], Any] | None = None
    is_file: bool = False
    negative: bool = False
    flag: bool = True

    def check(self, value: Any) -> Any:
        """Return the value; raise ValueError, a sentence that lacks the option's name, for a wrong one."""
        for one in value if isinstance(value, list | tuple) else [value]:
            if isinstance(one, str):
                valid, known = (one in self.words, self.words) if self.find is None else self.find(one)
                if known and not valid:
                    raise ValueError(f"must be one of {', '.join(known)}, not {one!r}")
            elif isinstance(one, float | int):
                inside = self.least < one < self.most if self.exclusive else self.least <= one <= self.most
                if not inside or not math.isfinite(one):
                    limits = f"lie in {self.least:g} to {self.most:g}"
                    if self.exclusive or self.most == math.inf:
                        limits = f"be {'above' if self.exclusive else 'at least'} {self.least:g}"
                        limits += f" and below {self.most:g}" if self.most < math.inf else ""
                    raise ValueError(f"must {limits}{f' {self.unit}'.rstrip()}, got {one:g}")
        return value

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> Any:
        """Check the value of a recipe's key."""
        from pydantic_core import core_schema

        return core_schema.no_info_after_validator_function(self.check, handler(source))

    def __get_pydantic_json_schema__(self, source: Any, handler: Any) -> dict[str, Any]:
        """Describe the key to editors of recipes."""
        schema = {**handler(source), "description": self.help}
        names = ("exclusiveMinimum", "exclusiveMaximum") if self.exclusive else ("minimum", "maximum")
        limits = {
            name: x for name, x in zip(names, (self.least, self.most), strict=True) if abs(x) < math.inf
        }
        for kind in schema["anyOf"]:
            if kind.get("type") == "string" and self.words:
                kind["enum"] = [*self.words]
            elif kind.get("type") in ("number", "integer"):
                kind |= limits
        return schema


def _option_of(*kinds: str) -> Callable[..., Any]:
    return partial(Option, kinds=kinds)


_FOR_FILMS, _FOR_SPECTRA, _FOR_COLOURS = (
    _option_of(SPECTRA, COLOURS),
    _option_of(SPECTRA),
    _option_of(COLOURS),
)
_FOR_ALL = _option_of(SPECTRA, COLOURS, BRDF)
"""Declarations of options by the kinds of data to which they apply."""


class Options:
    """Base of the records of options."""

    @classmethod
    def declared(cls) -> dict[str, tuple[Any, Option]]:
        """Type and declaration of each option, by name."""
        return _declared(cls)

    def given(self) -> dict[str, Any]:
        """The options that are given, by name."""
        values = {name: getattr(self, name) for name in self.declared()}
        return {name: value for name, value in values.items() if value is not None}

    @classmethod
    def of(cls: type[Record], values: Mapping[str, Any]) -> Record:
        """The options among `values`, by name."""
        return cls(**{name: x for name, x in values.items() if name in cls.declared()})


@cache
def _declared(record: type[Options]) -> dict[str, tuple[Any, Option]]:
    declared = {}
    for base in reversed(record.__mro__):
        if "__dataclass_fields__" in vars(base):  # of a table of pydantic, the records that it extends
            for name, hint in get_type_hints(base, include_extras=True).items():
                declared[name] = hint.__origin__, next(x for x in hint.__metadata__ if isinstance(x, Option))
    return declared


@dataclass_transform(frozen_default=True, kw_only_default=True)
def _record(cls: type[Record]) -> type[Record]:
    """Make a record of options from a class whose fields have their declarations as values.

    Each option is None where it is not given.
    """
    declared = {name: Annotated[hint, vars(cls)[name]] for name, hint in get_annotations(cls).items()}
    cls.__annotations__ = declared
    for name in declared:
        setattr(cls, name, None)
    return dataclass(frozen=True, kw_only=True)(cls)


@_record
class CameraOptions(Options):
    """Observer or camera of the colours of a film, and its light; `[camera]` of a recipe. Files are CSV."""

    observer: str | None = _FOR_COLOURS("1931 (2 degrees) or 1964 (10 degrees).", words=("1931", "1964"))
    illuminant: str | None = _FOR_COLOURS("E, A, D50, D55, D65 or D75 (D65).", words=_ILLUMINANTS)
    lamp: str | None = _FOR_COLOURS("CSV of the lamp's spectrum, for --illuminant.", is_file=True)
    sensitivities: str | None = _FOR_COLOURS(
        "CSV of a camera's three sensitivities (signal rgb).", is_file=True
    )
    chart: str | None = _FOR_COLOURS(
        "CSV of a photographed chart: R, G, B and reference X, Y, Z (signal rgb).", is_file=True
    )
    gamma: float | None = _FOR_COLOURS("Coding of the signal rgb: linear^(1/GAMMA) (1).", least=0.1, most=10)
    white_balance: str | None = _FOR_COLOURS(
        "fixed, or free for an unknown factor of each channel.", words=("fixed", "free")
    )
    white: str | list[int] | None = _FOR_COLOURS("X,Y,WIDTH,HEIGHT of a white in the photograph, in pixels.")
    flat_field: str | None = _FOR_COLOURS(
        "Photograph of an evenly white surface in the same light, by which each pixel is divided.",
        is_file=True,
    )
    transmitted: bool | None = _FOR_COLOURS("The light has passed the film.")


@_record
class SpectrumOptions(Options):
    """Options of reading a spectrum: arguments of `pellicle.read_spectrum`."""

    spectrum: str | None = _FOR_FILMS("Name of one of several spectra or films in a file, or all.")
    signal: str | None = _FOR_ALL(
        f"{', '.join(SIGNALS[:-1])} or {SIGNALS[-1]} (that of the file).",
        words=(*SIGNALS, "brdf"),
        parse=parse_signal,
    )
    polarisation: str | None = _FOR_FILMS("s, p or unpolarised.", words=("s", "p", "unpolarised"))
    range: tuple[float, float] | None = _FOR_SPECTRA(
        "Wavelengths to use in nm.", metavar="LO:HI", parse=length_range
    )
    columns: str | Sequence[str] | None = _FOR_ALL(
        "Names of the columns in order, _ to skip.", metavar="NAME,..."
    )
    wavelength_unit: str | None = _FOR_SPECTRA("nm, um, A, eV, cm-1 or THz.", find=_wavelength_unit)
    signal_unit: str | None = _FOR_FILMS(
        "fraction, percent or absorbance; 8-bit or 16-bit of colours.", find=_signal_unit
    )
    folded: bool | None = _FOR_SPECTRA(
        "Δ is known in 0 to 180 degrees only: cos Δ (by default where it has kinks there).", negative=True
    )
    transmission: bool | None = _FOR_SPECTRA(
        "Psi and delta are those of transmitted light, t_p/t_s (that of the file)."
    )
    analyser: float | None = _FOR_SPECTRA(
        "Analyser angle in degrees (for alpha and beta columns).",
        **{"least": 0, "most": 90, "exclusive": True, "unit": "degrees"},
    )
    spot: int | None = _FOR_SPECTRA("Spot of an Accurion file, counted from 1.", least=1)
    elements: Sequence[str] | None = _FOR_SPECTRA(
        "Elements of a Mueller matrix, or ratios ane, aps, asp, to use (all).",
        metavar="m12,...",
        parse=lambda text, name: [word.strip() for word in text.split(",")],
    )


@_record
class ReadingOptions(SpectrumOptions):
    """Options of reading files of data; `[data]` and `[[data.file]]` of a recipe."""

    noise: float | str | None = _FOR_ALL(
        'Standard deviation of every point in the unit of the file (degrees for psi-delta), or "2 %" of the '
        "signal.",
        metavar="SIGMA",
        parse=lambda text, name: text,
    )
    region: str | list[int] | list[list[int]] | None = _FOR_COLOURS(
        "X,Y,WIDTH,HEIGHT of a film in a photograph, in pixels; ';' between several."
    )
    points: str | list[int] | list[list[int]] | None = _FOR_COLOURS(
        "X,Y of a film in a photograph; ';' between several."
    )
    angle: float | list[float] | None = _FOR_FILMS(
        "Angle of incidence in degrees (0); 0,30,60 where regions of a photograph show one film.",
        **{"metavar": "DEG", "parse": parse_angles, "least": 0, "most": 89.9, "unit": "degrees"},
    )
    reference: str | None = _FOR_SPECTRA(
        "Raw counts of a bare reference; DATA are then raw counts too.", is_file=True
    )
    reference_material: str | None = _FOR_SPECTRA("Material of the reference (Si).")
    dark: str | None = _FOR_SPECTRA("Raw counts without light.", is_file=True)


@_record
class FitOptions(Options):
    """Options of a fit; keys of `[data]` of a recipe."""

    loss: str | None = _FOR_ALL(
        "least-squares, or huber or student-t to give outliers little weight.",
        words=("least-squares", "huber", "student-t"),
    )
    tolerance: float | None = _FOR_ALL(
        "Leave out effects that change the signal by less than this (0: none).", least=0
    )


@_record
class FileOptions(ReadingOptions, CameraOptions):
    """Every option of reading a file of spectra or colours."""
