"""Colour differences ΔE."""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float


def delta_e76(one: Any, other: Any) -> Float[Array, "..."]:
    """Return ΔE*ab (CIE 1976) of Lab values (..., 3). It is differentiable; where equal, its gradient is 0.

    >>> float(delta_e76([50.0, 3.0, 4.0], [50.0, 0.0, 0.0]))
    5.0
    """
    square = jnp.sum((jnp.asarray(one) - jnp.asarray(other)) ** 2, axis=-1)
    equal = square == 0
    return jnp.where(equal, 0.0, jnp.sqrt(jnp.where(equal, 1.0, square)))


def delta_e2000(one: Any, other: Any) -> np.ndarray:
    """Return ΔE CIE 2000 of Lab values (..., 3), by colour-science; it is not differentiable.

    **Raises:** ImportError if colour-science is not installed.
    """
    try:
        from colour.difference import delta_E_CIE2000
    except ImportError as error:
        raise ImportError(
            "ΔE2000 needs colour-science: pip install 'pellicle[colour]' (in a clone of the repository:"
            " pip install -e '.[colour]')"
        ) from error
    return np.asarray(delta_E_CIE2000(np.asarray(one, float), np.asarray(other, float)))
