"""Residuals of BRDF samples by name: the scale on which values that span decades are compared.

- `linear`: ρ. The mirror peak dominates; right where σ is known.
- `cosine`: ρ cos θ_i (A. Ngan, F. Durand and W. Matusik, EGSR 2005).
- `log`: log(1 + ρ cos θ_i), as neural BRDFs are trained.
- `cube-root`: ρ^⅓, nearest to perceived lightness (the default without σ).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp

Transform = Callable[[Any, Any, Any], Any]
"""(ρ, cos θ_i, floor) → the number that is compared; `floor` (1/sr) keeps slopes finite at ρ = 0."""

RESIDUALS: dict[str, Transform] = {
    "linear": lambda rho, cosine, floor: rho,
    "cosine": lambda rho, cosine, floor: rho * cosine,
    "log": lambda rho, cosine, floor: jnp.log1p(rho * cosine),
    "cube-root": lambda rho, cosine, floor: jnp.cbrt(rho + floor),
}

INVERSES: dict[str, Transform] = {
    "linear": lambda compared, cosine, floor: compared,
    "cosine": lambda compared, cosine, floor: compared / cosine,
    "log": lambda compared, cosine, floor: jnp.expm1(compared) / cosine,
    "cube-root": lambda compared, cosine, floor: compared**3 - floor,
}
"""(number that is compared, cos θ_i, floor) → ρ."""


def slope(transform: Transform, rho: Any, cosine: Any, floor: Any) -> Any:
    """d transform/dρ at each value."""
    return jax.jvp(lambda x: transform(x, cosine, floor), (rho,), (jnp.ones_like(rho),))[1]
