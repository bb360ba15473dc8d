"""Number of slices of graded layers, from the measured error of the signal over the bounds."""

import itertools
from collections.abc import Iterable
from dataclasses import replace
from functools import cache
from typing import Any

import jax
import numpy as np

from pellicle.dispersion.base import known_index
from pellicle.dispersion.empirical import Scaled, Tabulated
from pellicle.effects.differences import least_ambient, normal_incidence, upper
from pellicle.forward_model.plan import Row
from pellicle.optics.gradient import Gradient, gauss_points, stack_response
from pellicle.optics.pair import imag, real
from pellicle.scene.film import Scene, groups, is_graded, with_wavelength
from pellicle.scene.free import free_leaves, insert, is_free, remembered, start_values
from pellicle.scene.graded import Graded
from pellicle.scene.layers import Layer

GRADIENT_ERROR = 1e-6
"""Error of R, T, or N, C and S that the slices may make: below the noise of any spectrum."""
COUNTS = tuple(m * 2**e for e in range(1, 11) for m in (2, 3))
"""Numbers of slices that are tried, each of which is compared with twice as many."""
_SAFETY = 4.0
"""Factor from the largest difference found to the bound: not every scene and wavelength is tried."""
_CORNERS, _WAVELENGTHS = 16, 12
"""Corners of the bounds, and wavelengths, at which numbers of slices are first tried."""
_INSIDE, _MORE_WAVELENGTHS = 48, 48
"""Random points between the bounds, and wavelengths, at which the error of a number is then measured. Without
them, 5 of 720 random scenes exceeded their stated error, one of them 26 times (`benchmarks/slices.py`)."""
_STEP = 2.0
"""Largest k₀nh of a slice that is worth a trial: Magnus' expansion converges below about π."""


def gradient(scene: Scene) -> Row:
    """On where a layer is graded: the number of slices of each, and the error that they make.

    **Raises:** ValueError where the light has no wavelengths.
    """
    if not is_graded(scene):
        return Row("gradient", False, "no layer is graded")
    if scene.light.wavelength is None:
        raise ValueError("the number of slices depends on the wavelengths: give the light its wavelengths")
    return _measured(scene)


@remembered
def _measured(scene: Scene) -> Row:
    """The row of a scene with a graded layer. The plan of one scene is asked for a dozen times."""
    few, many = _scenes(scene, _WAVELENGTHS, 0), _scenes(scene, _MORE_WAVELENGTHS, _INSIDE)

    @cache
    def signals_of_few(count: int) -> list[np.ndarray]:
        return [signals(numbers, count) for numbers in few]

    def tried(count: int) -> float:
        return _largest(zip(signals_of_few(count), signals_of_few(2 * count), strict=True))

    def measured(count: int) -> float:
        return _largest((signals(numbers, count), signals(numbers, 2 * count)) for numbers in many)

    nm, least = np.asarray(few[0].light.wavelength, dtype=float), 2.0
    for layer in (layer for numbers in few for layer in _graded_layers(numbers)):
        # slices that are thin against the wavelength and resolve the profile
        ends = [real(known_index(x, nm)) for x in (layer.material.first, layer.material.second)]
        phase = 2 * np.pi / nm * np.asarray(layer.thickness) * np.maximum(*ends)
        least = max(least, float(np.max(phase)) / _STEP, layer.material.profile.variations)
    counts = [n for n in COUNTS if n >= min(int(np.ceil(least)), COUNTS[-1])]
    count, error = COUNTS[-1], np.inf
    for count in counts:
        error = tried(count) if count != counts[-1] else 0.0
        error = measured(count) if error < GRADIENT_ERROR else error
        if error < GRADIENT_ERROR:
            break
    error = float(np.rad2deg(error)) if scene.light.kind.degrees else error
    what = "a graded layer"
    if not normal_incidence(scene) and any(map(_passes_zero, few)):
        what += " whose Re ε passes 0, where p converges slowly"
    return Row("gradient", True, f"{what}: {count} slices of sixth order", error, count)


def _graded_layers(scene: Scene) -> list[Any]:
    return [x for x in scene.layers if isinstance(x, Layer) and isinstance(x.material, Graded)]


