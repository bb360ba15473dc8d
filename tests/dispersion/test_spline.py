"""Splines: against SciPy's, within their coefficients, Kramers-Kronig by quadrature."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import BSpline
from scipy.optimize import lsq_linear

import pellicle as pl
from pellicle.dispersion.base import HC, known_index
from pellicle.dispersion.spline import KramersKronigSpline, Spline
from pellicle.fitting.film.parameters import parameters
from pellicle.optics.pair import imag, is_real, real

from ..differences import derivative
from .test_oscillators import kramers_kronig

KNOTS = (300.0, 400.0, 500.0, 700.0, 1000.0)
AT = np.linspace(300.0, 1000.0, 141)
N, K = (2.0, 1.8, 1.7, 1.6, 1.5), (1.0, 0.4, 0.1, 0.2, 0.0)


@pytest.mark.parametrize("count", [2, 3, 4, 5])
def test_against_scipy(count):
    knots, n = KNOTS[:count], np.array(N[:count])
    degree = min(3, count - 1)
    inner = [np.mean(knots[i : i + degree]) for i in range(1, count - degree)]
    around = [knots[0]] * (degree + 1) + inner + [knots[-1]] * (degree + 1)
    at = np.linspace(knots[0], knots[-1], 101)
    np.testing.assert_allclose(Spline(knots, tuple(n)).index(at), BSpline(around, n, degree)(at), rtol=1e-13)


def test_ends_are_met_and_hold():
    found = Spline(KNOTS, N, K)(np.array([200.0, 300.0, 1000.0, 1500.0]))
    np.testing.assert_allclose(found, [2 + 1j, 2 + 1j, 1.5, 1.5], atol=1e-14)


@given(st.lists(st.floats(0, 2), min_size=5, max_size=5))
def test_never_beyond_its_coefficients(k):
    """No overshoot: between the least and the largest, and monotone where they are."""
    found = np.asarray(imag(Spline(KNOTS, N, k).index(AT)))
    assert found.min() >= min(k) - 1e-14
    assert found.max() <= max(k) + 1e-14
    falling = np.asarray(real(Spline(KNOTS, sorted(k, reverse=True)).index(AT)))
    assert np.all(np.diff(falling) <= 1e-14)


def test_transparent_without_k():
    assert is_real(Spline(KNOTS, N).index(AT))
    assert not is_real(Spline(KNOTS, N, K).index(AT))


def test_kramers_and_kronig():
    model = KramersKronigSpline(KNOTS, K, 1.5)
    sites = HC / np.array(KNOTS[::-1])
    low, high = sites[0] / sites[1], sites[-1] / sites[-2]
    below, above = sites[0] * low ** np.array([3, 2, 1]), sites[-1] * high ** np.array([1, 2, 3])
    around = np.array([*below, *sites, *above])
    parts = [BSpline.basis_element(around[j : j + 5], extrapolate=False) for j in range(7)]
    held = [K[-1], *K[::-1], K[0]]

    def k(E):
        return float(sum(c * np.nan_to_num(b(E)) for c, b in zip(held, parts, strict=True)))

    for E in (1.1, 1.3, 1.9, 2.7, 3.9, 4.5):
        found = complex(model(HC / E))
        assert found.imag == pytest.approx(k(E), abs=1e-13)
        assert found.real == pytest.approx(1.5 + kramers_kronig(k, E, around, around[-1]), abs=1e-8)


def test_poles_outside_the_knots():
    """A pole above the first knot and one at zero energy, of n alone; finite beyond the knots."""
    plain, poles = KramersKronigSpline(KNOTS, K, 1.5), KramersKronigSpline(KNOTS, K, 1.5, 3.0, 0.2)
    E = HC / AT
    top = 1.2 * HC / KNOTS[0]
    np.testing.assert_allclose(
        poles(AT) - plain(AT), 3.0 / (top**2 - E**2) - 0.2 / E**2, rtol=1e-12, atol=1e-13
    )
    assert np.isfinite(np.asarray(poles(np.array([250.0, 200.0, 2000.0])))).all()


def test_a_spline_of_kramers_and_kronig_follows_hematite():
    """n and k of the catalogue's hematite from 400 to 780 nm together, which absorbs beyond both ends."""
    nm = np.linspace(400.0, 780.0, 96)
    true = np.asarray(pl.refractive_index(nm, "Fe2O3"))
    knots = (HC / np.linspace(HC / 400, HC / 780, 10)).tolist()
    columns = [known_index(KramersKronigSpline(knots, row[:10], *row[10:]), nm) for row in np.eye(13)]
    table = np.array([np.concatenate([real(x), imag(x)]) for x in columns]).T
    numbers = lsq_linear(table, np.concatenate([true.real, true.imag]), (0, np.inf)).x
    off = table @ numbers - np.concatenate([true.real, true.imag])
    assert np.abs(off).max() < 0.02  # 0.4 where k falls to zero beyond the knots and there is no pole


@pytest.mark.parametrize("kind", [Spline, KramersKronigSpline])
def test_linear_in_the_coefficients_and_smooth_in_wavelength(kind):
    def index(k, at):
        model = Spline(KNOTS, N, k) if kind is Spline else KramersKronigSpline(KNOTS, k)
        value = model.index(at)
        return jnp.stack([real(value), imag(value)])

    index, whole = jax.jit(index), index
    at = np.array([310.0, 400.0, 555.0, 700.0, 990.0])  # knots among them
    k = tuple(np.float64(x) for x in K)
    slope = jax.jit(jax.jacfwd(whole))(k, at)
    for i in range(5):
        moved = (*k[:i], k[i] + 0.5, *k[i + 1 :])
        np.testing.assert_allclose(index(moved, at) - index(k, at), 0.5 * slope[i], atol=1e-12)
    along = jax.jvp(lambda w: index(k, w), (at,), (np.ones(5),))[1]
    np.testing.assert_allclose(along, derivative(lambda w: index(k, w), at, 1e-2), atol=1e-7)


@pytest.mark.slow  # compiles for 2 s
def test_precision_follows_the_wavelength():
    for model, close in ((Spline(KNOTS, N, K), 1e-6), (KramersKronigSpline(KNOTS, K), 2e-4)):
        single = jax.jit(model)(AT.astype(np.float32))
        assert single.dtype == np.complex64
        np.testing.assert_allclose(single, model(AT), atol=close)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: Spline((400.0, 300.0), (1.5, 1.4)), "rising"),
        (lambda: Spline((400.0,), (1.5,)), "two or more"),
        (lambda: Spline(KNOTS, N[:3]), "n needs one number a knot, 5, got 3"),
        (lambda: Spline(KNOTS, N, (0.1, 0.0, -0.1, 0.0, 0.0)), "k3 must not be negative"),
        (lambda: KramersKronigSpline(KNOTS, (-0.1, 0.0, 0.1, 0.0, 0.0)), "k1 must not be negative"),
    ],
)
def test_impossible_splines(make, said, refuses):
    refuses(ValueError, said, make)


def test_a_fit_scans_a_spline_as_a_whole():
    """The index of every knot moves together: 8 candidates a thickness, not 8 to the number of knots."""
    free = tuple(pl.Free(1.2, 4.0, start=1.5) for _ in range(4))
    layer = pl.Layer(Spline((400.0, 500.0, 600.0, 800.0), free), pl.Free(110, 130))
    assert {p.group for p in parameters(pl.Scene(layer, "Si"))} == {"n", "thickness"}
