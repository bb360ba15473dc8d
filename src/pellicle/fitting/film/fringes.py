"""Thickness from the fringes alone: their period by Fourier transform, and extrema counted.

The reflectance or transmittance of a film oscillates with 2 n d cos θ / λ. Against x = 2 n cos θ / λ its
frequency is the thickness, whatever the contrast of the fringes, the lamp and the substrate. That is an
independent look at the thickness of a fit, from fewer assumptions, and less accurate.

Ψ and Δ are left out: Δ jumps at 360°, and neither is nearly a sine.

**Source:** J. Manifacier, J. Gasiot and J. Fillard, J. Phys. E 9, 1002 (1976) (extrema); T. Pisarkiewicz and
others, Thin Solid Films 138, 117 (1986) (Fourier transform).
"""

from collections.abc import Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from pellicle.fitting.film.colour_view import ColoursView
from pellicle.fitting.film.indices import indices
from pellicle.fitting.film.view import SpectrumView
from pellicle.fitting.noise import local_noise
from pellicle.fitting.problem import Problem
from pellicle.fitting.reweighting import ViewFit
from pellicle.scene.film import Scene
from pellicle.scene.free import insert, remembered
from pellicle.scene.layers import Layer

_GRID = 1024
_TRENDS = (3, 2.0), (9, 5.0)
"""Degrees of the polynomial in x that is taken for lamp and mean, and the fewest fringes beside each."""
_NOISES = 8.0
"""Amplitude of a fringe in units of its own noise, at least."""
_SHARE = 0.5
"""Share of what the trend leaves that the fringes must make up, to call them clear."""
_SWING = 0.25
"""Share of the largest swing between extrema that counts as one: where a lamp fades, noise has extrema."""
_REGULAR = 0.15
"""Scatter of the extrema around even spacing, in units of the spacing, up to which fringes are clear; and by
how much of itself their spacing may differ from the period of the Fourier transform."""
_MISSED = 0.5
"""Share of the amplitude of the fringes that the residuals keep where a model has missed them."""
_THIN = 0.1
"""Optical thickness, in the shortest wavelength, below which other layers do not matter."""


class Fringes(NamedTuple):
    """Fringes of a spectrum against x: their `thickness` in nm and its `resolution`, their `number`, and
    their complex `amplitude`."""

    thickness: float
    resolution: float
    number: float
    amplitude: complex


def phase_per_thickness(
    view: SpectrumView | ColoursView, values: np.ndarray, thickness: float
) -> np.ndarray | None:
    """x = 2 n cos θ / λ (points,) of the layer of this `thickness`, with the view's parameters at `values`.

    None where another layer is not thin, where points are of several angles, and for Ψ and Δ and colours.
    """
    if isinstance(view, ColoursView) or view.signal.ellipsometric or view.rows < 16:
        return None
    scene: Scene = insert(view.scene, list(values))
    index: Any = indices(view.scene, values)
    wavelength, rows = np.asarray(scene.light.wavelength), slice(view.rows)
    angle = np.broadcast_to(np.asarray(scene.light.angle, dtype=float), wavelength.shape)
    layers = [(n, x.thickness) for n, x in zip(index.n, scene.layers, strict=True) if isinstance(x, Layer)]
    own = [n for n, depth in layers if depth == thickness]
    others = [float(np.max(n)) * np.asarray(depth).item() for n, depth in layers if depth != thickness]
    if (
        len(layers) < len(scene.layers)
        or any(x.repeats > 1 for x in scene.layers if isinstance(x, Layer))
        or np.ptp(angle[rows]) > 0
        or len(own) != 1
        or max(others, default=0.0) >= _THIN * wavelength.min()
    ):
        return None
    sine = index.ambient * np.sin(np.deg2rad(angle))
    return (2 * np.sqrt(np.maximum(own[0] ** 2 - sine**2, 1e-6)) / wavelength)[rows]


@remembered  # the best fit asks again with the same index, where that is known
def fringes(x: np.ndarray, values: np.ndarray) -> Fringes | None:
    """The clear fringes of `values` (points,) against x (points,); None where there are none."""
    # white noise of N points leaves an amplitude of σ √(2/N), and 1.22 times that in a Hann window
    noise = 1.22 * float(np.median(local_noise(values))) * np.sqrt(2 / len(x))
    every = (_with_trend(x, values, noise, degree, fewest) for degree, fewest in _TRENDS)
    return next((found for found in every if found is not None), None)


def _with_trend(
    x: np.ndarray, values: np.ndarray, noise: float, degree: int, fewest: float
) -> Fringes | None:
    even, level = _even(x, values, degree)
    span, window = even[-1] - even[0], _window(_GRID)
    spectrum = np.fft.rfft(level * window, 8 * _GRID)
    thickness = np.arange(len(spectrum)) / (8 * _GRID * (even[1] - even[0]))
    allowed = (thickness * span >= fewest) & (thickness <= len(x) / (2.5 * span))
    if not allowed.any():
        return None
    at = float(thickness[np.argmax(np.where(allowed, np.abs(spectrum), 0.0))])
    amplitude = _amplitude(even, level, at)
    seen = abs(amplitude) > _NOISES * noise  # not so where both are 0
    if not seen or abs(amplitude) ** 2 / 2 < _SHARE * np.average(level**2, weights=window):
        return None
    spacing, scatter = _extrema(even, level, at)
    if not scatter < _REGULAR or abs(spacing * at * 2 - 1) > _REGULAR:
        return None
    return Fringes(0.5 / spacing, 0.6 / span, 0.5 / spacing * span, amplitude)


