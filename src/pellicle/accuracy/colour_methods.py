"""Methods of computing the colour of a film: accuracy against time, and maps of their colours.

They integrate over the spectrum, or interpolate in the angle.

They run in single precision, as colours do; the reference runs in double.
"""

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import ArrayLike

from pellicle.accuracy.case import Program, check_tolerance, compiled_function
from pellicle.accuracy.registry import Comparison, Cost, Method, measure
from pellicle.brdf import film_colour
from pellicle.colour import FilmColourTable, delta_e2000, integration_bands, lab, sensor
from pellicle.colour.bands import Bands
from pellicle.colour.film import reflectance
from pellicle.colour.observers import SPAN, Sensor
from pellicle.dispersion.base import AbstractDispersion, known_index
from pellicle.dispersion.empirical import Table
from pellicle.errors import UsageError
from pellicle.fitting.progress import Progress, quiet
from pellicle.optics.pair import parts, real
from pellicle.scene.film import Scene
from pellicle.scene.free import Free, free_leaves, insert, start_values
from pellicle.scene.layers import Layer

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
    light = {"ambient": numbers.get("ambient_n", 1.0), "angle": jnp.rad2deg(angle)}
    spectrum = jnp.asarray(reflectance(numbers["thickness"], *_indices(numbers), bands, **light))
    return spectrum @ jnp.asarray(bands.weights, spectrum.dtype)


def _indices(numbers: dict[str, Any]) -> tuple[Any, Any]:
    """Indices of a film and of its base, complex where they absorb."""
    film = _index(numbers["n"], numbers.get("k"))
    return film, _index(numbers["base_n"], numbers.get("base_k"))


def _index(index: Any, extinction: Any) -> Any:
    if extinction is None:
        return index
    if isinstance(index, Table):
        same = isinstance(extinction, Table)
        return Table(index.wavelength, index.n, extinction.n if same else extinction * jnp.ones_like(index.n))
    return jax.lax.complex(*jnp.broadcast_arrays(index, extinction))


def _by_way(name: str, films: Films, double: bool = False, thickest: float = math.inf) -> Program | str:
    if films.thickest > thickest:
        return f"its wavelengths are for films up to {thickest:g} nm"
    bands = integration_bands(name, *EYE)
    if films.absorbs and not bands.absorbs:
        return "it has no absorbing layer"
    return compiled(partial(xyz, bands), films, double)


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
    return OneFilm(thickness, *_indices(one), one.get("ambient_n", 1.0))


