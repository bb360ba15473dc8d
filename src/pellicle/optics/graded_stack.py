"""Response of smooth stacks of homogeneous and graded layers in NumPy.

It serves for the number of slices of graded layers, which must be known before a program is compiled. The
slices are those of `pellicle.optics.gradient`; their matrices are multiplied in pairs.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from pellicle.optics.gradient import Gradient, coefficients
from pellicle.optics.pair import Number, imag, real, sqrt


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
