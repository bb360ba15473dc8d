"""Errors of a camera's linear channels: exposure, white balance, flare, tone curve, saturation, crosstalk."""

from collections.abc import Iterator
from itertools import permutations

import numpy as np

from pellicle.scene.uncertainty import Uncertainty


def channel_errors(
    linear: np.ndarray,
    allowed: Uncertainty,
    space: str,
    *,
    balance: float | None = None,
    coded: bool = True,
    scaled: bool = True,
    mixed: bool = True,
) -> Iterator[tuple[str, float, np.ndarray]]:
    """Errors of recorded `linear` channels (..., 3): name, standard uncertainty, change by one unit of it.

    Those of a colorimeter are its scale and balance.

    **Arguments:** the `space` of the data; `balance`, the relative standard uncertainty of the white balance
    where it is not the usual one; `coded`, False for channels that are linear as recorded; `scaled`, False
    for a free exposure; `mixed`, False where channels have no part in each other that nobody measured.
    """
    photographed = space in ("srgb", "rgb")
    if scaled:
        yield "scale", allowed.scale, linear
    stated = allowed.white_balance if photographed else allowed.scale
    size = stated if balance is None or not stated else balance
    yield "balance of red", size, linear * [1.0, 0.0, 0.0]
    yield "balance of blue", size, linear * [0.0, 0.0, 1.0]
    if photographed:
        yield "flare or black level", allowed.flare, np.ones(linear.shape)
        yield "tone curve", allowed.camera * coded, linear * np.log(np.maximum(linear, 1e-3))
    if mixed:
        yield "saturation", allowed.camera, 2 * (linear - linear.mean(axis=-1, keepdims=True))
        for i, j in permutations(range(3), 2):
            share = np.eye(3)[i] * (linear[..., j] - linear[..., i])[..., None]
            yield f"share of {'RGB'[j]} in channel {'RGB'[i]}", allowed.camera, share
