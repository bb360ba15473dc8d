"""Generalised Ψ and Δ in a fit: channels, noise and systematic effects of each ratio.

Each ratio is a point N, C, S on a sphere of its own. The channels are directions on it: two of each ratio,
and behind these the direction outwards of each, in which nothing is measured.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from pellicle.fitting.discrepancy import Effect
from pellicle.fitting.problem import NoiseGroup
from pellicle.scene.layers import Uncertainty

CHANNELS = 3
"""N, C and S."""
_ALIKE = 1.5
"""Largest ratio of errors that are alike."""
_POLE = 4.0
"""Standard deviations of Ψ from 0 or 90 degrees within which Δ is mostly noise."""


def positions(ratios: Sequence[int]) -> tuple[int, ...]:
    """Return the positions of N, C, S of some ratios among those of all three."""
    return tuple(CHANNELS * ratio + i for ratio in ratios for i in range(CHANNELS))


def upright(
    frames: Float[np.ndarray, "points ratios 3 3"],
    sigma: Float[np.ndarray, "points ratios 3"],
    psi: Float[np.ndarray, "points ratios"],
    delta: Float[np.ndarray, "points ratios"],
) -> tuple[Float[np.ndarray, "points ratios 3 3"], Float[np.ndarray, "points ratios 3"]]:
    """Return frames along Ψ and Δ, and σ in them, turned so that they do not turn with Δ.

    Where a ratio is nearly 0 its Δ is noise, and the direction along Ψ is that of the noise itself: residuals
    in it are all of one sign. The directions of C and S have no such sense. Frames are turned where the
    errors of both directions are alike, or where Ψ is within its noise of 0 or 90 degrees; they share one σ
    then.
    """
    along, across = sigma[..., 0], sigma[..., 1]
    pole = np.sin(2 * np.deg2rad(psi)) < _POLE * along
    alike = pole | (np.abs(np.log(across / along)) < np.log(_ALIKE))
    turn = np.deg2rad(np.where(alike, np.where(psi < 45, delta, -delta), 0.0))[..., None]
    one, other = frames[..., 0, :], frames[..., 1, :]
    turned = np.cos(turn) * one - np.sin(turn) * other, np.sin(turn) * one + np.cos(turn) * other
    shared = np.where(alike[..., None], np.sqrt((along**2 + across**2) / 2)[..., None], sigma)
    return np.stack([*turned, frames[..., 2, :]], axis=-2), shared


def in_directions(each: Float[np.ndarray, "points ratios 3"]) -> Float[np.ndarray, "points channels"]:
    """Return the channels, of numbers in two directions and outwards of each ratio."""
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


def noise_groups(count: int, known: bool, points: int) -> tuple[NoiseGroup, ...]:
    """Return the channels of each of `count` ratios, of which two of three are independent."""
    each = [(2 * i, 2 * i + 1, 2 * count + i) for i in range(count)]
    return tuple(NoiseGroup(channels, known, 2 * points) for channels in each)


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