def _by_table(films: Films) -> Program | str:
    """One lookup in a table, whose computation counts as compilation."""
    film = one_film(films)
    if isinstance(film, str):
        return film
    began = time.perf_counter()
    table = FilmColourTable.build(
        *(film.layer, film.base, (float(0.99 * film.thickness[0]), float(1.01 * film.thickness[-1]) + 1.0)),
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
        Method(f"nodes-{n}-{d}", _SAMPLES, partial(_by_way, f"nodes-{n}-{d}", thickest=d))
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
        reference = reference_program(films).run()
        error_of = partial(error, sensor(*EYE), reference)
        error_of(reference)  # fails without colour-science
    except ImportError as missing:
        raise UsageError(str(missing)) from None
    comparison = Comparison("colour", "steps of 1 nm", tolerance, "ΔE2000", films.angle.size, len(reference))
    return measure(comparison, methods, lambda method: method.apply(films), error_of, progress)


DRAWS = 64
"""Number of surfaces or films drawn between the bounds: enough to hide the cost of a call."""
COLOURS = 1024
"""Colours that a call computes at least: fewer would measure the cost of the call."""


def colour_cost(
    scene: Scene,
    angle: ArrayLike | None = None,
    *,
    tolerance: float | None = None,
    methods: Sequence[Method] = COLOUR_METHODS,
    progress: Progress = quiet,
) -> Cost:
    """Measure every method of computing the colours of a film at `angle` (degrees).

    Colours are those of the CIE observer 1931 under D65, of films between the bounds of the thickness, in
    unpolarised light. `tolerance` is the mean ΔE2000 that is small enough, 0.5 by default.

    **Raises:** UsageError for a film that the methods do not compute, for a tolerance that is not above zero,
    and without colour-science.
    """
    check_tolerance(tolerance)
    own: Any = getattr(scene.light.angle, "start", scene.light.angle)
    angles = np.unique(np.atleast_1d(np.asarray(own if angle is None else angle, float)))
    with jax.enable_x64(True):
        films = films_of_scene(scene, angles)
        compared = compare_colours(films, tolerance or COLOUR_TOLERANCE, progress, methods)
    return Cost(compared, no_solvers="solvers are compared on spectra: leave the space out")


def films_of_scene(scene: Scene, angle: np.ndarray) -> Films:
    """Films of a scene's layer of many thicknesses between its bounds, at angles in degrees.

    **Raises:** UsageError for more than one thin layer on a half space, in reflection.
    """
    layer = scene.layers[0]
    if len(scene.layers) != 1 or not isinstance(layer, Layer):
        raise UsageError("methods for colours are compared on one layer; a plan is for any scene")
    if scene.light.signal != "R" or scene.substrate.back is not None:
        raise UsageError("methods for colours are compared on reflected light of a half space")
    if free_leaves((layer.material, scene.substrate.material, scene.ambient)):
        raise UsageError("methods for colours are compared on known indices: fix them")
    nm = np.arange(SPAN[0] - 1.0, SPAN[1] + 2.0)
    numbers = _tables({"": layer.material, "base_": scene.substrate.material}, nm)
    ambient = np.asarray(real(known_index(scene.ambient, nm))) * np.ones(nm.size)
    if np.ptp(ambient) > 0:
        raise UsageError("methods for colours are compared in an ambient without dispersion")
    depth: Any = layer.thickness
    low, high = (depth.lower, depth.upper) if isinstance(depth, Free) else (float(depth),) * 2
    draws = max(DRAWS, -(-COLOURS // angle.size))
    numbers["thickness"] = np.random.default_rng(0).uniform(low, high, draws)
    numbers["ambient_n"] = np.full(draws, ambient[0])
    return Films(numbers, np.deg2rad(angle), float(high))


def _tables(media: dict[str, AbstractDispersion], nm: np.ndarray, beyond: bool = False) -> dict[str, Any]:
    """n, and k where the medium absorbs, at each wavelength, by the prefix of each medium.

    With `beyond` they go on from both ends, as bands of a method may be centred there.
    """
    ends = np.array([1.0, *nm, 1e5]) if beyond else nm
    tables = {}
    for prefix, medium in media.items():
        n, k = parts(known_index(medium, nm))
        if beyond and k is not None and not np.any(np.asarray(k) > 0):
            k = None
        for key, values in (("n", n), ("k", k)):
            if values is not None:
                inside = np.broadcast_to(np.asarray(values), nm.shape)
                tables[prefix + key] = Table(ends, np.pad(inside, int(beyond), mode="edge"))
    return tables


EXACT = "steps of 1 nm"
COMPARED = (EXACT, "table of the film", "gaussians-8", "belcour-barla", "points-645-525-445")
"""Methods that are drawn, from exact to coarse."""
ROUNDS = 15


@dataclass(frozen=True)
class ColourMap:
    """Colours by one method: XYZ and ΔE2000 from the exact ones over (thicknesses, angles).

    `seconds` is the shortest time of one colour in `ROUNDS` rounds, in turns with the other methods.
    """

    name: str
    xyz: np.ndarray
    delta_e: np.ndarray
    seconds: float


def colour_maps(scene: Scene, thickness: np.ndarray, angle: np.ndarray) -> list[ColourMap]:
    """Compute the colours of a film under D65 by every method of `COMPARED` that applies to it.

    **Arguments:** a `scene` of one layer on a half space; `thickness` in nm, (thicknesses,), `angle` of
    incidence in degrees, (angles,).

    **Raises:** UsageError for more layers and for a back face, without colour-science, and where a material
    has no data between 380 and 730 nm.
    """
    films = films_of(scene, thickness, angle)
    eye, reference = sensor(*EYE), reference_program(films)
    exact = reference.run()
    if not np.all(np.isfinite(exact)):
        raise UsageError("a material has no data between 380 and 730 nm, which a colour needs")
    methods = {method.name: method.apply for method in COLOUR_METHODS}
    programs = {name: reference if name == EXACT else methods[name](films) for name in COMPARED}
    running = {name: program for name, program in programs.items() if isinstance(program, Program)}
    times: dict[str, list[float]] = {name: [] for name in running}
    for _ in range(ROUNDS):
        for name, program in running.items():
            times[name].append(program.seconds())
    colours = {name: program.run() for name, program in running.items()}
    try:
        return [
            ColourMap(name, xyz, differences(eye, exact, xyz), min(times[name]))
            for name, xyz in colours.items()
        ]
    except ImportError as missing:
        raise UsageError(str(missing)) from None


def films_of(scene: Scene, thickness: np.ndarray, angle: np.ndarray) -> Films:
    """The one layer of a scene at these thicknesses, with its indices in steps of 1 nm."""
    fixed: Any = insert(scene, start_values(scene))
    if len(fixed.layers) != 1 or not isinstance(fixed.layers[0], Layer) or fixed.substrate.back is not None:
        raise UsageError("methods are compared on one coherent layer on a half space")
    numbers: dict[str, Any] = {"thickness": np.asarray(thickness, float)}
    media = {"": fixed.layers[0].material, "base_": fixed.substrate.material, "ambient_": fixed.ambient}
    numbers |= _tables(media, sensor(*EYE).wavelength, beyond=True)
    return Films(numbers, np.deg2rad(angle), float(np.max(thickness)))
