"""pellicle: `pl.jones` of a uniaxial layer on a uniaxial substrate, and its forward derivatives."""

import jax
import jax.numpy as jnp
import numpy as np

import pellicle as pl


def _elements(row):
    d, no, ko, ne, ke, theta, phi, so, se, sk, theta_s, phi_s, ambient, angle, nm = row
    layer = pl.Anisotropic(jax.lax.complex(no, ko), jax.lax.complex(ne, ke), axis=(theta, phi))
    substrate = pl.Anisotropic(jax.lax.complex(so, sk), jax.lax.complex(se, sk), axis=(theta_s, phi_s))
    matrix = pl.jones(nm, d, layer, substrate, ambient=ambient, angle=angle)
    return jnp.stack([part for r in matrix.ravel() for part in (r.real, r.imag)])


@jax.jit
def _both(row, tangent):
    return jax.jvp(_elements, (row,), (tangent,))


def _row(case, dtype):
    return jnp.array(list(case.values()), dtype=dtype)


def values(case, dtype):
    """In the precision of `dtype`."""
    row = _row(case, dtype)
    return {"r": np.asarray(_both(row, row)[0], dtype=float)}


def slopes(case, dtype):
    """In the precision of `dtype`; for each parameter those of all elements."""
    row = _row(case, dtype)
    return {"r": np.ravel([_both(row, unit)[1] for unit in jnp.eye(len(row), dtype=dtype)]).astype(float)}
