"""Reference signals, with which the signals of all methods are compared."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pellicle.accuracy.case import Case
from pellicle.accuracy.compiled import compiled
from pellicle.accuracy.variant import Variant
from pellicle.errors import UsageError, install_command

REFERENCES = ("float64", "mpmath")
MP_DRAWS, MP_WAVELENGTHS = 12, 25
"""Most draws and wavelengths of a case that are computed to 50 digits."""


class Reference(NamedTuple):
    """Signal of a case, (draws, wavelengths, channels), at some of its draws and wavelengths."""

    name: str
    values: np.ndarray
    draws: np.ndarray
    wavelengths: np.ndarray

    def error(self, case: Case, signal: np.ndarray) -> float:
        """The largest error of a signal (draws, points), in its unit.

        For Ψ and Δ it is the arc between two points (N, C, S) in degrees: an error of Ψ counts twice,
        one of Δ sin 2Ψ times. Infinite where the signal is not finite and the reference is.
        """
        rows = signal.reshape(len(signal), len(case.wavelength), -1)[self.draws][:, self.wavelengths]
        known = np.all(np.isfinite(self.values), axis=-1)
        apart = np.abs(np.asarray(rows, dtype=float) - self.values)[known]
        off = np.linalg.norm(apart, axis=-1) if case.in_degrees else apart
        worst = float(np.max(off, initial=0.0)) if np.all(np.isfinite(off)) else np.inf
        return float(np.rad2deg(worst)) if case.in_degrees else worst


def reference_signal(name: str, case: Case) -> Reference:
    """The signal of a case by the full plan in float64, or by mpmath with 50 digits.

    **Raises:** UsageError for another name and where mpmath cannot compute the case.
    """
    if name == "mpmath":
        return _by_mpmath(case)
    if name != "float64":
        raise UsageError(f"`reference` must be {' or '.join(REFERENCES)}, not {name!r}")
    signal = compiled(case, Variant(case.plan, case.scene)).run()
    rows = signal.reshape(len(signal), len(case.wavelength), -1)
    return Reference("float64", rows, np.arange(len(signal)), np.arange(len(case.wavelength)))


def _by_mpmath(case: Case) -> Reference:
    try:
        from pellicle.accuracy.high_precision import signal, unsuitable
    except ImportError:
        raise UsageError(
            f'`reference="mpmath"` needs mpmath: {install_command("reference")}; or use `reference="float64"`'
        ) from None
    why = unsuitable(case)
    if why is not None:
        raise UsageError(
            f'`reference="mpmath"` computes smooth, even layers at one wavelength and angle; {why}:'
            ' use `reference="float64"`'
        )
    draws = np.arange(min(MP_DRAWS, len(case.draws) if case.draws.shape[1] else 1))
    count = min(MP_WAVELENGTHS, len(case.wavelength))
    at = np.unique(np.linspace(0, len(case.wavelength) - 1, count).round().astype(int))
    return Reference("mpmath", np.stack([signal(case, case.draws[i], at) for i in draws]), draws, at)
