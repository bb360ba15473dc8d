"""Generalised Ψ and Δ of the hard birefringent films of anisotropic.json: N, C, S of each ratio and slopes.

The Jones matrices and their derivatives are those of the table, to 50 digits; mpmath forms the ratios.
In several films nothing turns p into s, so that tan Ψ is 0 and Δ has no meaning.
"""

import json
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from mpmath import mp, mpc, mpf

from pellicle.optics.berreman.matrices import Elements
from pellicle.optics.mueller import mueller_elements
from pellicle.optics.pair import Pair
from pellicle.signals.generalised import Generalised
from pellicle.signals.waves import ratio_sums_of_mueller

CASES = json.loads(Path(__file__).with_name("anisotropic.json").read_text(encoding="utf-8"))["cases"]
NUMBERS = np.array([case["value"] for case in CASES.values()])[:, :8]
SLOPES = np.array([case["slope"] for case in CASES.values()])[:, :8]


def angles(*numbers):
    """N, C, S of each ratio from the real and imaginary parts of pp, ps, sp, ss."""
    signal, jones = Generalised(), Elements(*(Pair(*numbers[i : i + 2]) for i in range(0, 8, 2)))
    return jnp.stack(signal.of_sums(signal.of_jones(jones)))


@pytest.fixture(scope="module")
def computed():
    def both(numbers, slopes):
        push = lambda slope: jax.jvp(angles, tuple(numbers), tuple(slope))  # noqa: E731
        value, slope = jax.vmap(push, in_axes=-1, out_axes=(None, -1))(slopes)
        return value, slope

    columns = jnp.asarray(NUMBERS.T), jnp.asarray(np.moveaxis(SLOPES, 1, 0))
    value, slope = jax.jit(both)(*columns)
    return np.asarray(value).T, np.moveaxis(np.asarray(slope), 0, 1)


def expected(numbers, slopes):
    """N, C, S of each ratio and their derivatives in each parameter, with tan Ψ exp(iΔ) = conj(x/y)."""
    pp, ps, sp, ss = (mpc(*map(mpf, numbers[i : i + 2])) for i in range(0, 8, 2))
    dpp, dps, dsp, dss = ([mpc(*map(mpf, d)) for d in slopes[i : i + 2].T] for i in range(0, 8, 2))
    value, slope = [], []
    # r_ps of Woollam is the reflected s of incident p: row s, column p
    for x, dx, y, dy in ((pp, dpp, ss, dss), (sp, dsp, pp, dpp), (ps, dps, ss, dss)):
        size = abs(x) ** 2 + abs(y) ** 2
        cross = 2 * mp.conj(x) * y
        value += [(abs(y) ** 2 - abs(x) ** 2) / size, cross.real / size, cross.imag / size]
        rows = []
        for a, b in zip(dx, dy, strict=True):
            p, s = 2 * mp.re(mp.conj(x) * a), 2 * mp.re(mp.conj(y) * b)
            turned = 2 * (mp.conj(a) * y + mp.conj(x) * b)
            n = (s - p) / size - (abs(y) ** 2 - abs(x) ** 2) * (p + s) / size**2
            both = turned / size - cross * (p + s) / size**2
            rows.append([n, both.real, both.imag])
        slope += np.transpose(rows).tolist()
    return np.array(value, dtype=float), np.array(slope, dtype=float)


@pytest.mark.parametrize(("row", "name"), list(enumerate(CASES)))
def test_values_and_derivatives(computed, row, name):
    with mp.workdps(50):
        value, slope = expected(NUMBERS[row], SLOPES[row])
    np.testing.assert_allclose(computed[0][row], value, rtol=0, atol=2e-15 * 10)
    assert np.all(np.isfinite(computed[1][row]))
    size = np.abs(slope) + np.max(np.abs(slope), axis=0, keepdims=True) + 1e-3
    assert np.max(np.abs(computed[1][row] - slope) / size) < 1e-12


def test_some_films_do_not_mix_s_and_p(computed):
    apart = [i for i in range(len(CASES)) if np.max(np.abs(NUMBERS[i, 2:6])) < 1e-30]
    assert len(apart) >= 2
    none = [1.0, 0.0, 0.0] * 2
    np.testing.assert_allclose(computed[0][apart, 3:], np.tile(none, (len(apart), 1)), atol=1e-30)


def test_sums_of_the_mueller_matrix():
    """Two films whose light adds: the sums of both are those of the added Mueller matrices."""
    jones = [Elements(*(Pair(*NUMBERS[row, i : i + 2]) for i in range(0, 8, 2))) for row in (0, 3)]
    added = np.sum([mueller_elements(*own) for own in jones], axis=0)
    expected = np.sum([Generalised().of_jones(own) for own in jones], axis=0)
    np.testing.assert_allclose(ratio_sums_of_mueller(added.tolist()), expected, atol=1e-15)


def test_slopes_where_nothing_turns_p_into_s():
    """C + iS of Aps is 2 conj(r_ps) r_pp/|r_pp|² to first order: its derivative in r_ps is 2/r_pp."""
    still = tuple(jnp.asarray(x) for x in (0.5, 0.0, 0.0, 0.0, 0.0, 0.0, -0.4, 0.0))
    moved = tuple(jnp.asarray(float(i == 4)) for i in range(8))  # the real part of sp, Woollam's r_ps
    value, slope = jax.jvp(angles, still, moved)
    np.testing.assert_allclose(value[3:], [1.0, 0.0, 0.0, 1.0, 0.0, 0.0], atol=0)
    np.testing.assert_allclose(slope, [0, 0, 0, 0, 4.0, 0, 0, 0, 0], atol=1e-15)
    dark = tuple(jnp.zeros(()) for _ in range(8))
    value, slope = jax.jvp(angles, dark, moved)
    np.testing.assert_array_equal(value, 0.0)
    assert np.all(np.isfinite(slope))
