"""Columns of a table by their names, in the languages that instruments write.

Names are matched without regard to case, with the unit in brackets (`R (%)`, `Wavelength [um]`),
after a separator (`wavelength_nm`, `R_percent`, `lambda / nm`) or as a sign (`%R`).
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

from pellicle.data.tabular.units import angle_unit, signal_unit, wavelength_unit
from pellicle.errors import UsageError
from pellicle.signals.registry import KINDS, ONE_COLUMN


def _sigmas(*names: str) -> tuple[str, ...]:
    """Names of the standard deviation of a quantity with these names."""
    forms = ("sigma_{}", "{}_sigma", "{}_err", "{}_error", "err_{}")
    return tuple(form.format(name) for name in names for form in forms)


NAMES: dict[str, tuple[str, ...]] = {
    "wavelength": (
        *("wavelength", "wavelengths", "wave length", "wave", "wl", "lambda", "lam", "λ"),
        *("wellenlänge", "wellenlaenge", "longueur d'onde", "longueur d’onde", "longitud de onda"),
        *("lunghezza d'onda", "lunghezza d’onda", "comprimento de onda", "golflengte", "波長", "波长"),
    ),
    "energy": (
        *("energy", "photon energy", "photon_energy", "energie", "photonenergie"),
        *("e(ev)", "e (ev)", "e[ev]", "e [ev]", "e/ev", "e / ev", "e_ev"),
    ),
    "wavenumber": (
        *("wavenumber", "wavenumbers", "wave number", "wellenzahl", "nombre d'onde", "nombre d’onde"),
        *("número de onda", "波数"),
    ),
    "frequency": ("frequency", "frequenz"),
    "R": (
        *("r", "reflectance", "reflectivity", "reflection", "reflexion", "réflexion", "réflectance"),
        *("reflexionsgrad", "reflektivität", "reflektanz", "reflectancia", "riflettanza", "反射率"),
    ),
    "Rs": ("rs", "r_s", "reflectance_s"),
    "Rp": ("rp", "r_p", "reflectance_p"),
    "T": (
        *("t", "transmittance", "transmissivity", "transmission", "transmissionsgrad"),
        *("transmitancia", "trasmittanza", "透過率", "透过率"),
    ),
    "Ts": ("ts", "t_s", "transmittance_s"),
    "Tp": ("tp", "t_p", "transmittance_p"),
    "absorbance": (
        *("-log(t)", "-log10(t)", "log(1/t)"),
        *("a", "abs", "abs.", "absorbance", "optical density", "optical_density", "od", "o.d."),
        *("extinktion", "absorbanz", "absorbancia", "assorbanza", "吸光度"),
    ),
    "log(1/R)": ("log(1/r)", "-log(r)", "-log10(r)", "log 1/r", "log_1_r", "apparent absorbance"),
    "intensity": ("intensity", "relative intensity", "relative_intensity"),
    "counts": ("counts", "raw"),
    "processed": ("processed",),
    "sample counts": ("sample counts",),
    "reference counts": ("reference counts",),
    "dark counts": ("dark counts",),
    "sigma": ("sigma", "σ"),
    "angle": (
        *("angle", "aoi", "angle of incidence", "angle_of_incidence", "incidence angle", "incident angle"),
        *("einfallswinkel", "angle d'incidence", "angle d’incidence", "ángulo de incidencia"),
        *("angolo di incidenza", "angolo d'incidenza", "入射角"),
    ),
    "azimuth": ("azimuth", "sample azimuth", "sample_azimuth", "sample rotation"),
    "psi": ("psi", "ψ"),
    "delta": ("delta", "δ"),
    "sigma_psi": _sigmas("psi"),
    "sigma_delta": _sigmas("delta"),
    "depolarisation": ("depolarisation", "depolarization", "depol"),
    "sigma_depolarisation": _sigmas("depolarisation", "depolarization", "depol"),
    "N": ("n",),
    "C": ("c",),
    "S": ("s",),
    "alpha": ("alpha", "α"),
    "beta": ("beta", "β"),
    "tan_psi": ("tan_psi", "tan(psi)", "tan psi", "tanpsi", "tan(ψ)", "tan ψ", "tanψ"),
    "cos_delta": ("cos_delta", "cos(delta)", "cos delta", "cosdelta", "cos(δ)", "cos δ", "cosδ"),
    "analyser": ("analyser", "analyzer", "analyser angle", "analyzer angle"),
    "theta_i": ("theta_i", "θ_i"),
    "phi_i": ("phi_i", "φ_i"),
    "theta_o": ("theta_o", "θ_o"),
    "phi_o": ("phi_o", "φ_o"),
    "value": ("value", "brdf"),
    "G": ("g",),
    "B": ("b",),
    "sigma_R": ("sigma_r",),
    "sigma_G": ("sigma_g",),
    "sigma_B": ("sigma_b",),
}
"""Names of each role; a column of any other name is ignored, with a note."""
_PLACES = tuple(f"{i}{j}" for i in range(1, 5) for j in range(1, 5))
MUELLER = tuple(f"m{place}" for place in _PLACES)
"""Roles of the elements of a Mueller matrix, m11 to m44."""
NAMES |= {f"m{place}": (f"m{place}", f"mm{place}", f"m_{place}", f"m_{{{place}}}") for place in _PLACES}
NAMES |= {f"sigma_m{place}": _sigmas(f"m{place}", f"mm{place}") for place in _PLACES}
RATIO_COLUMNS = tuple(f"{angle}_{ratio}" for ratio in ("ane", "aps", "asp") for angle in ("psi", "delta"))
"""Roles of generalised Ψ and Δ, those of each ratio side by side."""
for _role in RATIO_COLUMNS:
    NAMES[_role] = (_role, _role.replace("_", " "), "{}({})".format(*_role.split("_")))
    NAMES[f"sigma_{_role}"] = _sigmas(_role)
NAMES |= {word: kind.names for word, kind in KINDS.items() if kind.names}
NAMES["R"] = (*NAMES["R"], "sci", "sce")  # of Konica Minolta: with and without the specular component
FOREIGN = (
    *("absorptance", "cd", "circular dichroism", "ellipticity", "emission", "f(r)", "fluorescence"),
    *("irradiance", "k/s", "kubelka-munk", "mdeg", "photoluminescence", "pl", "pl intensity", "power"),
    *("radiance", "raman", "raman intensity", "scope", "single beam"),
    *("absorption coefficient", "attenuation", "insertion loss", "1-r", "1-t", "1-r-t", "-ln(t)", "-ln(r)"),
    *("absorption (%)", "absorption [%]"),  # a share, as absorptance
    *("re(rho)", "im(rho)", "re(ρ)", "im(ρ)", "re_rho", "im_rho"),
    *("is", "ic", "ic'"),  # of a phase-modulated ellipsometer
)
"""Names of quantities that are not read: neither R nor T, psi and delta, nor elements of a Mueller matrix."""

COUNTERS = ("index", "no", "no.", "nr", "nr.", "number", "point", "pixel", "row", "time", "time (s)")
"""Names of columns that count rows or give times, which are no signals."""
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
_OF_RATIOS = ("psi", "delta", *RATIO_COLUMNS)
_ANGLES = ("angle", "azimuth", "analyser", *DIRECTIONS, *_OF_RATIOS, *map("sigma_{}".format, _OF_RATIOS))
_UNIT_OF = {
    "wavelength": wavelength_unit,
    **dict.fromkeys(_ANGLES, angle_unit),
    **dict.fromkeys(("counts", "intensity"), lambda text: None),
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
    measured = bool(roles & {*SIGNALS, *RATIO_COLUMNS, "intensity", "counts", "psi"})
    forms = ({"N", "C", "S"}, {"alpha", "beta"}, {"tan_psi", "cos_delta"})
    measured = measured or any(form <= roles for form in forms)
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
    """Return the names of columns, of many the first and the last, for a message."""
    names = [repr(column.name) for column in columns]
    return ", ".join(names if len(names) <= 8 else [*names[:2], "...", names[-1]])
