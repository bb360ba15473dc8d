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
from pellicle.synthetic.colours import BANDS
from pellicle.synthetic.film_spectra import to_srgb

THIN = 1000.0
"""Optical thickness (nm) up to which 32 wavelengths suffice: ΔE2000 0.02 against steps of 1 nm."""
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
    the layer is thick. An index given for each channel is interpolated linearly between the wavelengths of
    the channels, and constant beyond them. Free parameters take their start values.
    """
    found: dict[str, Any] = dict(surface.start_numbers())
    low, high = thickness_range(surface)
    brdf = surface.brdf
    if brdf.from_film_colour is not None:
        table = FilmColourTable.build(
            _medium(surface, found, "n", "k"),
            _medium(surface, found, "base_n", "base_k"),
            (0.99 * low, 1.01 * high + 1.0),
            ambient=found.get("ambient_n", 1.0),
            angle=(0.0, STEEPEST),
        )
        matrix = to_srgb(sensor())
        found |= {"table": table, "xyz_to_srgb": np.linalg.lstsq(sensor().weights, matrix, rcond=None)[0]}
        return Shading(_by_table(brdf), found, np.eye(3))
    thick = high * float(np.max(found["n"])) > THIN
    bands = integration_bands(BANDS if thick else "uniform-32")
    for key in {*INDICES} & found.keys():
        found[key] = _interpolated(surface, found[key], bands.wavelength)
    found["wavelengths"] = bands.wavelength
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


def _medium(surface: Surface, numbers: dict[str, Any], n: str, k: str) -> Table:
    """A medium whose index is given for each channel, as a table over all wavelengths."""
    wavelength = np.array([1.0, *np.sort(surface.channel_wavelengths), 1e5])
    index, extinction = (_interpolated(surface, numbers.get(key, 0.0), wavelength) for key in (n, k))
    return Table(wavelength, index, extinction if np.any(extinction) else None)


def _interpolated(surface: Surface, number: Any, wavelength: np.ndarray) -> np.ndarray:
    channels = np.asarray(surface.channel_wavelengths)
    order = np.argsort(channels)
    return np.interp(wavelength, channels[order], np.broadcast_to(number, channels.shape)[order])
