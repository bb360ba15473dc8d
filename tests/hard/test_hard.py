"""Hard films by the public functions against 50 digits (stacks.json, by make_stacks.py), as in test_stacks.

In forward and in reverse mode, as complex indices and as real ones; and what no table has.
"""

import math
from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import pellicle as pl

from .test_stacks import SLOPE, TABLE, VALUE

CASES = TABLE["films"]
POINTS = np.array([case["at"] for case in CASES.values()])
FUNCTIONS = {"R": pl.reflectance, "T": pl.transmittance}
SIGNALS = [(signal, letter) for signal in "RT" for letter in "sp"]
assert [signal + letter for signal, letter in SIGNALS] == TABLE["signals"][:4]
EXTINCTIONS = [2, 4]
"""Their columns."""
SINGLE = pytest.param(
    np.float32, marks=pytest.mark.slow(reason="compiles for 20 s; test_stacks.py: one film")
)
TRANSPARENT = [name for name, case in CASES.items() if case["at"][2] == 0 and case["at"][4] == 0]


@cache
def compiled(transparent):
    """Values, forward and reverse derivatives of SIGNALS for rows of the table; `transparent` ignores k.

    One program of all compiles in two thirds of the time of four.
    """

    def each(row):
        d, n1, k1, n2, k2, ambient, angle, wavelength = row
        layer, substrate = (n1, n2) if transparent else (jax.lax.complex(n1, k1), jax.lax.complex(n2, k2))
        film = {"ambient": ambient, "angle": angle}
        found = [FUNCTIONS[x](wavelength, d, layer, substrate, **film, polarisation=p) for x, p in SIGNALS]
        return jnp.stack(found)

    return jax.jit(jax.vmap(lambda row: (each(row), jax.jacfwd(each)(row), jax.jacrev(each)(row))))


@cache
def computed(dtype, transparent=False):
    """The same by name of case, each with SIGNALS as its first axis."""
    columns = (np.asarray(x) for x in compiled(transparent)(POINTS.astype(dtype)))
    return {name: row for name, *row in zip(CASES, *columns, strict=True)}


def alone(signal, letter, row, transparent=False):
    """The same of a row that is not in the table, in the shape that is compiled already."""
    found = compiled(transparent)(np.tile(row, (len(POINTS), 1)))
    return [np.asarray(x)[0, SIGNALS.index((signal, letter))] for x in found]


@pytest.mark.parametrize(
    ("name", "transparent"), [*((x, False) for x in CASES), *((x, True) for x in TRANSPARENT)]
)
def test_values_and_derivatives(name, transparent):
    """As complex numbers, and as real ones where nothing absorbs."""
    (values, *slopes), case = computed(np.float64, transparent)[name], CASES[name]
    unit = np.finfo(np.float64).eps
    # at a critical substrate the truth is singular: a root of n² − a² = 1e-16, which sin 30° brings, is 1e-8
    within = VALUE * unit * np.array(case["condition"][:4]) if case["smooth"] else 5e-7
    assert np.all(np.abs(values - case["value"][:4]) <= within)
    for found in slopes if case["smooth"] else ():
        truth, condition = (np.array(case[key])[:, :4].T for key in ("slope", "slope_condition"))
        worst = np.abs(found - truth) / (unit * condition)
        assert np.all(np.delete(worst, EXTINCTIONS if transparent else [], axis=1) <= SLOPE), worst


