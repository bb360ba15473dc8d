"""Extremes over the bounds of a scene: indices, thicknesses, |q|, and the difference of two plans."""

import itertools
import statistics
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from pellicle.dispersion.anisotropic import isotropic_in_plane, principal_media
from pellicle.dispersion.base import AbstractDispersion, known_index
from pellicle.dispersion.empirical import Tabulated
from pellicle.forward_model import film_signal
from pellicle.forward_model.elementary_signal import by_numpy, is_elementary
from pellicle.forward_model.plan import Plan
from pellicle.optics import interface, orders
from pellicle.optics.pair import Number, abs2, imag, real
from pellicle.scene.film import Scene, groups
from pellicle.scene.free import Free, free_leaves, insert, start_values, without_bounds


def normal_incidence(scene: Scene) -> bool:
    """True where the axis of the light is provably normal to the layers."""
    angle = scene.light.angle
    zero = not isinstance(angle, Free) and np.ndim(angle) == 0 and float(angle) == 0.0
    return zero and scene.instrument.angle_shift is None


def least_ambient(scene: Scene) -> float:
    """The ambient's smallest index at the light's wavelengths."""
    ambient = insert(scene.ambient, start_values(scene.ambient))
    return float(np.min(real(known_index(ambient, np.atleast_1d(scene.light.wavelength)))))


def upper(number: Any) -> float:
    """The largest value of a number, or of the bounds of a free one; 0 for None."""
    return float(number.upper if isinstance(number, Free) else number or 0.0)


def largest_index(material: AbstractDispersion, wavelength: np.ndarray) -> float:
    """The largest real index at these wavelengths (nm) over the corners of the bounds (at most 64)."""
    return max(float(np.nanmax(np.real(_corner_indices(m, wavelength)))) for m in principal_media(material))


def smallest_index(material: AbstractDispersion, wavelength: np.ndarray) -> float:
    """The smallest real index likewise, but at least 0.1: a metal has no fringes to count."""
    least = min(float(np.nanmin(np.real(_corner_indices(m, wavelength)))) for m in principal_media(material))
    return max(least, 0.1)


def largest_attenuation(material: AbstractDispersion, thickness: Any, scene: Scene) -> float:
    """The largest attenuation of a wave in a layer over the corners of the bounds, as an exponent of its
    amplitude; infinite where a wave may be evanescent.

    An estimate: waves of an anisotropic medium count as those of isotropic media between its principal ones.
    """
    if scene.light.wavelength is None or free_leaves(scene.ambient):
        return np.inf
    wavelength = np.atleast_1d(np.asarray(scene.light.wavelength, dtype=float))
    degrees = upper(scene.light.angle) if isinstance(scene.light.angle, Free) else scene.light.angle
    steepest = np.deg2rad(np.asarray(degrees) + upper(scene.instrument.angle_shift))
    if scene.instrument.has_cone:
        steepest = steepest + scene.instrument.largest_half_angle(least_ambient(scene))
    sine = np.sin(np.minimum(steepest, np.pi / 2))
    a = real(known_index(scene.ambient, wavelength)) * sine
    indices = np.concatenate([_corner_indices(m, wavelength) for m in principal_media(material)])
    least = np.min(np.real(indices), axis=0)
    if not np.all(least > 1.01 * a):
        return np.inf
    most_n, most_k = np.max(np.real(indices), axis=0), np.max(np.imag(indices), axis=0)
    extinction = most_n * most_k / np.sqrt(least**2 - a**2)
    return float(np.max(2 * np.pi / wavelength * upper(thickness) * extinction))


def _corner_indices(material: AbstractDispersion, wavelength: np.ndarray) -> np.ndarray:
    """Complex indices (corners, wavelengths)."""

    def row(index: Number) -> np.ndarray:
        return np.broadcast_to(np.asarray(real(index)) + 1j * np.asarray(imag(index)), wavelength.shape)

    if isinstance(material, Tabulated):
        return row(material.value)[None]
    return np.stack([row(known_index(insert(material, x), wavelength)) for x in _corners(material)])