def _even(x: np.ndarray, values: np.ndarray, degree: int = 3) -> tuple[np.ndarray, np.ndarray]:
    """`_GRID` even positions and the values there, without their trend."""
    order = np.argsort(x)
    even = np.linspace(x.min(), x.max(), _GRID)
    level = np.interp(even, x[order], values[order])
    basis = _polynomials(degree)
    return even, level - basis @ (basis.T @ level)


@lru_cache
def _polynomials(degree: int) -> np.ndarray:
    """Orthonormal polynomials up to a degree at even positions, (`_GRID`, degree + 1)."""
    return np.linalg.qr(np.polynomial.chebyshev.chebvander(np.linspace(-1, 1, _GRID), degree))[0]


@lru_cache
def _window(size: int) -> np.ndarray:
    """A Hann window."""
    return np.hanning(size)


def _amplitude(even: np.ndarray, level: np.ndarray, thickness: float) -> complex:
    """Complex amplitude of a fringe of this thickness."""
    window = _window(len(level))
    return complex(2 * np.sum(window * level * np.exp(2j * np.pi * thickness * even)) / np.sum(window))


def _extrema(even: np.ndarray, level: np.ndarray, thickness: float) -> tuple[float, float]:
    """Mean spacing of neighbouring extrema, and their scatter around even spacing in units of it."""
    reach = max(int(_GRID / ((even[-1] - even[0]) * thickness) / 4), 1)
    window = _window(2 * reach + 3)[1:-1]  # half a period
    smooth = np.convolve(level, window / window.sum(), mode="valid")
    at = even[reach:-reach]
    turns = np.flatnonzero(np.diff(np.sign(np.diff(smooth))) != 0) + 1
    swing = np.abs(np.diff(smooth[turns]))
    small = np.concatenate([[-1], np.flatnonzero(swing < _SWING * swing.max(initial=0.0)), [len(swing)]])
    longest = np.argmax(np.diff(small))
    turns = turns[small[longest] + 1 : small[longest + 1] + 1]
    if len(turns) < 4:
        return np.inf, np.inf
    number = np.arange(len(turns))
    line = np.polyfit(number, at[turns], 1)
    return float(line[0]), float(np.std(at[turns] - np.polyval(line, number)) / line[0])


def proposed(problem: Problem, values: np.ndarray) -> list[float]:
    """Thicknesses (nm) that the fringes of the problem's spectra suggest, with the other parameters at
    `values` (parameters,)."""
    depth = problem.thickness_axis
    if depth is None:
        return []
    each = (_phase_and_fringes(problem, view, values, depth)[1] for view in problem.views)
    return [clear.thickness for clear in each if clear is not None]


def _phase_and_fringes(
    problem: Problem, view: SpectrumView | ColoursView, values: np.ndarray, depth: int
) -> tuple[np.ndarray, Fringes | None]:
    """x of a view at `values` (parameters,), empty where it has none, and the clear fringes of its data."""
    seen = depth in view.takes
    x = phase_per_thickness(view, problem.seen_by(view, values), values[depth]) if seen else None
    if x is None:
        return np.zeros(0), None
    return x, fringes(x, np.asarray(view.data.values)[: view.points])


def missed(problem: Problem, fits: tuple[ViewFit, ...], values: np.ndarray) -> list[Fringes | None]:
    """The clear fringes of each spectrum that the best fit, at `values`, misses; None where it misses none.

    The fit's index gives the period, so that dispersion is counted. Where the model has the fringes of the
    data, harmonics included, the residuals keep little of their amplitude.
    """
    result = []
    for view, fit in zip(problem.views, fits, strict=True):
        if (depth := problem.depth_of(view)) is None:
            result.append(None)
            continue
        x, clear = _phase_and_fringes(problem, view, values, depth)
        if clear is None or abs(clear.thickness - values[depth]) < clear.resolution:
            result.append(None)
            continue
        even, left = _even(x, (np.asarray(view.data.values) - np.asarray(fit.at.model))[: view.points])
        kept = abs(_amplitude(even, left, clear.thickness)) / abs(clear.amplitude)
        result.append(clear if kept > _MISSED else None)
    return result


def disagreement(problem: Problem, silent: Sequence[Fringes | None], values: np.ndarray) -> list[str]:
    """A sentence for each spectrum whose clear fringes the best fit misses: which thickness they suggest.

    `silent` are those `missed` at `values` (parameters,).
    """
    sentences = []
    for view, clear in zip(problem.views, silent, strict=True):
        if clear is not None:
            own, best = f"{view.name}: " if view.name else "", values[problem.depth_of(view)]
            sentences.append(
                f"{own}the period of the fringes ({clear.number:.2g} of them) suggests a thickness of"
                f" {clear.thickness:.4g} nm, the best fit has {best:.4g} nm and misses them"
            )
    return sentences
