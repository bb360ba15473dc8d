"""pellicle: `reflectance` and `transmittance`, s and p, and their forward derivatives."""

import jax
import jax.numpy as jnp
import numpy as np
from cases import FREE, PARAMETERS, SIGNALS

import pellicle as pl

_FREE = [PARAMETERS.index(name) for name in FREE]


def _signals(row):
    d, n1, k1, n2, k2, ambient, angle, wavelength = row
    film = wavelength, d, jax.lax.complex(n1, k1), jax.lax.complex(n2, k2)
    functions = {"R": pl.reflectance, "T": pl.transmittance}
    light = {"ambient": ambient, "angle": angle}
    return jnp.stack([functions[kind](*film, **light, polarisation=letter) for kind, letter in SIGNALS])


@jax.jit
def _both(row):
    return _signals(row), jax.jacfwd(_signals)(row)


def _answer(case, dtype):
    row = np.array([case[name] for name in PARAMETERS], dtype=dtype)
    return [np.asarray(part, dtype=float) for part in _both(row)]


def values(case, dtype):
    """In the precision of `dtype`."""
    return {signal: [x] for signal, x in zip(SIGNALS, _answer(case, dtype)[0], strict=True)}


def slopes(case, dtype):
    """In the precision of `dtype`."""
    return dict(zip(SIGNALS, _answer(case, dtype)[1][:, _FREE], strict=True))