def largest_ratio(scene: Scene) -> float:
    """The largest |q| = |r₁₂ r₂₃| over the bounds.

    An estimate, not a proof: the largest of the corners (at most 64) and the start values, times 1.05.
    """
    return 1.05 * max(_ratio(insert(scene, values)) for values in [*_corners(scene), start_values(scene)])


def _corners(scene: Any) -> list[tuple[float, ...]]:
    """Corners of the bounds of the free numbers of a scene or of a part of it, the first 64."""
    bounds = [(leaf.lower, leaf.upper) for _, leaf in free_leaves(scene)]
    return [*itertools.islice(itertools.product(*bounds), CORNERS)]


def _ratio(scene: Scene) -> float:
    nm = np.asarray(scene.light.wavelength, dtype=float)
    group = next(group for group in groups(scene)[0] if group.layers)
    media = (group.above, group.layers[0].material, group.below)
    above, layer, below = (medium.index(nm) for medium in media)
    squares, shift = [], upper(scene.instrument.angle_shift)
    # None is normal incidence
    oblique = None if normal_incidence(scene) else np.deg2rad(np.asarray(scene.light.angle + shift))
    angles: list[Any] = [oblique]
    if scene.instrument.has_cone:
        half = scene.instrument.largest_half_angle(least_ambient(scene))
        angles.append(np.minimum(half + (0.0 if oblique is None else oblique), np.pi / 2))
    for angle in angles:
        a, _ = interface.transverse(scene.ambient.index(nm), angle)
        inside = None if angle is None else interface.Inside(a)
        for polarisation in "s" if angle is None and all(map(isotropic_in_plane, media)) else "sp":
            b = orders.airy_series(above, layer, below, 0.0 * nm, inside, polarisation)
            squares.append(np.asarray(abs2(b.upper * b.lower)))
    return float(np.sqrt(np.nanmax(np.stack(squares))))


Build = Callable[[Plan], Callable[[Any], Any]]
"""A plan → its forward model: `build` of `forward_model.film_signal` or `forward_model.surface_signal`."""

POINTS = 256
CORNERS = 64
_BATCH = 16
_BY_NUMPY = 2**18
"""Values of a signal up to which NumPy takes less time than the compilation of a program."""
TIMING_SECONDS, FEWEST_ROUNDS = 0.3, 5
"""Seconds for which plans are timed in turns, and the least number of rounds."""


def design(scene: Any) -> np.ndarray:
    """Points within the bounds at which plans are compared, (points, parameters).

    They are the corners of the bounds (at most 64), the start values, and 256 points of a Sobol sequence;
    without free parameters one point, the scene itself.
    """
    free = [leaf for _, leaf in free_leaves(scene)]
    if not free:
        return np.zeros((1, 0))
    from scipy.stats import qmc  # slow to import

    lower, upper = (np.array([getattr(f, side) for f in free]) for side in ("lower", "upper"))
    corners = _corners(scene)
    between = qmc.Sobol(len(free), rng=np.random.default_rng(0)).random(POINTS)
    start = np.tile(start_values(scene), (_BATCH - len(corners) % _BATCH, 1))  # whole batches compile faster
    return np.concatenate([corners, start, lower + between * (upper - lower)])


class Evaluation(NamedTuple):
    """Simulations of one scene at the points of a design, by any plan.

    `scene` has its media evaluated where possible. Signals are divided by `scale`, which broadcasts to
    (points, values).
    """

    build: Build
    scene: Any
    points: np.ndarray
    scale: Any = 1.0

    def signals(self, plan: Plan) -> np.ndarray:
        """Signal of a plan at each point, (points, values)."""
        return signals(plan, self.scene, self.points, self.build) / self.scale

    def seconds(self, plans: Sequence[Plan]) -> list[float]:
        """Median time of an evaluation by each plan, all points in one call, as in a fit's scan.

        The plans take turns, so that other processes affect all of them.
        """
        structure, *numbers = _split(self.scene, self.points)
        numbers = jax.device_put(numbers)
        known = False, structure, *numbers
        runs = [partial(_signals, self.build, plan.static_key, *known) for plan in plans]
        times: list[list[float]] = [[] for _ in runs]
        jax.block_until_ready([run() for run in runs])  # compiles
        end = time.perf_counter() + TIMING_SECONDS
        while len(times[0]) < FEWEST_ROUNDS or time.perf_counter() < end:
            for run, some in zip(runs, times, strict=True):
                began = time.perf_counter()
                run().block_until_ready()
                some.append((time.perf_counter() - began) / len(self.points))
        return [statistics.median(some) for some in times]

    def slope_change(self, one: Plan, other: Plan, count: int) -> float:
        """Largest difference of derivatives between two plans at the last `count` points, relative to the
        largest derivative of each parameter by the first plan; 0 if nothing is free."""
        if not self.points.shape[1]:
            return 0.0
        last = self.points[-count:]
        first, second = (gradients(plan, self.scene, last, self.build) for plan in (one, other))
        apart, size = (np.max(np.abs(x), axis=(0, 1), initial=0.0) for x in (first - second, first))
        return float(np.max(apart / np.where(size > 0, size, 1.0), initial=0.0))


