"""Request of an identification: what is stated of a sample and what to try, and the problem to be solved."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pellicle.data.options import CONDITIONS
from pellicle.data.spectrum import Spectrum
from pellicle.errors import DataError, UsageError
from pellicle.fitting.film.fringes import fringes
from pellicle.identification import films
from pellicle.identification.hypothesis import NotTried
from pellicle.identification.problem import Problem
from pellicle.identification.search import THICK
from pellicle.identification.signal_view import (
    MOST_POINTS,
    SCANNED_POINTS,
    SignalView,
    check_signal,
    compared_points,
)
from pellicle.materials import check_common_range
from pellicle.scene.film import Light, Scene
from pellicle.scene.layers import Layer, Substrate, medium

FEWEST = 20
"""Points below which a spectrum cannot tell structures apart."""
_USUAL, _FRINGED = 3000.0, 8000.0
"""Largest thickness (nm) that is tried, unless fringes have an optical path of at least the second."""


@dataclass(frozen=True)
class Request:
    """Options of an identification: substrate, light, materials, seconds, and mistakes to look for."""

    substrate: Substrate
    ambient: Any
    light: Light
    names: tuple[str, ...]
    layers: int = 2
    conditions: tuple[str, ...] = CONDITIONS
    budget: float = np.inf

    def around(self) -> Scene:
        """The scene of the bare substrate."""
        return Scene(Layer(medium("SiO2"), 0.0), self.substrate, ambient=self.ambient, light=self.light)


def check(spectrum: Spectrum, request: Request) -> None:
    """Raise where a spectrum cannot be identified."""
    check_signal(spectrum)
    name = spectrum.path or "the data"
    if len(spectrum) < FEWEST:
        raise DataError(
            f"{name}: {len(spectrum)} points are too few to tell films apart: give at least {FEWEST}"
        )
    if not np.ptp(spectrum.values):
        raise DataError(f"{name}: all values are {spectrum.values[0]:g}, so there is nothing to identify")
    oblique = spectrum.angle is not None or np.any(np.asarray(request.light.angle) > 0)
    if spectrum.signal == "psi-delta" and not oblique:
        raise UsageError(f"{name}: psi and delta need the `angle` of incidence, and the data do not state it")


def problem_of(spectra: Sequence[Spectrum], request: Request) -> tuple[Problem, list[NotTried]]:
    """The problem of spectra, and materials that do not cover them."""
    around = request.around()
    paths = [_optical_path(x) for x in spectra]
    thickest = THICK if max(paths) > _FRINGED else _USUAL
    finest = max(*paths, 2 * _USUAL) if max(paths) > _FRINGED else max(*paths, 2000.0)

    def views(most: int) -> tuple[SignalView, ...]:
        return tuple(SignalView(compared_points(x, finest, most), around) for x in spectra)

    fine, coarse = views(MOST_POINTS), views(SCANNED_POINTS)
    for view in fine:
        check_common_range([request.substrate.material], view.spectrum.wavelength)
    # of both grids at once: means of neighbours may lie beyond the ends of a table
    left_out = films.tabulated((*fine, *coarse), request.names)
    return Problem(fine, thickest, Problem(coarse, thickest)), left_out


def _optical_path(spectrum: Spectrum) -> float:
    """Optical path (nm) of the fringes of a spectrum, 0 where it has none or several angles."""
    if spectrum.angle is not None and np.ptp(spectrum.angle) > 0:
        return 0.0
    found = fringes(2 / spectrum.wavelength, spectrum.values)
    return 0.0 if found is None else 2 * found.thickness
