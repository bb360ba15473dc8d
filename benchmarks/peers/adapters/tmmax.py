"""tmmax: `vectorized_coh_tmm`, metres and radians, n + ik, float32.

Its public function `tmm` accepts media only by name; this is the function that it calls with their tables.
"""

import jax
import jax.numpy as jnp
from cases import FREE, PARAMETERS
from tmmax.tmm import vectorized_coh_tmm

_FREE = [PARAMETERS.index(name) for name in FREE]


def _signals(row):
    d, n1, k1, n2, k2, ambient, angle, wavelength = row
    wave = wavelength * 1e-9
    axis = wave * jnp.array([0.5, 2.0])
    media = [(ambient, 0.0 * k1), (n1, k1), (n2, k2)]
    data = jnp.stack([jnp.stack([axis, jnp.stack([n, n]), jnp.stack([k, k])]) for n, k in media])
    found = {}
    for letter in "sp":
        R, T = vectorized_coh_tmm(
            data,
            jnp.array([0, 1, 2]),
            (d * 1e-9)[None],
            wave[None],
            jnp.deg2rad(angle)[None],
            jnp.array([letter == "p"]),
        )
        found |= {"R" + letter: R.reshape(()), "T" + letter: T.reshape(())}
    return found


_values, _slopes = jax.jit(_signals), jax.jit(jax.jacrev(_signals))


def _row(case):
    return jnp.array([case[name] for name in PARAMETERS])


def values(case):
    return {signal: [x] for signal, x in _values(_row(case)).items()}


def slopes(case):
    return {signal: row[jnp.array(_FREE)] for signal, row in _slopes(_row(case)).items()}
