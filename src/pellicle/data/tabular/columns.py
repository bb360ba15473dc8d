"""What a column's name says: its role, its unit and its polarisation.

Names are read without regard to case, with the unit in brackets (`R (%)`, `Wavelength [um]`),
after a separator (`wavelength_nm`, `R_percent`, `lambda / nm`) or as a sign (`%R`).
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from pellicle.data.tabular import units
from pellicle.errors import UsageError

#: Role → the names it goes by. Anything else is no column of ours and is said to be ignored.
_NAMES = {
    "wavelength": ("wavelength", "wavelengths", "wl", "lambda", "lam", "λ"),
    "energy": ("energy", "photon energy", "photon_energy"),
    "wavenumber": ("wavenumber", "wavenumbers", "wave number"),
    "R": ("r", "reflectance", "reflectivity", "reflection"),
    "Rs": ("rs", "r_s", "reflectance_s"),
    "Rp": ("rp", "r_p", "reflectance_p"),
    "T": ("t", "transmittance", "transmissivity", "transmission"),
    "Ts": ("ts", "t_s", "transmittance_s"),
    "Tp": ("tp", "t_p", "transmittance_p"),
    "intensity": ("intensity", "relative intensity", "relative_intensity"),
    "counts": ("counts", "raw"),
    "sigma": ("sigma", "σ"),
    "angle": ("angle", "aoi", "angle of incidence", "angle_of_incidence"),
    "psi": ("psi", "ψ"),
    "delta": ("delta", "δ"),
    "sigma_psi": ("sigma_psi", "psi_sigma", "psi_err", "psi_error", "err_psi"),
    "sigma_delta": ("sigma_delta", "delta_sigma", "delta_err", "delta_error", "err_delta"),
    "N": ("n",),
    "C": ("c",),
    "S": ("s",),
    "alpha": ("alpha", "α"),
    "beta": ("beta", "β"),
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
#: The directions of a sample of a BRDF: of the incident light and of the view.
DIRECTIONS = ("theta_i", "phi_i", "theta_o", "phi_o")
_IMPLIED_UNIT = {"energy": "eV", "wavenumber": "cm-1", "angle": "deg"}
_UNIT_OF = {
    "wavelength": units.wavelength_unit,
    "angle": units.angle_unit,
    "psi": units.angle_unit,
    "delta": units.angle_unit,
    "analyser": units.angle_unit,
    "sigma_psi": units.angle_unit,
    "sigma_delta": units.angle_unit,
    **dict.fromkeys(DIRECTIONS, units.angle_unit),
    "counts": lambda text: None,
    "intensity": lambda text: None,
}
_ALIASES = sorted(
    ((name, role) for role, names in _NAMES.items() for name in names), key=lambda a: -len(a[0])
)
_TAIL = re.compile(r"\s*(?:(?P<open>[(\[])\s*(?P<inside>.*?)\s*[)\]]|[_\s/,:-]+(?P<after>.+?))\s*")

SKIP = "_"


@dataclass(frozen=True)
class Column:
    """One column: where it is, what it holds and in which unit.

    `role` is a key of `_NAMES`, or other. Energies and wavenumbers are wavelengths in another unit,
    and R and T have their polarisation beside them: those keys are no roles.
    `unit` is None where the name does not say, and `unknown_unit` keeps a unit that was written but
    not understood.
    """

    position: int
    name: str
    role: str
    unit: str | None = None
    polarisation: str | None = None
    unknown_unit: str | None = None


def recognise(name: str, position: int = 0) -> Column:
    """The column that `name` announces; role "other" if it announces none of ours."""
    plain = name.strip().strip("\"'").strip().lower()
    unit_alone = units.wavelength_unit(plain)
    if unit_alone and plain != "a":
        return Column(position, name, "wavelength", unit_alone)
    percent = plain.startswith("%") or plain.endswith("%")
    if percent:
        plain = plain.strip("% _/,:-")
    for alias, role in _ALIASES:
        if plain == alias:
            return _column(position, name, role, "%" if percent else None, bracketed=False)
        tail = _TAIL.fullmatch(plain[len(alias) :]) if plain.startswith(alias) else None
        if tail:
            written = tail["inside"] if tail["open"] else tail["after"]
            column = _column(position, name, role, written, bracketed=bool(tail["open"]))
            if column.role != "other":
                return column
    return Column(position, name, "other")


def _column(position: int, name: str, role: str, written: str | None, *, bracketed: bool) -> Column:
    polarisation = role[1] if role in ("Rs", "Rp", "Ts", "Tp") else None
    base = "wavelength" if role in ("energy", "wavenumber") else role[0] if polarisation else role
    unit = _IMPLIED_UNIT.get(role)
    if written is None:
        return Column(position, name, base, unit, polarisation)
    known = _UNIT_OF.get(base, units.signal_unit)(written)
    if known:
        return Column(position, name, base, known, polarisation)
    if base in ("intensity", "counts"):  # arbitrary units are what these are for
        return Column(position, name, base)
    if bracketed:
        return Column(position, name, base, None, polarisation, unknown_unit=written)
    return Column(position, name, "other")  # `R_sigma_as_stated`, `t_sample`: another quantity


def recognise_all(names: Sequence[str]) -> tuple[Column, ...]:
    """`recognise` over a header, positions counted from 0."""
    return tuple(recognise(name, position) for position, name in enumerate(names))


def is_header(names: Sequence[str]) -> bool:
    """True if `names` announce a wavelength and something measured, or directions: no free text does."""
    roles = {column.role for column in recognise_all(names)}
    measured = bool(roles & {"R", "T", "intensity", "counts", "psi"})
    measured = measured or {"N", "C", "S"} <= roles or {"alpha", "beta"} <= roles
    return ("wavelength" in roles and measured) or roles.issuperset(DIRECTIONS)


def is_unit_row(names: Sequence[str]) -> bool:
    """True for a line that holds only units, as some programs write below the names (`nm,%`)."""
    return bool(names) and all(
        units.wavelength_unit(name) or units.signal_unit(name) or name.lower() in ("a.u.", "counts", "deg")
        for name in names
    )


def requested(spec: str | Sequence[str], path: str, width: int) -> tuple[Column, ...]:
    """The columns of `--columns`, e.g. `wavelength,R` or `_,energy,R_percent`; `_` skips one.

    Raises UsageError for a name that is not one of ours, or more names than the file has columns.
    """
    names = [name.strip() for name in (spec.split(",") if isinstance(spec, str) else spec)]
    if len(names) > width:
        raise UsageError(
            f"{path}: --columns names {len(names)} columns but the file has {width}; give at most {width}"
        )
    columns = tuple(
        Column(position, name, "other") if name in (SKIP, "") else recognise(name, position)
        for position, name in enumerate(names)
    )
    for column in columns:
        if column.role == "other" and column.name not in (SKIP, ""):
            raise UsageError(
                f"{path}: --columns does not know {column.name!r}; use {', '.join(_NAMES)}, "
                f"or {SKIP} to skip a column"
            )
    return columns
