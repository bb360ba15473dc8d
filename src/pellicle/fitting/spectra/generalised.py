"""Generalised Ψ and Δ in a fit: channels, noise and systematic effects of each ratio.

Each ratio is a point N, C, S on a sphere of its own. Without σ the channels are N, C, S of the first ratio,
then of the next. With σ they are directions: of each ratio that along Ψ and that along Δ, and behind these
the direction outwards of each, in which nothing is measured.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from pellicle.fitting.discrepancy import Effect
from pellicle.fitting.problem import NoiseGroup
from pellicle.scene.uncertainty import Uncertainty

CHANNELS = 3
"""N, C and S."""


def positions(ratios: Sequence[int]) -> tuple[int, ...]:
    """Return the positions of N, C, S of some ratios among those of all three."""
    return tuple(CHANNELS * ratio + i for ratio in ratios for i in range(CHANNELS))


def in_directions(each: Float[np.ndarray, "points ratios 3"]) -> Float[np.ndarray, "points channels"]:
    """Return the channels, of numbers along Ψ, along Δ and outwards of each ratio."""
    return np.concatenate([each[..., :2].reshape(len(each), -1), each[..., 2]], axis=1)


def block_frame(
    frames: Float[np.ndarray, "points ratios 3 3"],
) -> Float[np.ndarray, "points channels channels"]:
    """Return the frame of all ratios, of the frame of each."""
    points, count = frames.shape[:2]
    size = CHANNELS * count
    whole = np.zeros((points, size, size))
    for i in range(count):
        rows = [2 * i, 2 * i + 1, 2 * count + i]
        whole[:, rows, CHANNELS * i : CHANNELS * (i + 1)] = frames[:, i]
    return whole


def noise_groups(count: int, known: bool, framed: bool, points: int) -> tuple[NoiseGroup, ...]:
    """Return the channels of each of `count` ratios, of which two of three are independent."""
    if framed:
        each = [(2 * i, 2 * i + 1, 2 * count + i) for i in range(count)]
    else:
        each = [tuple(range(CHANNELS * i, CHANNELS * (i + 1))) for i in range(count)]
    return tuple(NoiseGroup(channels, known, 2 * points) for channels in each)


def sphere_tangent(
    sphere: Float[np.ndarray, "*points ratios 3"], change: Float[np.ndarray, "*points ratios 3"]
) -> Float[np.ndarray, "*points ratios 3"]:
    """Return a change of N, C, S of each ratio without its part outwards."""
    return change - sphere * np.sum(change * sphere, axis=-1, keepdims=True)


def offsets(
    names: Sequence[str], sphere: Float[np.ndarray, "*points ratios 3"], allowed: Uncertainty
) -> list[Effect]:
    """Return offsets of Ψ and of Δ of each ratio, as changes of its N, C, S (..., ratios, 3)."""
    n, c, s = np.moveaxis(sphere, -1, 0)
    sine = np.maximum(np.hypot(c, s), 1e-9)
    along = 2 * np.deg2rad(allowed.psi) * np.stack([-sine, n * c / sine, n * s / sine], axis=-1)
    across = np.deg2rad(allowed.delta) * np.stack([0 * n, -s, c], axis=-1)
    result = []
    for i, name in enumerate(names):
        for angle, size, every in (("psi", allowed.psi, along), ("delta", allowed.delta, across)):
            if size:
                change = np.zeros(sphere.shape)
                change[..., i, :] = every[..., i, :]
                result.append(Effect(f"offset of {angle} of {name}", size, "deg", change, shared=False))
    return result
