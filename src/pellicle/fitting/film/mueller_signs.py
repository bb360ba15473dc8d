"""The other sign of the fourth Stokes parameter, where a scene does not explain a Mueller matrix."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pellicle.data.colours import Colours
from pellicle.data.spectrum import Spectrum
from pellicle.fitting.film.folded_reading import explains
from pellicle.fitting.result import Fit


def with_other_signs(spectra: Sequence[Spectrum | Colours]) -> list[Spectrum | Colours] | None:
    """The spectra with the opposite sign of m14, m24, m34, m41, m42, m43; None where none has one of them."""
    found = [_reversed(s) if isinstance(s, Spectrum) and reversed_elements(s) else s for s in spectra]
    return None if all(a is b for a, b in zip(found, spectra, strict=True)) else found


def reversed_elements(spectrum: Spectrum) -> list[str]:
    """The elements that have the fourth Stokes parameter on one side."""
    return [name for name in spectrum.elements if ("4" in name[1]) != ("4" in name[2])]


def _reversed(spectrum: Spectrum) -> Spectrum:
    signs = np.where(np.isin(spectrum.elements, reversed_elements(spectrum)), -1.0, 1.0)
    sweeps = tuple(_reversed(sweep) for sweep in spectrum.sweeps)
    return replace(spectrum, values=spectrum.values * signs, sweeps=sweeps)


def remarks(other: Fit) -> list[str]:
    """A sentence that says what to change, where the fit with the other signs explains the data."""
    if (value := explains(other)) is None:
        return []
    each = [reversed_elements(part.data) for part in other.parts if isinstance(part.data, Spectrum)]
    names = ", ".join(dict.fromkeys(name for own in each for name in own))
    return [
        f"with the opposite signs of {names} it would fit, with {value}: the file follows the other "
        "convention of the fourth Stokes parameter; reverse the signs of these columns"
    ]