@pytest.mark.parametrize(("signal", "letter"), SIGNALS)
def test_an_extinction_next_to_none_has_the_slopes_of_none(signal, letter):
    row = POINTS[[*CASES].index("ordinary, transparent")]
    faint = row + np.array([0, 0, 1e-300, 0, 1e-300, 0, 0, 0])
    for one, other in zip(alone(signal, letter, faint), alone(signal, letter, row), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("dtype", [SINGLE, np.float64])
def test_everything_is_finite_and_within_the_unit_interval(dtype):
    """At a critical substrate too, where the true derivatives in n₂, n₀ and angle are infinite.

    float32's cosine of 90° is negative: T once came out below 0 there, and R above 1.
    """
    unit = 5e-7 if dtype == np.float32 else 1e-14
    for transparent in (False, True):
        for name, (values, *slopes) in computed(dtype, transparent).items():
            assert values.dtype == dtype
            assert all(np.all(np.isfinite(slope)) for slope in slopes), name
            assert np.all((values >= -1e-20) & (values <= 1 + unit)), name


@pytest.mark.parametrize("transparent", [False, True])
@pytest.mark.parametrize("letter", "sp")
def test_a_faint_transmittance_keeps_its_relative_accuracy(letter, transparent):
    """κd of 23 in a gap of 2.7 µm: T is 1e-20, far under the rounding of 1 − R."""
    name = "total reflection, 20 µm gap"
    row = np.array(CASES[name]["at"])
    row[0] = 2700.0
    d, n1, _, _, _, n0, angle, wavelength = row
    q0 = n0 * np.cos(np.deg2rad(angle))
    q1 = 1j * np.sqrt(complex((n0 * np.sin(np.deg2rad(angle))) ** 2 - n1**2)).real
    u, v = (q0, q1) if letter == "s" else (n1**2 * q0, n0**2 * q1)
    # so deep that one passage is all: |t₁₂ t₂₃|² e^{−2κk₀d}, and r₂₃ = −r₁₂
    truth = abs(4 * u * v / (u + v) ** 2) ** 2 * np.exp(-4 * np.pi / wavelength * d * q1.imag)
    found, slopes, _ = alone("T", letter, row, transparent)
    assert 1e-25 < truth < 1e-15
    assert found == pytest.approx(truth, rel=1e-12, abs=0)
    assert slopes[0] == pytest.approx(truth * -4 * np.pi / wavelength * q1.imag, rel=1e-12, abs=0)


@pytest.mark.parametrize("dtype", [SINGLE, np.float64])
@pytest.mark.parametrize("letter", "sp")
def test_nothing_between_equal_media_reflects_nothing_at_90_degrees_too(letter, dtype):
    """0/0 where the thickness is 0: the limit is 0 when it goes first and 1 when the angle does. We give 0,
    as at every other angle, so that only the thickness jumps: any film at all reflects everything."""
    row = np.array([0.0, 2.1, 0.0, 1.0, 0.0, 1.0, 90.0, 550.0], dtype=dtype)
    for signal, truth in (("R", 0.0), ("T", 1.0)):
        value, forward, reverse = alone(signal, letter, row)
        # T is a quotient: no light is made of a rounding, as R would have it
        assert value == (truth if signal == "R" else pytest.approx(truth, abs=2 * float(np.finfo(dtype).eps)))
        assert np.all(np.isfinite(forward))
        assert np.all(np.isfinite(reverse))
        row[0] = 1e-3
        assert alone(signal, letter, row)[0] == pytest.approx(1 - truth, abs=1e-6)
        row[0] = 0.0


@pytest.mark.parametrize("dtype", [np.float32, pytest.param(np.float64, marks=pytest.mark.slow)])
def test_equal_media_have_no_psi_and_delta_but_zeros(dtype):
    """Nothing is reflected, by one film and by a list, and no rounding is taken for a reflection."""

    def both(row):
        d, n, angle = row
        one = pl.ellipsometry(dtype(550), d, n, n, ambient=n, angle=angle)
        return jnp.stack([*one, *pl.ellipsometry(dtype(550), [d, 2 * d], [n, n], n, ambient=n, angle=angle)])

    rows = np.array([[0.0052, 1.5, 23.96], [300.0, 1.37, 70.0], [0.0, 1.5, 90.0]], dtype)
    value, slope = jax.jit(jax.vmap(lambda row: (both(row), jax.jacfwd(both)(row))))(rows)
    assert np.all(value == 0)
    assert np.all(slope == 0)


@pytest.mark.parametrize("dtype", [SINGLE, np.float64])
@pytest.mark.parametrize("angle", [89.0, 89.99, 89.9999, 89.999999])
def test_a_substrate_that_is_the_ambient_is_no_mirror_at_grazing_incidence(angle, dtype):
    """Its q from n − a alone is all rounding there: in float32 T once came out 0."""
    row = np.array([0.0, 1.0, 0.0, 1.0, 0.0, 1.0, angle, 550.0], dtype=dtype)
    assert alone("T", "s", row)[0] == pytest.approx(1, abs=1e-6)
    row[3] += 1e-9 * dtype(dtype is np.float64)
    cosine = math.cos(math.radians(angle))
    inside = math.sqrt(cosine**2 + (row[3] - 1.0) * (row[3] + 1.0))
    truth = 4 * cosine * inside / (cosine + inside) ** 2
    assert alone("T", "s", row)[0] == pytest.approx(truth, abs=1e-6)
