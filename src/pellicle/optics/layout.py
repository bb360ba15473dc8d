"""Layout of arrays that XLA's CPU backend computes once."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import jax.numpy as jnp


def stack_rows(rows: Sequence[Any]) -> Any:
    """Stack arrays of one shape along a new first axis, as `jnp.stack` does, computing each once.

    XLA's CPU backend fuses all that comes before a `stack` into one scalar loop and computes it again for
    every row; rows that are whole simulations, nested over polarisations and Stokes sums, multiply. In a fit
    of Ψ and Δ at five angles the scan of 1056 candidates took 61.8 s with `stack` and 1.35 s with this.
    """
    rows = jnp.broadcast_arrays(*rows)
    return jnp.concatenate([row.reshape(-1) for row in rows]).reshape(len(rows), *rows[0].shape)
