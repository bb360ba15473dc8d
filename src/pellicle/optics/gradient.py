"""Graded layers: their slices, each of which is integrated to sixth order in its thickness.

In a layer whose index varies with depth the fields obey u′ = i k₀ [[0, α], [β, 0]] u with α = 1, β = ε − a²
for s and α = ε, β = 1 − a²/ε for p. Magnus' expansion with three Gauss points in a slice of thickness h gives
the fields at its far face, in steps against the light, from those at its near face by exp Ω with

    Ω = −i k₀h [[ig, ᾱ], [β̄, −ig]].

ᾱ and β̄ are means, corrected by products of the differences between the points, and g is a commutator. Ω is
traceless and its square is −(k₀h)² Q with Q = ᾱβ̄ − g². So exp Ω has the elements c and f of a homogeneous
layer (`pellicle.optics.characteristic`) with this Q, and c ± fg on its diagonal. It has determinant 1 and
conserves energy where nothing absorbs. A homogeneous slice has ᾱ = α, β̄ = β and g = 0.

Source: Blanes, Casas, Oteo and Ros, Physics Reports 470, 151 (2009), section 5.4 (sixth order).

`stack_response` computes stacks in NumPy: the number of slices must be known before a program is compiled. It
multiplies the matrices of the slices in pairs.
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from pellicle.optics.interface import normal_square
from pellicle.optics.pair import Number, imag, real, sqrt

OFFSET = math.sqrt(0.15)
"""Distance of the outer Gauss points from the middle of a slice, in slices."""


class Gradient(NamedTuple):
    """Refractive index at the three Gauss points of each slice of a graded layer, in the order of depth.

    Slices are along the first axis of each array.
    """

    first: Number
    middle: Number
    last: Number

    @property
    def slices(self) -> int:
        """Number of slices."""
        return jnp.shape(jax.tree_util.tree_leaves(self)[0])[0]


def gauss_points(count: int) -> np.ndarray:
    """Return relative depths 0 to 1 of the Gauss points of each slice, (3, slices)."""
    middle = (np.arange(count) + 0.5) / count
    return np.stack([middle - OFFSET / count, middle, middle + OFFSET / count])


def is_graded(layers: Sequence[Any]) -> bool:
    """True where a layer is a `Gradient`."""
    return any(isinstance(layer, Gradient) for layer in layers)


class Coefficients(NamedTuple):
    """ᾱ, β̄, g and Q of a slice."""

    alpha: Any
    beta: Any
    skew: Any
    square: Any


def coefficients(points: Sequence[Any], depth: Any, a: Any, weights: Sequence[Any]) -> Coefficients:
    """Return the coefficients of a slice from its index at three Gauss points, in the order of the steps.

    **Arguments:** `depth`, k₀h of the slice; `a`, the transverse index; `weights` at the points, 1 for s and
    ε for p.
    """
    first, middle, last = (
        _Coupling(e, normal_square(n, a) / e) for n, e in zip(points, weights, strict=True)
    )
    slope = _combined((math.sqrt(15) / 3, last), (-math.sqrt(15) / 3, first))
    bend = _combined((10 / 3, last), (-20 / 3, middle), (10 / 3, first))
    square = depth * depth
    twist = square * _commutator(middle, slope)
    turn = square * _commutator(middle, bend) * (-1 / 30)
    outer = _combined((-20, middle), (-1, bend))
    inner = _Coupling(slope.alpha + middle.alpha * twist / 30, slope.beta - middle.beta * twist / 30)
    alpha = middle.alpha + bend.alpha / 12 + (inner.alpha * twist - outer.alpha * turn) / 120
    beta = middle.beta + bend.beta / 12 + (outer.beta * turn - inner.beta * twist) / 120
    skew = depth * _commutator(outer, inner) / 240
    return Coefficients(alpha, beta, skew, alpha * beta - skew * skew)


class _Coupling(NamedTuple):
    """α and β at a point, or a combination of them: −i[[0, α], [β, 0]]."""

    alpha: Any
    beta: Any


def _combined(*terms: tuple[float, _Coupling]) -> _Coupling:
    return _Coupling(sum(w * x.alpha for w, x in terms), sum(w * x.beta for w, x in terms))


def _commutator(x: _Coupling, y: _Coupling) -> Any:
    """The upper element of the diagonal commutator of two couplings; the lower one is its negative."""
    return y.alpha * x.beta - x.alpha * y.beta


def faces(gradient: Sequence[Any]) -> tuple[Any, Any]:
    """Return the index at the near and the far face of each slice: the parabola through its Gauss points."""
    first, middle, last = gradient
    reach = 0.5 / OFFSET
    slope, bend = 0.5 * reach * (last - first), 0.5 * reach * reach * (last - 2 * middle + first)
    return middle - slope + bend, middle + slope + bend


class StackResponse(NamedTuple):
    """Amplitude reflected from above, and R, T and R from below."""

    reflected: np.ndarray
    powers: tuple[np.ndarray, ...]


@np.errstate(all="ignore")
def stack_response(
    above: Number,
    layers: Sequence[Number | Gradient],
    below: Number,
    phases: Sequence[np.ndarray],
    a: np.ndarray,
    polarisation: str,
) -> StackResponse:
    """Return the response of a smooth stack.

    **Arguments:** numbers are indices, each a number or an array (wavelengths,).

    - `layers`: from the ambient down; arrays of a `Gradient` have the slices first, in the order of depth.
    - `phases`: k₀d of each layer, (wavelengths,).
    - `a`: transverse index, (wavelengths,).
    - `polarisation`: "s" or "p".
    """
    product, decay = np.eye(2)[:, :, None] + 0j * a, np.zeros_like(a)
    for layer, phase in zip(layers, phases, strict=True):
        if isinstance(layer, Gradient):
            # the steps in a slice go up from the substrate
            points = [_complex(point) for point in layer[::-1]]
            phase = phase / layer.slices
        else:
            points = [np.broadcast_to(_complex(layer), a.shape)[None]] * 3
        alpha, beta, skew, square = coefficients(
            points, phase, a, [1.0 if polarisation == "s" else n * n for n in points]
        )
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
    above, below = _complex(above), _complex(below)
    q, q_ = (sqrt(n * n - a * a + 0j) for n in (above, below))
    Y, Y_ = (q, q_) if polarisation == "s" else (q / above**2, q_ / below**2)
    (A, B), (C, D) = product
    denominator = Y * (A + B * Y_) + C + D * Y_
    reflected = (Y * (A + B * Y_) - C - D * Y_) / denominator
    from_below = (Y_ * (D + B * Y) - C - A * Y) / denominator
    flux = np.where(np.real(Y) > 0, 4 * np.abs(Y) ** 2 * np.real(Y_) / np.maximum(np.real(Y), 1e-300), 0.0)
    T = flux * np.exp(2 * np.maximum(decay, -300)) / np.abs(denominator) ** 2
    return StackResponse(reflected, (np.abs(reflected) ** 2, T, np.abs(from_below) ** 2))


def _times(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return np.einsum("ij...,jk...->ik...", x, y)


def _complex(index: Any) -> np.ndarray:
    return real(index) + 1j * imag(index)
