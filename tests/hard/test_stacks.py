"""Films and stacks, ellipsometry with them, against 50 digits (stacks.json, by make_stacks.py).

One rule for all tolerances, no case has its own. A value may be off by VALUE roundings times its condition,
1 + Σ |y| |∂f/∂y|: what it changes by where every input is rounded. A derivative in x by SLOPE roundings times
its own: |∂f/∂x| + Σ |y| |∂²f/∂x∂y|, and a floor, what ∂/∂x is for a signal that turns by one radian where x
does (a layer that is a millimetre thick has no derivative left, but rounds all the same). N, C and S of a
faint reflection have 1/|r| of that: r is a difference between roots of size 1.
"""

import importlib
import json
from functools import cache, partial
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from mpmath import mp

import pellicle as pl
from pellicle.forward_model.film_signal import build
from pellicle.optics import coherent, response
from pellicle.optics.coherent import stack
from pellicle.optics.ellipsometry import normalised, psi_delta, stokes
from pellicle.optics.pair import to_pair
from pellicle.scene.free import insert

TABLE = json.loads(Path(__file__).with_name("stacks.json").read_text(encoding="utf-8"))
SIGNALS = TABLE["signals"]
VALUE, SLOPE = 8, 32
WAYS = {
    "one film": ("films", 1, coherent.responses),
    "one film by matrices": ("films", 1, stack),
    "three layers": ("stacks", 3, coherent.responses),
    "three layers by a loop": ("stacks", 3, stack),
}
"""What is computed: table, number of layers, function."""


def signals(row, layers, respond):
    """Return Rs, Rp, Ts, Tp, N, C, S of one row; N, C and S from the Ψ and Δ that the user gets.

    `pl.reflectance`, `pl.transmittance` and `pl.ellipsometry` compute the same, one at a time.
    """
    d, n, k = row[: 3 * layers].reshape(3, layers)
    n2, k2, ambient, angle, wavelength = row[-5:]
    media = [to_pair(index) for index in jax.lax.complex(n, k)]
    below = to_pair(jax.lax.complex(n2, k2))
    responses = respond(ambient, media, below, list(2 * jnp.pi / wavelength * d), jnp.deg2rad(angle))
    powers = [f(x) for f in (response.reflectance, response.transmittance) for x in responses]
    psi, delta = map(jnp.deg2rad, psi_delta(*normalised(stokes(*responses))))
    across = jnp.sin(2 * psi)
    dark = jnp.where(psi == 0, 0.0, 1.0)  # nothing is reflected
    return jnp.stack([*powers, dark * jnp.cos(2 * psi), across * jnp.cos(delta), across * jnp.sin(delta)])


@cache
def computed(way, dtype):
    table, layers, respond = WAYS[way]
    one = partial(signals, layers=layers, respond=respond)
    both = jax.jit(jax.vmap(lambda row: (one(row), jax.jacfwd(one)(row))))
    rows = np.array([case["at"] for case in TABLE[table].values()], dtype)
    values, slopes = map(np.asarray, both(rows))
    return {name: (c, v, s.T) for (name, c), v, s in zip(TABLE[table].items(), values, slopes, strict=True)}


def ratios(case, value, slope, dtype):
    """Errors in units of rounding times condition, of the values and of the derivatives."""
    faint = 1.0 if case["dark"] else 1 / np.sqrt(max(case["value"][:2]))
    unit = np.finfo(dtype).eps * np.where([name in "NCS" for name in SIGNALS], faint, 1.0)
    values = np.abs(value - case["value"]) / (unit * np.array(case["condition"]))
    return values, np.abs(slope - case["slope"]) / (unit * np.array(case["slope_condition"]))


RUNS = [
    ("one film", np.float64),
    pytest.param("one film", np.float32, marks=pytest.mark.slow),
    pytest.param("one film by matrices", np.float32, marks=pytest.mark.slow),  # as the loop over three
    ("three layers", np.float64),
    pytest.param("three layers", np.float32, marks=pytest.mark.slow),  # compiles for 10 s; the loop takes 4
    ("three layers by a loop", np.float32),
]


