"""Methods of computing the colour of a film: integration over the spectrum, interpolation in the angle.

They run in single precision, as colours do; the reference runs in double.
"""

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from pellicle.accuracy.case import Program, compiled_function
from pellicle.accuracy.registry import Comparison, Method, measure
from pellicle.brdf import film_colour
from pellicle.colour import FilmColourTable, delta_e2000, integration_bands, lab, sensor
from pellicle.colour.bands import Bands
from pellicle.colour.film import reflectance
from pellicle.colour.observers import Sensor
from pellicle.dispersion.empirical import Table
from pellicle.errors import UsageError
from pellicle.fitting.progress import Progress

EYE = ("1931", "D65")
FINE = "uniform-64"
"""Integration of practically exact colours, with which fewer angles are measured."""


COLOUR_TOLERANCE = 0.5
"""Default tolerance: mean ΔE2000."""


class Films(NamedTuple):
    """Films in air and the angles (radians, (angles,)) at which each of them is seen.

    `numbers` has for each key of the film an array (draws,) or, where it differs between channels, a
    dispersion; `k` and `base_k` only where there are any.
    """

    numbers: dict[str, Any]
    angle: np.ndarray
    thickest: float

    @property
    def absorbs(self) -> bool:
        """True where the film has an extinction."""
        return "k" in self.numbers


def xyz(bands: Bands, numbers: dict[str, Any], angle: Any) -> Any:
    """XYZ (angles, 3) of one film."""
    index, base = (_index(numbers, *keys) for keys in (("n", "k"), ("base_n", "base_k")))
    ambient = numbers.get("ambient_n", 1.0)
    degrees = jnp.rad2deg(angle)
    spectrum = jnp.asarray(
        reflectance(numbers["thickness"], index, base, bands, ambient=ambient, angle=degrees)
    )
    return spectrum @ jnp.asarray(bands.weights, spectrum.dtype)


def _index(numbers: dict[str, Any], n: str, k: str) -> Any:
    index, extinction = numbers[n], numbers.get(k)
    if extinction is None:
        return index
    if isinstance(index, Table):
        same = isinstance(extinction, Table)
        return Table(index.wavelength, index.n, extinction.n if same else extinction * jnp.ones_like(index.n))
    return jax.lax.complex(*jnp.broadcast_arrays(index, extinction))


def _by_way(name: str, films: Films, double: bool = False) -> Program | str:
    bands = integration_bands(name, *EYE)
    if films.absorbs and not bands.absorbs:
        return "it has no absorbing layer"
    return compiled(partial(xyz, bands), films, double)


def _by_nodes(count: int, thickest: float, films: Films) -> Program | str:
    if films.thickest > thickest:
        return f"its wavelengths are for films up to {thickest:g} nm"
    return _by_way(f"nodes-{count}-{thickest:g}", films)


def _by_angles(count: int, films: Films) -> Program | str:
    """Interpolation of the colours at some angles by a polynomial in the cosine."""
    if 2 * count > films.angle.size:
        return "too few angles to interpolate between"
    if any(isinstance(x, Table) for x in films.numbers.values()):
        return "its index is a table"
    bands, colour = integration_bands(FINE, *EYE), film_colour.interpolated(count)

    def at_angles(numbers: dict[str, Any], angle: Any) -> Any:
        i = jnp.stack([jnp.sin(angle), 0 * angle, jnp.cos(angle)], axis=-1)
        o = jnp.stack([-jnp.sin(angle), 0 * angle, jnp.cos(angle)], axis=-1)
        given = {"wavelengths": bands.wavelength, "weights": bands.weights}
        return colour(numbers | {key: jnp.asarray(x, i.dtype) for key, x in given.items()}, i, o)

    return compiled(at_angles, films)


class OneFilm(NamedTuple):
    """A film of known indices, and its thicknesses (draws,) in nm, rising."""

    thickness: np.ndarray
    layer: Any
    base: Any
    ambient: Any


def one_film(films: Films) -> OneFilm | str:
    """The film whose thickness alone differs between the draws, or why there is none."""
    numbers: dict[str, Any] = {
        key: x if isinstance(x, Table) else np.unique(x) for key, x in films.numbers.items()
    }
    thickness = numbers.pop("thickness")
    if any(np.size(x) > 1 for x in numbers.values() if not isinstance(x, Table)):
        return "its indices are free: it is for one film"
    one: dict[str, Any] = {key: x if isinstance(x, Table) else x[0] for key, x in numbers.items()}
    layer, base = (_index(one, *keys) for keys in (("n", "k"), ("base_n", "base_k")))
    return OneFilm(thickness, layer, base, one.get("ambient_n", 1.0))


