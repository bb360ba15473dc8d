"""Other readings of the data, where a scene does not explain them as they stand.

The sign of Δ may not have been measured, a file may follow another convention of Δ, or another sign of the
fourth Stokes parameter. A reading by which the scene would explain the data is named, with what to change.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import chain
from typing import TypeGuard

import numpy as np

from pellicle.data.colours import Colours
from pellicle.data.spectrum import Spectrum
from pellicle.fitting.result import Fit, Status
from pellicle.signals.folded_delta import can_be_folded
from pellicle.signals.mueller import reversed_elements

_NO_FIT = (Status.FAILED, Status.NOT_CONVERGED, Status.MISFIT)
_LARGE = 3.0
"""Residual of Ψ in degrees, rms, below which no other convention is tried: a wrong one leaves 10 to 30."""
_CONVENTIONS: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "360 - delta": lambda delta: (360 - delta) % 360,  # n − ik, R. M. A. Azzam and N. M. Bashara (1977)
    "delta + 180": lambda delta: (delta + 180) % 360,  # r_p of the opposite sign
    "180 - delta": lambda delta: (180 - delta) % 360,  # both
}

Data = list[Spectrum | Colours]


def remarks(spectra: Data, rms: Sequence[float], fitted: Callable[[Data], Fit]) -> list[str]:
    """Sentences on readings that would explain the data, and what to change.

    `rms` has the residuals of each spectrum, in its own unit; `fitted` fits the data of another reading.
    """
    sentences = []
    if (other := _read_as(as_folded, spectra)) and (value := _explaining(fitted(other))):
        sentences.append(
            f"delta lies within 0 to 180, and read as folded it would fit, with {value}: give `folded=True`"
        )
    if (other := _read_as(_reversed, spectra)) and (value := _explaining(fitted(other))):
        elements = [reversed_elements(s.elements) for s in other if isinstance(s, Spectrum)]
        names = ", ".join(dict.fromkeys(chain.from_iterable(elements)))
        sentences.append(
            f"with the opposite signs of {names} it would fit, with {value}: the file follows the other "
            "convention of the fourth Stokes parameter; reverse the signs of these columns"
        )
    for words, other in conventions(spectra, rms) if not sentences else ():
        if value := _explaining(fitted(other)):
            return [
                f"with {words} in place of delta it would fit, with {value}: the file follows another"
                " convention of delta (near 180 degrees on bare silicon at small angles is ours); convert its"
                " column"
            ]
    return sentences


def _explaining(other: Fit) -> str:
    """`thickness 123.4 nm` of the fit of another reading that explains the data; empty where it does not."""
    if other.status in _NO_FIT:
        return ""
    named = [p for p in other.free if p.name.split(".")[-1] == "thickness"] or list(other.free)
    return f"{named[0].name} {named[0].value:.6g} {named[0].unit}".rstrip()


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
