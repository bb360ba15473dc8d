"""Variables of a cube by their names: which are the measured values, and which their errors."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from pellicle.data.cubes.raw_cube import COUNTS
from pellicle.data.tabular.columns import Column, recognise
from pellicle.data.tabular.units import signal_unit
from pellicle.errors import DataError, UsageError, did_you_mean

_ERROR = r"(?:sigma|std|sd|stdev|stddev|stderr|uncertainty|unc|err|error|errors)"
_ERRORS = re.compile(rf"(?:{_ERROR}(?:_(?P<of>.+))?|(?P<name>.+)_{_ERROR})", re.IGNORECASE)
_COUNTS = ("counts", "count", "dn", "adu", "digital number", "raw")


@dataclass(frozen=True)
class Chosen:
    """Variables of a cube by role ("values", "delta", "sigma", "delta_sigma"), and what their names state."""

    arrays: Mapping[str, str]
    signal: str | None
    polarisation: str | None
    unit: str | None
    calibrated: bool

    @property
    def stated(self) -> dict[str, Any]:
        """Statements of the names, as arguments of a `RawCube`."""
        about = {"signal": self.signal, "polarisation": self.polarisation}
        return {**about, "signal_unit": self.unit, "calibrated": self.calibrated}


def choose_variables(
    written: Mapping[str, str | None], variable: str | None, signal: str | None, path: str
) -> Chosen:
    """Choose the variables to read among those with an axis of wavelengths.

    `written` gives the unit of each as its file states it; `variable` is the name of the one to read, and
    `signal` may settle which one is meant. Raises UsageError where several remain.
    """
    if variable is not None and variable not in written:
        raise UsageError(
            f"{path}: has no variable {variable!r}{did_you_mean(variable, written)} of pixels and bands, but "
            f"{', '.join(map(repr, written))}"
        )
    roles = {name: recognise(name) for name in written}
    errors = {name: match for name in written if (match := _ERRORS.fullmatch(name)) and name != variable}
    values = {name: column for name, column in roles.items() if name not in errors}
    if variable is None and signal in (None, "psi-delta"):
        pair = {c.role: name for name, c in values.items() if c.role in ("psi", "delta")}
        if len(pair) == 2 and (signal or not any(c.role in ("R", "T") for c in values.values())):
            return _psi_delta(pair, errors, written, path)
    names = [variable] if variable else _measured(values, signal)
    if not names and (half := [name for name, column in roles.items() if column.role in ("psi", "delta")]):
        raise DataError(
            f"{path}: has {half[0]!r} alone, and ellipsometry needs psi and delta: write both into the file"
        )
    if len(names) != 1:
        raise UsageError(
            f"{path}: has several variables of pixels and bands, {', '.join(map(repr, names or written))}: "
            "choose one with `variable`"
        )
    [name] = names
    column = roles[name]
    arrays = {"values": name}
    if own := _errors_of(name, column.role, errors, alone=len(values) == 1):
        arrays["sigma"] = own
    stated, unit = written[name], column.unit
    if stated is not None:
        plain = stated.strip().lower()
        unit = COUNTS if plain in _COUNTS else signal_unit(plain) or unit
    if column.role in ("counts", "sample counts"):
        unit = COUNTS
    known = column.role if column.role in ("R", "T") else None
    return Chosen(arrays, known, column.polarisation, unit, column.role != "intensity")


def _measured(values: Mapping[str, Column], signal: str | None) -> list[str]:
    """Names of the variables that may be meant: those of known quantities first."""
    for wanted in ((signal,), ("R", "T"), ("intensity", "counts", "sample counts")):
        if named := [name for name, column in values.items() if column.role in wanted]:
            return named
    return [name for name, column in values.items() if column.role not in ("psi", "delta", "foreign")]


def _errors_of(name: str, role: str, errors: Mapping[str, re.Match[str]], *, alone: bool) -> str | None:
    """The variable of the standard deviations of another one."""
    for error, match in errors.items():
        of = match["of"] or match["name"]
        if (of is None and alone) or (of is not None and of in (name, role)):
            return error
    return None


def _psi_delta(
    pair: Mapping[str, str],
    errors: Mapping[str, re.Match[str]],
    written: Mapping[str, str | None],
    path: str,
) -> Chosen:
    arrays = {"values": pair["psi"], "delta": pair["delta"]}
    for role, key in (("psi", "sigma"), ("delta", "delta_sigma")):
        if own := _errors_of(pair[role], role, errors, alone=False):
            arrays[key] = own
        unit = (written[pair[role]] or "").strip().lower()
        if unit.startswith("rad"):
            raise DataError(f"{path}: {pair[role]!r} is in radians: convert it to degrees")
    return Chosen(arrays, "psi-delta", None, None, True)
