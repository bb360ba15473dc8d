"""The other reading of a Δ within 0 to 180 degrees, where a scene does not explain it as it stands."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from pellicle.data.colours import Colours
from pellicle.data.folded_delta import can_be_folded
from pellicle.data.spectrum import Spectrum
from pellicle.fitting.result import Fit, Status

_NO_FIT = (Status.FAILED, Status.NOT_CONVERGED, Status.MISFIT)


def as_folded(spectra: Sequence[Spectrum | Colours]) -> list[Spectrum | Colours] | None:
    """The spectra with each Δ as folded that can be; None where none can."""
    found = [
        replace(s, folded=True, sweeps=tuple(replace(sweep, folded=True) for sweep in s.sweeps))
        if isinstance(s, Spectrum)
        and s.delta is not None
        and not (s.folded or s.ratios)
        and can_be_folded(s.delta)
        else s
        for s in spectra
    ]
    return None if all(a is b for a, b in zip(found, spectra, strict=True)) else found


def explains(other: Fit) -> str | None:
    """`thickness 123.4 nm` of the fit of another reading that explains the data; None where it does not."""
    if other.status in _NO_FIT:
        return None
    named = [p for p in other.free if p.name.split(".")[-1] == "thickness"] or list(other.free)
    return f"{named[0].name} {named[0].value:.6g} {named[0].unit}".rstrip()


def remarks(other: Fit) -> list[str]:
    """A sentence that names the flag, where the fit of Δ as folded explains the data."""
    if (value := explains(other)) is None:
        return []
    return [f"delta lies within 0 to 180, and read as folded it would fit, with {value}: give `folded=True`"]