@pytest.mark.parametrize(("way", "dtype"), RUNS)
def test_values_and_derivatives(way, dtype):
    for name, (case, value, slope) in computed(way, dtype).items():
        assert value.dtype == dtype
        assert np.all(np.isfinite(value)), name
        assert np.all(np.isfinite(slope)), name
        if not case["smooth"]:
            continue
        values, slopes = ratios(case, value, slope, dtype)
        assert np.max(values) <= VALUE, (name, dict(zip(SIGNALS, values, strict=True)))
        assert np.max(slopes) <= SLOPE, (name, dict(zip(SIGNALS, np.max(slopes, axis=0), strict=True)))


@pytest.fixture
def by_matrix(monkeypatch):
    """The table's own formula."""
    monkeypatch.syspath_prepend(Path(__file__).parent)
    with mp.workdps(60):
        yield importlib.import_module("stack_truth").by_matrix


@pytest.mark.slow
def test_fifty_layers_with_an_opaque_one_in_the_middle(by_matrix):
    """A mirror of quarter waves on metal on another mirror, that no light passes: R, T and their slopes."""
    depth = np.tile([60.0, 95.0], 25)
    index = np.tile([2.3 + 0j, 1.46 + 1e-3j], 25)
    depth[25], index[25] = 900.0, 0.5 + 4j

    def given(x):
        """The thicknesses of the first layer and of the metal, the metal's n, the angle: and all else."""
        n = index.real.tolist()
        return [x[0], *depth[1:25], x[1], *depth[26:]], [*n[:25], x[2], *n[26:]], x[3]

    start = np.array([60.0, 900.0, 0.5, 30.0])

    def truth(x):
        d, n, angle = given(x)
        found = by_matrix([*map(mp.mpf, [*d, *n, *index.imag, 1.52, 0.0, 1.0, angle, 550.0])])
        return [abs(found["p"][0]) ** 2, found["p"][1]]

    expected, slopes, small = truth(start), [], mp.mpf(10) ** -20
    for i in range(4):
        up, down = ([x + sign * small * (i == j) for j, x in enumerate(start)] for sign in (1, -1))
        slopes.append([(x - y) / (2 * small) for x, y in zip(truth(up), truth(down), strict=True)])
    expected, slopes = np.array(expected, float), np.array(slopes, float)

    def both(x):
        d, n, angle = given(x)
        media = [jax.lax.complex(*map(jnp.float64, nk)) for nk in zip(n, index.imag, strict=True)]
        light = {"angle": angle, "polarisation": "p"}
        return jnp.stack([f(550.0, d, media, 1.52, **light) for f in (pl.reflectance, pl.transmittance)])

    value, slope = jax.jit(lambda x: (both(x), jax.jacfwd(both)(x)))(start)
    assert expected[1] < 1e-36
    np.testing.assert_allclose(value, expected, rtol=1e-12)
    # of R nothing that lies under the metal's skin is left; of T every digit
    np.testing.assert_allclose(slope[0], slopes[:, 0], rtol=1e-10, atol=1e-15)
    np.testing.assert_allclose(slope[1], slopes[:, 1], rtol=1e-10)


@pytest.mark.slow
@pytest.mark.parametrize("angle", [0.0, 60.0])
def test_a_roughness_free_from_zero_is_smooth_and_flat_there(angle):
    """Its first order vanishes; the other slopes are those of the smooth stack."""
    light = pl.Light(np.linspace(400.0, 800.0, 5), angle=angle, polarisation="p" if angle else "unpolarised")

    def compiled(**rough):
        layers = [pl.Layer(1.46, pl.Free(0, 300, start=100.0), **rough), pl.Layer(2.1 + 0.1j, 50.0)]
        scene = pl.Scene(layers, 0.2 + 3.4j, light=light)
        model = build(pl.plan(scene))
        both = jax.jit(lambda x: (model(insert(scene, x)), jax.jacfwd(lambda x: model(insert(scene, x)))(x)))
        return both(jnp.array([100.0, 0.0]) if rough else jnp.array([100.0]))

    smooth, slope = compiled()
    value, slopes = compiled(roughness=pl.Free(0, 5, start=0.0))
    np.testing.assert_allclose(value, smooth, rtol=1e-13)
    np.testing.assert_allclose(slopes[:, 0], slope[:, 0], rtol=1e-10, atol=1e-15)
    assert np.all(slopes[:, 1] == 0)
