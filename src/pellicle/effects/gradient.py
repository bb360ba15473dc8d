"""Number of slices of graded layers, from the measured error of the signal over the bounds."""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import Any, NamedTuple

import jax
import numpy as np

from pellicle.dispersion.base import known_index
from pellicle.dispersion.empirical import Scaled, Tabulated
from pellicle.effects.bounds import least_ambient, normal_incidence, upper
from pellicle.effects.plan import Row
from pellicle.optics.gradient import coefficients, gauss_points
from pellicle.optics.pair import imag, real, sqrt
from pellicle.scene.film import Group, Scene, groups, is_graded, with_wavelength
from pellicle.scene.free import free_leaves, insert, is_free, start_values
from pellicle.scene.graded import Graded
from pellicle.scene.layers import Layer

GRADIENT_ERROR = 1e-6
"""Error of R, T, or N, C and S that the slices may make: below the noise of any spectrum."""
COUNTS = tuple(m * 2**e for e in range(1, 11) for m in (2, 3))
"""Numbers of slices that are tried, each of which is compared with twice as many."""
_SAFETY = 2.0
"""Factor from the largest difference found to the bound: not every scene and wavelength is tried."""
_SCENES, _WAVELENGTHS = 16, 12
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
    scenes = _scenes(scene)
    measured: dict[int, Any] = {}

    def difference(count: int) -> float:
        for n in (count, 2 * count):
            if n not in measured:
                measured[n] = [_signal(numbers, n) for numbers in scenes]
        pairs = zip(measured[count], measured[2 * count], strict=True)
        return _SAFETY * max(float(np.max(np.sum(np.abs(x - y), axis=0))) for x, y in pairs)

    least = max(_least_count(numbers) for numbers in scenes)
    tried = ((n, difference(n)) for n in COUNTS if n >= min(least, COUNTS[-1]))
    found = COUNTS[-1], np.inf
    for found in tried:
        if found[1] < GRADIENT_ERROR:
            break
    count, error = found
    error = error if scene.light.signal != "psi-delta" else float(np.rad2deg(error))
    return Row("gradient", True, f"a graded layer: {count} slices of sixth order", error, count)


def _scenes(scene: Scene) -> list[Scene]:
    """The scene at a few wavelengths, with the start values and at corners of the bounds."""
    at, angle = np.asarray(scene.light.wavelength, dtype=float), scene.light.angle
    chosen = np.linspace(0, at.size - 1, _WAVELENGTHS).round().astype(int)
    chosen = np.unique([*chosen, int(np.argmin(at))])
    few = jax.tree_util.tree_map(
        lambda x: _at(x, at, chosen), scene, is_leaf=lambda x: is_free(x) or isinstance(x, Tabulated | Scaled)
    )
    few = with_wavelength(few, at[chosen], np.asarray(angle)[chosen] if np.ndim(angle) else angle)
    free = [leaf for _, leaf in free_leaves(few)]
    if 2 ** len(free) < _SCENES:
        corners = list(itertools.product(*[(f.lower, f.upper) for f in free]))
    else:
        sides = np.random.default_rng(0).integers(0, 2, (_SCENES - 1, len(free)))
        sides[0] = 1  # the thickest of all layers
        corners = [[(f.lower, f.upper)[side] for f, side in zip(free, row, strict=True)] for row in sides]
    return [insert(few, values) for values in (start_values(few), *corners)]


def _at(medium: Any, wavelength: np.ndarray, chosen: np.ndarray) -> Any:
    """A medium that is given at each wavelength, at the chosen ones; anything else as it is."""

    def part(x: Any) -> Any:
        return np.broadcast_to(np.asarray(x), wavelength.shape)[chosen]

    if isinstance(medium, Scaled):
        return replace(medium, base=_at(medium.base, wavelength, chosen), shape=part(medium.shape))
    return jax.tree_util.tree_map(part, medium) if isinstance(medium, Tabulated) else medium


def _least_count(scene: Scene) -> int:
    """Fewest slices that are thin against the wavelength and resolve the profile."""
    at, least = np.asarray(scene.light.wavelength, dtype=float), 2.0
    for layer in scene.layers:
        if isinstance(layer, Layer) and isinstance(layer.material, Graded):
            ends = [real(known_index(x, at)) for x in (layer.material.first, layer.material.second)]
            phase = 2 * np.pi / at * np.asarray(layer.thickness) * np.maximum(*ends)
            least = max(least, float(np.max(phase)) / _STEP, layer.material.profile.variations)
    return int(np.ceil(least))


