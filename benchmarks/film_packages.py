"""R and T of one film by other packages, for `film.py`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import tmm

ANGLE = 45.0
ABSORBING, SUBSTRATE = 2.9 + 0.2j, 1.52

Run = Callable[[np.ndarray, np.ndarray], Any]
"""(wavelength, thickness) → R and T, or both packed in one complex array."""


def by_tmm(wavelength: np.ndarray, thickness: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The tmm package, point by point."""
    points = np.broadcast(wavelength, thickness)
    answers = [
        tmm.unpolarized_RT([1.0, ABSORBING, SUBSTRATE], [np.inf, d, np.inf], np.deg2rad(ANGLE), w)
        for w, d in points
    ]
    shape = points.shape
    return tuple(np.array([p[key] for p in answers]).reshape(shape) for key in "RT")  # type: ignore[return-value]


def by_tmm_fast() -> Run:
    """Return tmm_fast with its own broadcasting."""
    import torch
    from tmm_fast import coh_tmm

    torch.set_num_threads(1)

    def run(wavelength, thickness):
        count, size = thickness.size, wavelength.size
        index = torch.tensor([1.0, ABSORBING, SUBSTRATE], dtype=torch.complex128)
        index = index[None, :, None].expand(count, 3, size).clone()
        depth = torch.tensor(np.stack([np.full(count, np.inf), thickness.ravel(), np.full(count, np.inf)], 1))
        theta, light = torch.tensor([np.deg2rad(ANGLE)]), torch.tensor(wavelength.ravel())
        both = [coh_tmm(p, index, depth, theta, light) for p in "sp"]
        return tuple(np.asarray(0.5 * (both[0][k] + both[1][k]))[:, 0, :] for k in "RT")  # type: ignore[return-value]

    return run


def by_tmmax() -> Run:
    """Return tmmax, float32: its function for tables under our jit and vmap over thickness."""
    from tmmax.tmm import vectorized_coh_tmm

    with jax.enable_x64(False):
        axis = jnp.array([300e-9, 900e-9])
        media = ((1.0, 0.0), (ABSORBING.real, ABSORBING.imag), (SUBSTRATE, 0.0))
        table = jnp.stack([jnp.stack([axis, n + 0 * axis, k + 0 * axis]) for n, k in media])
        theta, order = jnp.array([np.deg2rad(ANGLE)], dtype=jnp.float32), jnp.array([0, 1, 2])

    @jax.jit
    def both(light, thickness):
        def one(d):
            pairs = [
                vectorized_coh_tmm(table, order, d[None], light, theta, jnp.array([p])) for p in (False, True)
            ]
            return [0.5 * (s.reshape(-1) + p.reshape(-1)) for s, p in zip(*pairs, strict=True)]

        return jax.vmap(one)(thickness)

    def run(wavelength, thickness):
        with jax.enable_x64(False):
            nm = (jnp.asarray(x.ravel() * 1e-9, jnp.float32) for x in (wavelength, thickness))
            R, T = jax.block_until_ready(both(*nm))
        return np.asarray(R), np.asarray(T)

    return run


def by_tmm_faster() -> Run:
    """Return tmm_faster, with one call for all wavelengths of a thickness."""
    from tmm_faster import calc_coherent

    def run(wavelength, thickness):
        index = np.tile(np.array([1.0, ABSORBING, SUBSTRATE], dtype=complex), (wavelength.size, 1))
        found = [
            calc_coherent(index, [np.inf, d, np.inf], [ANGLE], wavelength.ravel()) for d in thickness.ravel()
        ]
        return tuple(
            np.stack([0.5 * (np.ravel(f[f"{k}_s"]) + np.ravel(f[f"{k}_p"])) for f in found]) for k in "RT"
        )  # type: ignore[return-value]

    return run
