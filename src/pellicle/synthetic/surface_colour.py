"""Model of a surface in colours: its BRDF integrated over the spectrum, not taken at three wavelengths."""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

import numpy as np

from pellicle.brdf.directions import cosine_to_half
from pellicle.brdf.models import Model
from pellicle.colour import FilmColourTable, integration_bands, sensor
from pellicle.colour.observers import Sensor
from pellicle.dispersion.empirical import Table
from pellicle.scene.free import Free
from pellicle.scene.surface import INDICES, Surface
from pellicle.scene.surface_media import index_numbers
from pellicle.synthetic.colours import BANDS
from pellicle.synthetic.film_spectra import to_srgb

THIN = 1000.0
"""Optical thickness (nm) up to which 32 wavelengths suffice: ΔE2000 0.016 in the mean, 0.08 at most."""
_EVERYWHERE = sensor().wavelength
"""Wavelengths (nm) of the table of a film, in steps of 1 nm."""
STEEPEST = 85.0
"""Largest angle of incidence on a facet (degrees) in the table of a film; beyond it colours stay the same."""


class Shading(NamedTuple):
    """Model of a surface, its numbers, and the matrix (channels, 3) from its channels to linear sRGB."""

    brdf: Model
    numbers: dict[str, Any]
    to_srgb: np.ndarray


def in_colour(surface: Surface) -> Shading:
    """Return a surface's model for colours under D65, with the CIE 1931 observer.

    A model with the colour of a film takes it from a `FilmColourTable`, which is made in steps of 1 nm. The
    lobes of other models differ between wavelengths: they are evaluated at 32 wavelengths, or at 64 where
    the layer is thick. Media have their own index at each wavelength; an index given for each channel is
    interpolated linearly between the wavelengths of the channels, and constant beyond them. Free parameters
    take their start values.
    """
    found: dict[str, Any] = dict(surface.start_numbers())
    low, high = thickness_range(surface)
    brdf = surface.brdf
    found.pop("weights", None)  # of a sensor that is not the eye
    if not found.get("multiple_scattering"):
        found.pop("multiple_scattering", None)
    if brdf.from_film_colour is not None:
        at = _at(surface, found, _EVERYWHERE)
        table = FilmColourTable.build(
            _medium(at, "n", "k"),
            _medium(at, "base_n", "base_k"),
            (0.99 * low, 1.01 * high + 1.0),
            ambient=Table(_EVERYWHERE, at["ambient_n"]) if "ambient_n" in at else found.get("coat_n", 1.0),
            angle=(0.0, STEEPEST),
        )
        matrix = to_srgb(sensor())
        found |= {"table": table, "xyz_to_srgb": np.linalg.lstsq(sensor().weights, matrix, rcond=None)[0]}
        return Shading(_by_table(brdf), found, np.eye(3))
    thick = high * float(np.max(found["n"])) > THIN
    bands = integration_bands(BANDS if thick else "uniform-32")
    found |= _at(surface, found, bands.wavelength) | {"wavelengths": bands.wavelength}
    return Shading(brdf, found, to_srgb(Sensor(bands.wavelength, bands.weights)))


def thickness_range(surface: Surface) -> tuple[float, float]:
    """Bounds of a free thickness in nm, or a fixed one twice."""
    thickness: Any = surface.numbers.get("thickness", surface.start_numbers()["thickness"])
    if isinstance(thickness, Free):
        return thickness.lower, thickness.upper
    return float(thickness), float(thickness)


@cache  # one object for each model, for which programs are compiled once
def _by_table(brdf: Model) -> Model:
    assert brdf.from_film_colour is not None
    return brdf._replace(evaluate=brdf.from_film_colour(_from_table))


def _from_table(parameters: Any, i: Any, o: Any) -> Any:
    """Linear sRGB (..., 3) of the film."""
    return parameters["table"].xyz(parameters["thickness"], cosine_to_half(i, o)) @ parameters["xyz_to_srgb"]


def _at(surface: Surface, numbers: dict[str, Any], nm: np.ndarray) -> dict[str, np.ndarray]:
    """Indices (wavelengths,) of the surface: those of its media, and those of its channels interpolated."""
    channels = surface.bands.wavelength
    order = np.argsort(channels)
    given = {
        key: np.interp(nm, channels[order], np.broadcast_to(numbers[key], channels.shape)[order])
        for key in INDICES
        if key in numbers
    }
    for part, medium in (("film", surface.film), ("base", surface.base)):
        given |= index_numbers(part, medium, nm, surface.numbers, surface.brdf)
    return given


def _medium(at: dict[str, np.ndarray], n: str, k: str) -> Table:
    extinction = at.get(k)
    return Table(_EVERYWHERE, at[n], extinction if extinction is not None and np.any(extinction) else None)