def _signal(scene: Scene, count: int) -> np.ndarray:
    """Reflectances and transmittances of every group, or N, C, S and such, (quantities, wavelengths)."""
    at, light = np.asarray(scene.light.wavelength, dtype=float), scene.light
    tilt = scene.instrument.largest_half_angle(least_ambient(scene)) if scene.instrument.has_cone else 0.0
    tilt += np.deg2rad(upper(scene.instrument.angle_shift))
    angle = np.minimum(np.deg2rad(np.asarray(light.angle, dtype=float)) + tilt, 0.4999 * np.pi)
    a = real(known_index(scene.ambient, at)) * np.sin(angle)
    found = []
    for group in groups(scene)[0]:
        if any(isinstance(layer.material, Graded) for layer in group.layers):
            each = [_response(group, count, at, a, x) for x in ("s" if normal_incidence(scene) else "sp")]
            found += [power for response in each for power in response.powers]
            if light.ellipsometric:
                s, p = each[0].reflected, each[-1].reflected
                size, cross = np.abs(s) ** 2 + np.abs(p) ** 2, 2 * np.conj(p) * s
                found += [x / size for x in (np.abs(s) ** 2 - np.abs(p) ** 2, real(cross), imag(cross))]
    return np.array(found)


class _Response(NamedTuple):
    """Amplitude reflected from above, and R, T and R from below."""

    reflected: np.ndarray
    powers: tuple[np.ndarray, ...]


@np.errstate(all="ignore")
def _response(group: Group, count: int, at: np.ndarray, a: np.ndarray, polarisation: str) -> _Response:
    """Response of a smooth group: the product of the matrices of its slices, by pairs."""
    product, decay = np.eye(2)[:, :, None] + 0j * at, np.zeros_like(at)
    for layer in group.layers:
        phase, material = 2 * np.pi / at * np.asarray(layer.thickness), _numbers(layer.material)
        if isinstance(material, Graded):
            # steps go up from the substrate
            points = [_complex(material.at(z, at)) for z in gauss_points(count)[::-1]]
            phase = phase / count
        else:
            points = [_complex(known_index(layer.material, at))[None]] * 3
        alpha, beta, skew, square = coefficients(points, phase, a, polarisation)
        q = sqrt(square + 0j)
        q = np.where(q == 0, 1e-30, q)
        half = 0.5 * np.expm1(2j * phase * q)
        c, f = 1 + half, -1j * half / q
        matrices = np.array([[c + f * skew, -1j * f * alpha], [-1j * f * beta, c - f * skew]])
        decay = decay - np.sum(np.imag(q) * phase, axis=0)
        while matrices.shape[2] > 1:
            even = matrices.shape[2] // 2 * 2
            pairs = _times(matrices[:, :, :even:2], matrices[:, :, 1:even:2])
            matrices = np.concatenate([pairs, matrices[:, :, even:]], axis=2)
        product = _times(product, matrices[:, :, 0])
    above, below = (_complex(known_index(x, at)) for x in (group.above, group.below))
    q, q_ = (sqrt(n * n - a * a + 0j) for n in (above, below))
    Y, Y_ = (q, q_) if polarisation == "s" else (q / above**2, q_ / below**2)
    (A, B), (C, D) = product
    denominator = Y * (A + B * Y_) + C + D * Y_
    reflected = (Y * (A + B * Y_) - C - D * Y_) / denominator
    from_below = (Y_ * (D + B * Y) - C - A * Y) / denominator
    flux = np.where(np.real(Y) > 0, 4 * np.abs(Y) ** 2 * np.real(Y_) / np.maximum(np.real(Y), 1e-300), 0.0)
    T = flux * np.exp(2 * np.maximum(decay, -300)) / np.abs(denominator) ** 2
    return _Response(reflected, (np.abs(reflected) ** 2, T, np.abs(from_below) ** 2))


def _times(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return np.einsum("ij...,jk...->ik...", x, y)


def _numbers(material: Any) -> Any:
    """The material with its numbers as NumPy's."""
    return jax.tree_util.tree_map(lambda x: np.asarray(x)[()], material)


def _complex(index: Any) -> np.ndarray:
    return real(index) + 1j * imag(index)