def _by_table(films: Films) -> Program | str:
    """One lookup in a table, whose computation counts as compilation."""
    film = one_film(films)
    if isinstance(film, str):
        return film
    began = time.perf_counter()
    thickness = film.thickness
    table = FilmColourTable.build(
        *(film.layer, film.base, (float(0.99 * thickness[0]), float(1.01 * thickness[-1]) + 1.0)),
        ambient=film.ambient,
        angle=(0.0, max(float(np.rad2deg(films.angle.max())), 1.0)),  # a table needs two angles
    )
    built = time.perf_counter() - began
    program = compiled(lambda numbers, angle: table.xyz(numbers["thickness"], jnp.cos(angle)), films)
    return replace(program, compile_seconds=program.compile_seconds + built)


def compiled(colour: Callable, films: Films, double: bool = False) -> Program:
    """Compile a method of one film's colours, (numbers, angles in radians) → XYZ, for all films."""
    draws = max(np.size(x) for x in films.numbers.values() if not isinstance(x, Table))
    tables = {key: None if isinstance(x, Table) else 0 for key, x in films.numbers.items()}
    call = jax.vmap(colour, in_axes=(tables, None))
    return compiled_function(call, (films.numbers, films.angle), draws * films.angle.size, double)


def error(eye: Sensor, reference: np.ndarray, colours: np.ndarray) -> float:
    """Mean ΔE2000 of colours (draws, angles, 3) from the reference; infinite where one is not finite."""
    difference = differences(eye, reference, colours)
    return float(np.mean(difference)) if np.all(np.isfinite(difference)) else math.inf


def differences(eye: Sensor, reference: np.ndarray, colours: np.ndarray) -> np.ndarray:
    """ΔE2000 (draws, angles) of colours from the reference."""
    return delta_e2000(*(np.asarray(lab(np.asarray(x, float), eye.white)) for x in (colours, reference)))


def reference_program(films: Films) -> Program:
    """Integration in steps of 1 nm, in double precision."""
    eye = sensor(*EYE)
    return compiled(partial(xyz, Bands(eye.wavelength, None, eye.weights)), films, double=True)


def reference_colours(films: Films) -> np.ndarray:
    """Colours by integration in steps of 1 nm, in double precision."""
    return reference_program(films).run()


_SAMPLES = "the spectrum between them"
COLOUR_METHODS = (
    *(
        Method(f"points-{rgb}", "all but three wavelengths", partial(_by_way, f"points-{rgb}"))
        for rgb in ("650-510-475", "645-525-445")
    ),
    Method("belcour-barla", "the sensors' shape: 4 Gaussians", partial(_by_way, "belcour-barla")),
    *(
        Method(f"gaussians-{n}", f"the sensors' shape: {n} Gaussians", partial(_by_way, f"gaussians-{n}"))
        for n in (4, 5, 6, 8, 10)
    ),
    Method("gaussians-8 in float64", "as gaussians-8", partial(_by_way, "gaussians-8", double=True)),
    *(
        Method(f"nodes-{n}-{d}", _SAMPLES, partial(_by_nodes, n, d))
        for d, counts in ((500, (3, 4, 6, 8, 12)), (1000, (8, 12, 16)))
        for n in counts
    ),
    *(
        Method(f"{kind}-{n}", _SAMPLES, partial(_by_way, f"{kind}-{n}"))
        for kind in ("uniform", "frequency")
        for n in (8, 16, 32, 64)
    ),
    *(
        Method(f"{FINE} at {n} angles", "the angles between them", partial(_by_angles, n))
        for n in (8, 16, 32)
    ),
    Method("table of the film", "the colours between its nodes", _by_table),
)
"""Methods of computing a colour by this package and by its predecessors, in the order of the table."""


def compare_colours(
    films: Films, tolerance: float, progress: Progress, methods: Sequence[Method] = COLOUR_METHODS
) -> Comparison:
    """Measure every method of computing the colours of films. Raises UsageError without colour-science."""
    try:
        reference = reference_colours(films)
        error_of = partial(error, sensor(*EYE), reference)
        error_of(reference)  # fails without colour-science
    except ImportError as missing:
        raise UsageError(str(missing)) from None
    comparison = Comparison("colour", "steps of 1 nm", tolerance, "ΔE2000", films.angle.size, len(reference))
    return measure(comparison, methods, lambda method: method.apply(films), error_of, progress)
