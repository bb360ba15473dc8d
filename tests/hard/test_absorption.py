"""Absorptances of layers and fields in depth against 50 digits (absorption.json, by make_absorption.py).

The rule of test_stacks.py, and stricter: a value may be off by VALUE roundings times its condition, which is
here |f| + Σ |y| |∂f/∂y| with an extinction as an input of its own. So an absorptance of 1e-30 has all its
digits. A derivative in x may be off by SLOPE roundings times |∂f/∂x| + Σ |y| |∂²f/∂x∂y|, with a floor of |f|
times what ∂/∂x is for a signal that turns by one radian where x does. SLOPE is larger than there, where the
floor is that of a signal of size 1: the derivative of a layer's matrix contains k₀d e^{2ikq}, which is known
to k₀d roundings of 1 (130 of them in the layer of 0.1 mm, whose |f| is known to 2).
"""

import json
from functools import cache
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from pellicle.optics.field import absorptances, fields
from pellicle.optics.interface import transverse
from pellicle.optics.pair import Pair

TABLE = json.loads(Path(__file__).with_name("absorption.json").read_text(encoding="utf-8"))
VALUE, SLOPE = 8, 160


def outputs(row):
    """A of each layer and |E|² in the ambient, each layer and the substrate, for s and p in turn."""
    d, n, k = row[:9].reshape(3, 3)
    n2, k2, ambient, angle, wavelength = row[9:]
    media = ambient, [Pair(*nk) for nk in zip(n, k, strict=True)], Pair(n2, k2)
    k0, theta = 2 * jnp.pi / wavelength, jnp.deg2rad(angle)
    absorbed = absorptances(*media, list(k0 * d), theta)
    lower = jnp.cumsum(d)
    inside = lower - d * (1 - jnp.array(TABLE["shares"], row.dtype))
    # outside of the stack the distance is fixed
    depth = jnp.concatenate(
        [jnp.array([-TABLE["outside"]], row.dtype), inside, lower[-1:] + TABLE["outside"]]
    )
    found = fields(*media, k0, list(d), depth, theta)
    incident = transverse(ambient, theta)[1]
    parts = [(A, incident * field.energy()) for A, field in zip(absorbed, found, strict=True)]
    return jnp.concatenate([x for pair in parts for x in pair])


@cache
def computed(dtype):
    both = jax.jit(jax.vmap(lambda row: (outputs(row), jax.jacfwd(outputs)(row))))
    rows = np.array([case["at"] for case in TABLE["cases"].values()], dtype)
    values, slopes = map(np.asarray, both(rows))
    return {
        name: (case, value, slope.T)
        for (name, case), value, slope in zip(TABLE["cases"].items(), values, slopes, strict=True)
    }


def ratios(case, value, slope, dtype):
    """Errors in units of the tolerances' roundings; 0 for the field within a layer of no thickness."""
    unit = np.finfo(dtype).eps
    # below is underflow; at 90° |E|² is the square of a rounded cosine
    least = unit**2 if case["at"][-2] == 90 else 1e4 * np.finfo(dtype).tiny
    inside = np.array([True] * 3 + [True, *(d > 0 for d in case["at"][:3]), True])
    chosen = np.tile(inside, 2)
    values = np.abs(value - case["value"]) / (unit * np.array(case["condition"]) + least)
    slopes = np.abs(slope - case["slope"]) / (unit * np.array(case["slope_condition"]) + least)
    return np.where(chosen, values, 0.0), np.where(chosen, slopes, 0.0)


@pytest.mark.slow  # compiles for half a minute; tests/simulation/test_depth.py: random stacks
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_values_and_derivatives(dtype):
    for name, (case, value, slope) in computed(dtype).items():
        assert value.dtype == dtype
        assert np.all(np.isfinite(value)), name
        assert np.all(np.isfinite(slope)), name
        if not case["smooth"]:
            continue
        values, slopes = ratios(case, value, slope, dtype)
        assert np.max(values) <= VALUE, (name, values)
        assert np.max(slopes) <= SLOPE, (name, slopes)