def signals(plan: Plan, scene: Any, points: np.ndarray, build: Build) -> np.ndarray:
    """Signal at each point, (points, values): for a film its wavelengths, for ellipsometry N, C and S of
    each wavelength (and ratio), for a surface the channels of each pair of directions."""
    of_film = build is film_signal.build and is_elementary(plan)
    if of_film and len(points) * np.size(scene.light.wavelength) <= _BY_NUMPY:
        return by_numpy(plan, scene, points)
    return np.asarray(_signals(build, plan.static_key, False, *_split(scene, points)), dtype=float)


def gradients(plan: Plan, scene: Any, points: np.ndarray, build: Build) -> np.ndarray:
    """Derivatives of the signal in the free parameters at each point, (points, values, parameters)."""
    return np.asarray(_signals(build, plan.static_key, True, *_split(scene, points)), dtype=float)


def largest_difference(one: np.ndarray, other: np.ndarray, degrees: bool) -> float:
    """Largest difference of two arrays of signals, in the unit of the signal.

    In `degrees` it is the arc between two points (N, C, S). Infinite where one of the
    signals is not a number.
    """
    apart = np.abs(one - other)
    if degrees:
        apart = np.rad2deg(np.linalg.norm(apart.reshape(-1, 3), axis=1))
    return float(np.max(np.where(np.isfinite(apart), apart, np.inf), initial=0.0))


def _split(scene: Any, points: np.ndarray) -> tuple[Any, list[Any], np.ndarray]:
    """The static argument of a program, the structure of a scene without bounds, and its numbers."""
    fixed, structure = jax.tree_util.tree_flatten(without_bounds(scene))
    return structure, fixed, points


@partial(jax.jit, static_argnums=(0, 1, 2, 3))
def _signals(build: Build, plan: Plan, derive: bool, structure: Any, fixed: list, points: Any) -> Any:
    """Signals, or their derivatives in the free numbers, a few points at a time: a cone of light over a long
    spectrum would not fit into memory at once."""
    simulate, scene = build(plan), jax.tree_util.tree_unflatten(structure, fixed)

    def signal(values: Any) -> Any:
        return jnp.ravel(simulate(insert(scene, list(values))))

    function = jax.jacfwd(signal) if derive else signal
    return jax.lax.map(function, points, batch_size=min(_BATCH, len(points)))


class Saving(NamedTuple):
    """Effect of leaving something out: its error in the unit of the signal, and the seconds it saves."""

    error: float
    seconds: float


class Savings(NamedTuple):
    """The saving of each effect, and the seconds of one evaluation of the exact plan and of the planned one.

    A saving below a few per cent of `exact` is noise, and may be negative.
    """

    effects: dict[str, Saving]
    exact: float
    planned: float


def measured(full: Plan, chosen: Plan, cheaper: Mapping[str, list[Plan]], evaluation: Evaluation) -> Savings:
    """Savings compared with the `full` plan; `cheaper` has at most one plan for each effect."""
    others = {effect: plan for effect, plans in cheaper.items() for plan in plans}
    exact = evaluation.signals(full)
    errors = [largest_difference(evaluation.signals(plan), exact, full.degrees) for plan in others.values()]
    whole, planned, *times = evaluation.seconds([full, chosen, *others.values()])
    each = zip(others, errors, times, strict=True)
    return Savings({effect: Saving(error, whole - time) for effect, error, time in each}, whole, planned)