def _passes_zero(scene: Scene) -> bool:
    """True where the real part of the permittivity has both signs in a graded layer."""
    nm = np.asarray(scene.light.wavelength, dtype=float)
    for layer in _graded_layers(scene):
        index = _layer(layer, 32, nm).middle
        square = real(index) ** 2 - imag(index) ** 2
        if np.any((np.min(square, axis=0) < 0) & (np.max(square, axis=0) > 0)):
            return True
    return False


def _largest(pairs: Iterable[tuple[np.ndarray, np.ndarray]]) -> float:
    return _SAFETY * max(float(np.max(np.sum(np.abs(x - y), axis=0))) for x, y in pairs)


def _scenes(scene: Scene, wavelengths: int, inside: int) -> list[Scene]:
    """The scene at a few wavelengths, with the start values, at corners of the bounds and between them."""
    nm, angle = np.asarray(scene.light.wavelength, dtype=float), scene.light.angle
    chosen = np.linspace(0, nm.size - 1, wavelengths).round().astype(int)
    chosen = np.unique([*chosen, int(np.argmin(nm))])
    few = jax.tree_util.tree_map(
        lambda x: _at(x, nm, chosen), scene, is_leaf=lambda x: is_free(x) or isinstance(x, Tabulated | Scaled)
    )
    few = with_wavelength(few, nm[chosen], np.asarray(angle)[chosen] if np.ndim(angle) else angle)
    free = [leaf for _, leaf in free_leaves(few)]
    rng = np.random.default_rng(0)
    if 2 ** len(free) < _CORNERS:
        points = list(itertools.product(*[(f.lower, f.upper) for f in free]))
    else:
        sides = rng.integers(0, 2, (_CORNERS - 1, len(free)))
        sides[0] = 1  # the thickest of all layers
        points = [[(f.lower, f.upper)[side] for f, side in zip(free, row, strict=True)] for row in sides]
    if free:
        points += [[rng.uniform(f.lower, f.upper) for f in free] for _ in range(inside)]
    return [insert(few, values) for values in (start_values(few), *points)]


def _at(medium: Any, wavelength: np.ndarray, chosen: np.ndarray) -> Any:
    """A medium that is given at each wavelength, at the chosen ones; anything else as it is."""

    def part(x: Any) -> Any:
        return np.broadcast_to(np.asarray(x), wavelength.shape)[chosen]

    if isinstance(medium, Scaled):
        return replace(medium, base=_at(medium.base, wavelength, chosen), shape=part(medium.shape))
    return jax.tree_util.tree_map(part, medium) if isinstance(medium, Tabulated) else medium


def signals(scene: Scene, count: int) -> np.ndarray:
    """Reflectances and transmittances of every group, or N, C, S and such, (quantities, wavelengths)."""
    nm, light = np.asarray(scene.light.wavelength, dtype=float), scene.light
    tilt = scene.instrument.largest_half_angle(least_ambient(scene)) if scene.instrument.has_cone else 0.0
    tilt += np.deg2rad(upper(scene.instrument.angle_shift))
    angle = np.minimum(np.deg2rad(np.asarray(light.angle, dtype=float)) + tilt, 0.4999 * np.pi)
    a = real(known_index(scene.ambient, nm)) * np.sin(angle)
    values = []
    for group in groups(scene)[0]:
        if any(isinstance(layer.material, Graded) for layer in group.layers):
            layers = [_layer(layer, count, nm) for layer in group.layers]
            phases = [2 * np.pi / nm * np.asarray(layer.thickness) for layer in group.layers]
            above, below = known_index(group.above, nm), known_index(group.below, nm)
            each = [
                stack_response(above, layers, below, phases, a, x)
                for x in ("s" if normal_incidence(scene) else "sp")
            ]
            values += [power for response in each for power in response.powers]
            if light.ellipsometric:
                s, p = each[0].reflected, each[-1].reflected
                size, cross = np.abs(s) ** 2 + np.abs(p) ** 2, 2 * np.conj(p) * s
                values += [x / size for x in (np.abs(s) ** 2 - np.abs(p) ** 2, real(cross), imag(cross))]
    return np.array(values)


def _layer(layer: Layer, count: int, nm: np.ndarray) -> Any:
    """Index of a layer at the wavelengths, of a graded one at the points of its slices."""
    # a number of JAX would be computed by JAX, op by op
    material: Any = jax.tree_util.tree_map(lambda x: np.asarray(x)[()], layer.material)
    if isinstance(material, Graded):
        return Gradient(*(material.at(z, nm) for z in gauss_points(count)))
    return known_index(material, nm)
