"""Other readings of Δ and of Mueller matrices, where a scene does not explain them as they stand.

The sign of Δ may not have been measured, a file may follow another convention of Δ, or another sign of the
fourth Stokes parameter.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import chain
from typing import TypeGuard

import numpy as np

from pellicle.data.colours import Colours
from pellicle.data.spectrum import Spectrum
from pellicle.signals.folded_delta import can_be_folded
from pellicle.signals.mueller import reversed_elements

_LARGE = 3.0
"""Residual of Ψ in degrees, rms, below which no other convention is tried: a wrong one leaves 10 to 30."""
_CONVENTIONS: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "360 - delta": lambda delta: (360 - delta) % 360,  # n − ik, R. M. A. Azzam and N. M. Bashara (1977)
    "delta + 180": lambda delta: (delta + 180) % 360,  # r_p of the opposite sign
    "180 - delta": lambda delta: (180 - delta) % 360,  # both
}

Data = list[Spectrum | Colours]


def readings(spectra: Data, rms: Sequence[float]) -> Iterator[tuple[str, str, Data]]:
    """Each other reading in words, what states it, and the data in it.

    `rms` has the residuals of each spectrum, in its own unit.
    """
    if other := _read_as(_reversed, spectra):
        elements = [reversed_elements(s.elements) for s in other if isinstance(s, Spectrum)]
        names = ", ".join(dict.fromkeys(chain.from_iterable(elements)))
        of = "the file follows the other convention of the fourth Stokes parameter"
        yield f"the opposite signs of {names}", f"{of}; reverse the signs of these columns", other
    for words, other in conventions(spectra, rms):
        ours = "near 180 degrees on bare silicon at small angles is ours"
        of = f"the file follows another convention of delta ({ours}); convert its column"
        yield f"{words} in place of delta", of, other


def folded(spectra: Data) -> Iterator[tuple[str, str, Data]]:
    """The reading of Δ as folded where it can be, which takes a program of its own."""
    if other := _read_as(as_folded, spectra):
        yield "delta read as folded", "give `folded=True`", other


def _read_as(reading: Callable[[Spectrum], Spectrum], spectra: Data) -> Data:
    """The data with each spectrum in another reading; empty where none has another."""
    read = [reading(s) if isinstance(s, Spectrum) else s for s in spectra]
    return [] if all(a is b for a, b in zip(read, spectra, strict=True)) else read


def as_folded(spectrum: Spectrum) -> Spectrum:
    """The spectrum with its Δ as folded, if it can be."""
    unfolded = not (spectrum.folded or spectrum.ratios)
    if spectrum.delta is None or not unfolded or not can_be_folded(spectrum.delta):
        return spectrum
    sweeps = tuple(replace(sweep, folded=True) for sweep in spectrum.sweeps)
    return replace(spectrum, folded=True, sweeps=sweeps)


def _reversed(spectrum: Spectrum) -> Spectrum:
    """The spectrum with the opposite sign of m14, m24, m34, m41, m42, m43, if it has one of them."""
    names = reversed_elements(spectrum.elements)
    if not names:
        return spectrum
    signs = np.where(np.isin(spectrum.elements, names), -1.0, 1.0)
    sweeps = tuple(_reversed(sweep) for sweep in spectrum.sweeps)
    return replace(spectrum, values=spectrum.values * signs, sweeps=sweeps)


def conventions(spectra: Sequence[Spectrum | Colours], rms: Sequence[float]) -> Iterator[tuple[str, Data]]:
    """Each other convention of Δ and the spectra in it; nothing where the residuals are small or no Δ is
    measured.

    A folded Δ is within 0 to 180 degrees in one other convention only.
    """
    measured = [(s, size) for s, size in zip(spectra, rms, strict=True) if _has_delta(s)]
    if not any(size > _LARGE for _, size in measured):
        return
    for words in ("180 - delta",) if any(s.folded for s, _ in measured) else _CONVENTIONS:
        yield words, [_read(s, words) if _has_delta(s) else s for s in spectra]


def _has_delta(data: Spectrum | Colours) -> TypeGuard[Spectrum]:
    """True for a spectrum of one Δ."""
    return isinstance(data, Spectrum) and data.delta is not None and not data.ratios


def _read(spectrum: Spectrum, words: str) -> Spectrum:
    assert spectrum.delta is not None
    delta = _CONVENTIONS[words](spectrum.delta)
    if spectrum.folded:  # 180 and what rounding leaves beyond
        delta = np.clip(180 - spectrum.delta, 0, 180)
    return replace(spectrum, delta=delta, sweeps=tuple(_read(sweep, words) for sweep in spectrum.sweeps))
