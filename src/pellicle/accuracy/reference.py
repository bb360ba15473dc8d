"""The answers that a ladder is measured against."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pellicle.accuracy.case import Case
from pellicle.accuracy.compiled import compiled
from pellicle.accuracy.methods import Way
from pellicle.errors import UsageError

REFERENCES = ("float64", "mpmath")
MP_DRAWS, MP_WAVELENGTHS = 12, 25
"""How much of a case is computed to 50 digits."""


class Reference(NamedTuple):
    """A case's signal, (draws, wavelengths, channels), at some of its draws and wavelengths."""

    name: str
    values: np.ndarray
    draws: np.ndarray
    wavelengths: np.ndarray

    def error(self, case: Case, answer: np.ndarray) -> float:
        """The largest distance of an answer (draws, points) from the truth, in the signal's unit.

        For ellipsometry the arc between two points (N, C, S) in degrees: an error of Ψ counts twice, one
        of Δ by sin 2Ψ. Infinite where the answer is no number and the truth is.
        """
        rows = answer.reshape(len(answer), len(case.wavelength), -1)[self.draws][:, self.wavelengths]
        known = np.all(np.isfinite(self.values), axis=-1)
        off = np.linalg.norm(np.asarray(rows, dtype=float) - self.values, axis=-1)[known]
        worst = float(np.max(off, initial=0.0)) if np.all(np.isfinite(off)) else np.inf
        return float(np.rad2deg(worst)) if case.ellipsometric else worst


def reference(name: str, case: Case) -> Reference:
    """The reference of that name. Raises UsageError where the case cannot be computed with it."""
    if name == "float64":
        return _float64(case)
    if name == "mpmath":
        return _fifty_digits(case)
    raise UsageError(f"--reference must be {' or '.join(REFERENCES)}, not {name!r}")


def _float64(case: Case) -> Reference:
    program = compiled(case, Way(case.plan, case.scene))
    answer = program.run()
    rows = answer.reshape(len(answer), len(case.wavelength), -1)
    return Reference("float64", rows, np.arange(len(answer)), np.arange(len(case.wavelength)))


def _fifty_digits(case: Case) -> Reference:
    try:
        from pellicle.accuracy.high_precision import signal, unsuitable
    except ImportError:
        raise UsageError(
            "--reference mpmath needs mpmath: pip install 'pellicle[reference]', or --reference float64"
        ) from None
    why = unsuitable(case)
    if why is not None:
        raise UsageError(
            f"--reference mpmath computes smooth, even layers in light of one wavelength and angle; {why}:"
            " use --reference float64"
        )
    draws = np.arange(min(MP_DRAWS, len(case.draws) if case.draws.shape[1] else 1))
    count = min(MP_WAVELENGTHS, len(case.wavelength))
    at = np.unique(np.linspace(0, len(case.wavelength) - 1, count).round().astype(int))
    return Reference("mpmath", np.stack([signal(case, case.draws[i], at) for i in draws]), draws, at)
