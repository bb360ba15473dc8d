"""How far apart two colours look."""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp
import numpy as np


def delta_e76(one: Any, other: Any):
    """ΔE*ab (CIE 1976) of Lab values (..., 3), for fits: where they are equal its gradient is zero."""
    square = jnp.sum((jnp.asarray(one) - jnp.asarray(other)) ** 2, axis=-1)
    same = square == 0
    return jnp.where(same, 0.0, jnp.sqrt(jnp.where(same, 1.0, square)))


def delta_e2000(one: Any, other: Any) -> np.ndarray:
    """ΔE CIE 2000 of Lab values (..., 3), for reports: by colour-science, which must be installed."""
    try:
        from colour.difference import delta_E_CIE2000
    except ImportError as error:
        raise ImportError(
            "ΔE2000 needs colour-science: pip install 'pellicle[colour]' (in a clone of the repository:"
            " pip install -e '.[colour]')"
        ) from error
    return np.asarray(delta_E_CIE2000(np.asarray(one, float), np.asarray(other, float)))
