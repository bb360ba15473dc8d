"""Hard cases against 50 digits (table.json, written by make_table.py): values and every derivative.

An error of a derivative is measured against |derivative| + 1e-3, for many derivatives are 0.
"""

import json
import math
from functools import cache
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import pellicle as pl

TABLE = json.loads(Path(__file__).with_name("table.json").read_text(encoding="utf-8"))
CASES = TABLE["cases"]
PARAMETERS = TABLE["parameters"]
POINTS = np.array([case["at"] for case in CASES.values()])
CRITICAL = "substrate exactly critical"

VALUE, GRADIENT = 5e-15, 3e-12
# case: (value, gradient), where the defaults do not hold in float64
LOOSER = {
    # the round trip is 3e4 rad: its rounding alone is 4e-12
    "1 mm transparent": (4e-12, 1e-11),
    # k₀d of 860
    "wavelength 1 nm": (VALUE, 2e-11),
    # a sharp resonance: n₂ ∂R/∂n₂ is 114, so that the rounding of n₂ alone is 1.3e-14
    "Kretschmann plasmon": (1.3e-14, GRADIENT),
    # the root of n² − a², a difference of 1e-16 that sin 30° brings, is 1e-8: the truth is singular here
    CRITICAL: (5e-7, np.nan),
}

VALUE32, GRADIENT32 = 3e-6, 1.5e-3

FUNCTIONS = {"R": pl.reflectance, "T": pl.transmittance}
SIGNALS = [(signal, letter) for signal in "RT" for letter in "sp"]


@cache
def compiled(transparent):
    """Values, forward and reverse derivatives of SIGNALS for rows of PARAMETERS; `transparent` ignores k.

    One program of all compiles in two thirds of the time of four.
    """

    def each(row):
        d, n1, k1, n2, k2, ambient, angle, wavelength = row
        layer, substrate = (n1, n2) if transparent else (jax.lax.complex(n1, k1), jax.lax.complex(n2, k2))
        media = {"ambient": ambient, "angle": angle}
        found = [
            FUNCTIONS[signal](wavelength, d, layer, substrate, **media, polarisation=letter)
            for signal, letter in SIGNALS
        ]
        return jnp.stack(found)

    return jax.jit(jax.vmap(lambda row: (each(row), jax.jacfwd(each)(row), jax.jacrev(each)(row))))


@cache
def computed(signal, letter, dtype, transparent=False):
    """The same of one signal, by name of case."""
    columns = (x[:, SIGNALS.index((signal, letter))] for x in _all(dtype, transparent))
    return {name: row for name, *row in zip(CASES, *columns, strict=True)}


@cache
def _all(dtype, transparent):
    return [np.asarray(x) for x in compiled(transparent)(POINTS.astype(dtype))]


def alone(signal, letter, row, transparent=False):
    """The same of a row that is not in the table, in the shape that is compiled already."""
    found = compiled(transparent)(np.tile(row, (len(POINTS), 1)))
    return [np.asarray(x)[0, SIGNALS.index((signal, letter))] for x in found]


def slope_error(found, truth):
    return np.abs(found - truth) / (np.abs(truth) + 1e-3)


def check(name, signal, letter, dtype, tolerances, transparent=False):
    value, *slopes = computed(signal, letter, dtype, transparent)[name]
    case, (loose_value, loose_slope) = CASES[name], tolerances
    assert value.dtype == dtype
    assert abs(value - case["value"][signal + letter]) <= loose_value
    if not case["smooth"]:
        return
    kept = [i for i, p in enumerate(PARAMETERS) if not (transparent and p.endswith("_k"))]
    truth = np.array(case["gradient"][signal + letter])[kept]
    for found in slopes:
        worst = slope_error(found[kept], truth)
        assert np.all(worst <= loose_slope), dict(zip(np.take(PARAMETERS, kept), worst, strict=True))


@pytest.mark.parametrize(("signal", "letter"), SIGNALS)
@pytest.mark.parametrize("name", CASES)
def test_float64(name, signal, letter):
    check(name, signal, letter, np.float64, LOOSER.get(name, (VALUE, GRADIENT)))


TRANSPARENT = [name for name, case in CASES.items() if case["at"][2] == 0 and case["at"][4] == 0]


@pytest.mark.parametrize(("signal", "letter"), SIGNALS)
@pytest.mark.parametrize("name", TRANSPARENT)
def test_float64_of_real_indices(name, signal, letter):
    check(name, signal, letter, np.float64, LOOSER.get(name, (VALUE, GRADIENT)), transparent=True)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize(("signal", "letter"), SIGNALS)
def test_everything_is_finite(signal, letter, dtype):
    """At a critical substrate too, where the true derivatives in n₂, n₀ and angle are infinite."""
    for transparent in (False, True):
        for name, row in computed(signal, letter, dtype, transparent).items():
            assert all(np.all(np.isfinite(part)) for part in row), name


def test_nothing_leaves_the_unit_interval_by_more_than_rounding():
    """float32's cosine of 90° is negative: T once came out below 0 there, and R above 1."""
    for dtype, unit in ((np.float32, 5e-7), (np.float64, 1e-14)):
        for signal, letter in SIGNALS:
            for name, (value, *_) in computed(signal, letter, dtype).items():
                assert -1e-20 <= value <= 1 + unit, (name, signal, letter, dtype)


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


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
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


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
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
