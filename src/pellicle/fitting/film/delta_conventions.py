"""Other conventions of Δ, where a scene does not explain Ψ and Δ: the opposite sign, and 180 degrees more."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from pellicle.data.colours import Colours
from pellicle.data.spectrum import Spectrum
from pellicle.fitting.film.folded_reading import explains
from pellicle.fitting.result import Fit

_LARGE = 3.0
"""Residual of Ψ in degrees, rms, below which no other convention is tried: a wrong one leaves 10 to 30."""
_CONVENTIONS: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "360 - delta": lambda delta: (360 - delta) % 360,  # n − ik, R. M. A. Azzam and N. M. Bashara (1977)
    "delta + 180": lambda delta: (delta + 180) % 360,  # r_p of the opposite sign
    "180 - delta": lambda delta: (180 - delta) % 360,  # both
}


def readings(
    spectra: Sequence[Spectrum | Colours], rms: Sequence[float]
) -> Iterator[tuple[str, list[Spectrum | Colours]]]:
    """Each other convention and the spectra in it; nothing where the residuals are small or no Δ is measured.

    `rms` has the residuals of each spectrum, in its own unit. A folded Δ is within 0 to 180 degrees in one
    other convention only.
    """
    measured = [
        (s, own) for s, own in zip(spectra, rms, strict=True) if isinstance(s, Spectrum) and _has_delta(s)
    ]
    if not any(own > _LARGE for _, own in measured):
        return
    for words in ("180 - delta",) if any(s.folded for s, _ in measured) else _CONVENTIONS:
        yield words, [_read(s, words) if isinstance(s, Spectrum) and _has_delta(s) else s for s in spectra]


def _has_delta(spectrum: Spectrum) -> bool:
    return spectrum.delta is not None and not spectrum.ratios


def _read(spectrum: Spectrum, words: str) -> Spectrum:
    assert spectrum.delta is not None
    delta = _CONVENTIONS[words](spectrum.delta)
    if spectrum.folded:  # 180 and what rounding leaves beyond
        delta = np.clip(180 - spectrum.delta, 0, 180)
    return replace(spectrum, delta=delta, sweeps=tuple(_read(sweep, words) for sweep in spectrum.sweeps))


def remarks(words: str, other: Fit) -> list[str]:
    """A sentence that says what to change, where the fit with the other convention explains the data."""
    if (value := explains(other)) is None:
        return []
    return [
        f"with {words} in place of delta it would fit, with {value}: the file follows another convention of "
        "delta (near 180 degrees on bare silicon at small angles is ours); convert its column"
    ]
