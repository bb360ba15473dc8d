"""Graded layers and their derivatives against 14 digits (gradient.json, by make_gradient.py)."""

import json
from functools import cache
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from pellicle.dispersion.profiles import Exponential, Linear, Power
from pellicle.optics import coherent, response
from pellicle.optics.ellipsometry import normalised, stokes
from pellicle.optics.gradient import Gradient, gauss_points
from pellicle.optics.pair import Pair, sqrt

TABLE = json.loads(Path(__file__).with_name("gradient.json").read_text(encoding="utf-8"))
SLICES = 96
VALUE, SLOPE = 1e-10, 1e-8
"""Of a signal; of a derivative relative to the largest of that number, or to 1. At SLICES the slices of the
metal are still in error by 3e-11."""
PROFILES = ("linear", "exponential", "power")


def signals(at, kind, media, ambient):
    """Rs, Rp, Ts, Tp, N, C, S of one row; all profiles are computed, so that rows share a program."""
    thickness, top, bottom, shape, angle = at
    profiles = Linear(top, bottom), Exponential(top, bottom, shape), Power(top, bottom, shape)
    squares = [x * x for x in (Pair(*media[0]), Pair(*media[1]))]

    def index(depth):
        each = jnp.stack([profile.fraction(depth[:, None]) for profile in profiles])
        return sqrt(squares[0] + (squares[1] - squares[0]) * each[kind])

    points = Gradient(*map(index, gauss_points(SLICES)))
    phase = 2 * jnp.pi / TABLE["nm"] * thickness
    found = coherent.responses(ambient, [points], Pair(*media[2]), [phase[None]], jnp.deg2rad(angle))
    powers = [f(x) for f in (response.reflectance, response.transmittance) for x in found]
    return jnp.concatenate([*powers, *normalised(stokes(*found))])


@cache
def computed():
    rows = TABLE["rows"].values()
    arguments = (
        jnp.array([row["at"] for row in rows]),
        jnp.array([PROFILES.index(row["profile"]) for row in rows]),
        jnp.array([row["media"] for row in rows]),
        jnp.array([row["ambient"] for row in rows]),
    )
    both = jax.jit(jax.vmap(lambda *x: (signals(*x), jax.jacfwd(signals)(*x))))
    return jax.tree.map(np.asarray, both(*arguments))


@pytest.mark.slow  # compiles for 20 s; optics/test_gradient.py: closed forms
@pytest.mark.parametrize("name", TABLE["rows"])
def test_a_graded_layer_and_its_slopes(name):
    row, position = TABLE["rows"][name], [*TABLE["rows"]].index(name)
    values, slopes = (x[position] for x in computed())
    np.testing.assert_allclose(values, np.array(row["values"], dtype=float), rtol=0, atol=VALUE)
    truth = np.array(row["slopes"], dtype=float)
    size = np.maximum(np.max(np.abs(truth), axis=1), np.where(truth.any(axis=1), 0, 1))
    np.testing.assert_allclose(slopes.T / size[:, None], truth / size[:, None], rtol=0, atol=SLOPE)
