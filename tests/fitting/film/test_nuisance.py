"""Scale and offset by variable projection, against dense algebra written a second time in NumPy."""

from itertools import pairwise

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import block_diag
from scipy.optimize import nnls

from pellicle.fitting.film.nuisance import Data, solve
from pellicle.scene.instrument import Instrument

from ...differences import derivative

POINTS, LEVEL, FRACTION = 64, 0.4, 0.5
POSITION = np.linspace(-1.0, 1.0, POINTS)
SIGNAL = 0.3 + 0.2 * np.cos(9 * POSITION + 1)
WEIGHT = 1 / (0.01 + 0.005 * (1 + POSITION))
NOISE = 0.01 * np.random.default_rng(3).normal(size=POINTS)
AT = np.cos(np.pi * np.arange(7) / 6)
"""Positions where slow curves are held at zero or above; the furthest are half a unit apart."""
DEGREES = {"free": (0, 0), "slow": (3, 2)}
"""Degrees of scale and offset by the contract's words."""


def data(values, weight=WEIGHT) -> Data:
    return Data(np.asarray(values), weight, POSITION, np.float64(FRACTION), np.float64(LEVEL))


solved = jax.jit(solve)


class Dense:
    """The linear model y = X c with prior c ~ N(mean, diag sd²), whitened; written down once more.

    The gain's columns are in units of the plain least-squares scale, the offset's in units of the
    level; standard deviations are 10 for a single number, else 1, 0.3, 0.15, 0.075 for the gain and
    0.3, 0.15, 0.075 for the offset.
    """

    def __init__(self, values, scale: str | None, offset: str | None):
        root = WEIGHT * np.sqrt(FRACTION)
        plain = np.sum(root**2 * values * SIGNAL) / np.sum(root**2 * SIGNAL**2)
        blocks, mean, sd = [], [], []
        if scale:
            degree = DEGREES[scale][0]
            blocks.append(plain * SIGNAL[:, None] * np.polynomial.chebyshev.chebvander(POSITION, degree))
            mean += [1.0] + [0.0] * degree
            sd += [10.0] if degree == 0 else [1.0, 0.3, 0.15, 0.075]
        self.first = len(mean)
        if offset:
            degree = DEGREES[offset][1]
            blocks.append(LEVEL * np.polynomial.chebyshev.chebvander(POSITION, degree))
            mean += [0.0] * (degree + 1)
            sd += [10.0] if degree == 0 else [0.3, 0.15, 0.075]
        known = (0.0 if scale else SIGNAL) + np.zeros(POINTS)
        self.columns, self.known = np.hstack(blocks), known
        self.x, self.y = self.columns * root[:, None], root * (values - known)
        self.mean, self.sd = np.array(mean), np.array(sd)

    def least_squares(self):
        rows = np.vstack([self.x, np.diag(1 / self.sd)])
        return np.linalg.lstsq(rows, np.concatenate([self.y, self.mean / self.sd]), rcond=None)[0]

    def held(self):
        """The same with scale and offset not below zero at their positions, by the dual problem."""
        root = np.linalg.cholesky(self.x.T @ self.x + np.diag(1 / self.sd**2)).T
        ends = 0, self.first, len(self.mean)
        curves = block_diag(
            *(np.polynomial.chebyshev.chebvander(AT, b - a - 1) for a, b in pairwise(ends) if b > a)
        )
        free = self.least_squares()
        reach = np.linalg.solve(root.T, curves.T)
        forces, _ = nnls(reach, -root @ free)
        return free + np.linalg.solve(root, reach @ forces)

    def deviance(self):
        """−2 ln of the marginal likelihood of the whitened data, without the 2π's."""
        covariance = np.eye(POINTS) + (self.x * self.sd**2) @ self.x.T
        residual = self.y - self.x @ self.mean
        return residual @ np.linalg.solve(covariance, residual) + np.linalg.slogdet(covariance)[1]


CASES = [("free", None), (None, "free"), ("free", "free"), ("slow", None), ("slow", "free"), ("slow", "slow")]


def instrument(scale, offset) -> Instrument:
    return Instrument(scale or 1.0, offset or 0.0)


def lifted(scale):
    """Data whose offset is well above zero everywhere."""
    gain = (1.7 + 0.2 * POSITION) if scale else 1.0
    return gain * SIGNAL + 0.2 + 0.03 * POSITION + NOISE


@pytest.mark.parametrize(("scale", "offset"), CASES)
def test_equal_to_dense_least_squares(scale, offset):
    values = lifted(scale)
    dense = Dense(values, scale, offset)
    best = dense.least_squares()
    found = solved(SIGNAL, data(values), instrument(scale, offset))
    np.testing.assert_allclose(found.model, dense.known + dense.columns @ best, rtol=1e-10)
    if offset:
        shift = dense.columns[:, dense.first :] @ best[dense.first :]
        np.testing.assert_allclose(found.offset, shift, rtol=1e-8)
    if scale:
        gain = dense.columns[:, : dense.first] @ best[: dense.first] / SIGNAL
        np.testing.assert_allclose(found.gain, gain, rtol=1e-9)
    np.testing.assert_allclose(found.model, found.gain * SIGNAL + found.offset, rtol=1e-12)
    # the deviance is that of the marginal likelihood
    np.testing.assert_allclose(found.deviance, dense.deviance(), rtol=1e-9)
    # the residual contains the priors: its square is what the coefficients minimise
    expected = np.sum((dense.y - dense.x @ best) ** 2) + np.sum(((best - dense.mean) / dense.sd) ** 2)
    np.testing.assert_allclose(jnp.sum(found.residual**2), expected, rtol=1e-9)


def test_without_nuisances_the_deviance_is_chi2():
    values = 0.9 * SIGNAL + 0.1 + NOISE
    found = solved(SIGNAL, data(values), Instrument(0.9, 0.1))
    np.testing.assert_allclose(found.deviance, np.sum((WEIGHT * NOISE) ** 2) * FRACTION, rtol=1e-10)
    np.testing.assert_allclose(found.residual, WEIGHT * np.sqrt(FRACTION) * NOISE, atol=1e-12)


tilts = st.floats(-0.3, 0.3)


@settings(max_examples=60)
@given(level=tilts, tilt=tilts, bend=tilts, scale=st.sampled_from(["free", "slow"]))
def test_the_offset_is_never_negative_and_the_rest_is_the_best_under_that(level, tilt, bend, scale):
    values = 1.5 * SIGNAL + level + tilt * POSITION + bend * POSITION**2 + NOISE
    found = solved(SIGNAL, data(values), instrument(scale, "slow"))
    coefficients = np.polynomial.chebyshev.chebfit(POSITION, found.offset, 2)
    # between positions h apart a parabola is below its chord by p'' h²/8 at most, and T₂'' is 4
    assert np.min(found.offset) >= -(0.5**2) / 2 * abs(coefficients[2]) - 1e-5 * LEVEL
    dense = Dense(values, scale, "slow")
    expected = dense.known + dense.columns @ dense.held()
    np.testing.assert_allclose(found.model, expected, atol=2e-5)


def test_a_single_offset_below_zero_is_zero():
    values = 1.5 * SIGNAL - 0.1
    found = solved(SIGNAL, data(values), instrument("free", "free"))
    alone = solved(SIGNAL, data(values), instrument("free", None))
    np.testing.assert_allclose(found.offset, 0.0, atol=1e-6)
    np.testing.assert_allclose(found.gain, alone.gain, rtol=1e-5)


@pytest.mark.parametrize("scale", ["free", "slow"])
def test_fringes_upside_down_are_not_explained_by_a_negative_gain(scale):
    values = 0.5 - SIGNAL
    found = solved(SIGNAL, data(values), instrument(scale, "free"))
    right = solved(0.5 - SIGNAL, data(values), instrument(scale, "free"))
    assert found.deviance > right.deviance + 100
    assert np.min(found.gain) >= -1e-9


def test_a_gain_that_would_turn_negative_at_one_end_is_the_best_that_does_not():
    """Such a fit stays in the comparison: real lamps fade to nothing at the end of their range."""
    values = (0.9 - POSITION) * SIGNAL - 0.1
    found = solved(SIGNAL, data(values), instrument("slow", None))
    dense = Dense(values, "slow", None)
    best = dense.least_squares()
    assert np.min(dense.columns[:, : dense.first] @ best / SIGNAL) < -1e-3
    # signs hold at a few positions, between which a polynomial dips by less than this
    assert np.min(found.gain) >= -0.01 * np.max(found.gain)
    np.testing.assert_allclose(found.model, dense.columns @ dense.held(), atol=1e-5)


@pytest.mark.parametrize("bend", [(-0.47, 0.28, 0.08), (0.3, 0.3, -0.05), (0.0, 0.9, 0.0)])
def test_a_positive_lamp_that_bends_upwards_is_free(bend):
    """Bernstein coefficients of the first are below zero, though it is 0.6 at least."""
    values = 1.3 * np.polynomial.chebyshev.chebval(POSITION, [1, *bend]) * SIGNAL + NOISE
    dense = Dense(values, "slow", None)
    found = solved(SIGNAL, data(values), instrument("slow", None))
    np.testing.assert_allclose(found.model, dense.columns @ dense.least_squares(), rtol=1e-9)


@pytest.mark.parametrize(
    "shift",
    [0.2, -0.2, (POSITION - 0.1) ** 2 - 0.1],
    ids=["offset free", "offset held at zero", "offset touches zero inside"],
)
@pytest.mark.parametrize(("scale", "offset"), [("free", "free"), ("slow", "slow")])
def test_derivative_of_the_residual(scale, offset, shift):
    """What the solver steps by, against central differences: no factorisation is differentiated."""
    values = 1.7 * SIGNAL + shift + NOISE
    direction = np.sin(5 * POSITION)

    def residual(t):
        return solved(SIGNAL + t * direction, data(values), instrument(scale, offset)).residual

    _, slope = jax.jvp(residual, (0.0,), (1.0,))
    expected = derivative(residual, 0.0, 1e-5)
    np.testing.assert_allclose(slope, expected, atol=1e-5 * np.max(np.abs(slope)))


@pytest.mark.parametrize(("scale", "offset"), [("free", "free"), ("slow", "slow")])
def test_points_of_zero_weight_change_nothing(scale, offset):
    """Spectra are padded to round lengths with such points."""
    values, off = lifted(scale), np.arange(POINTS) >= 50
    weight = np.where(off, 0.0, WEIGHT)
    found = solved(SIGNAL, data(values, weight), instrument(scale, offset))
    other = solved(
        np.where(off, 0.9, SIGNAL), data(np.where(off, 5.0, values), weight), instrument(scale, offset)
    )
    np.testing.assert_allclose(found.deviance, other.deviance, rtol=1e-12)
    np.testing.assert_allclose(found.offset, other.offset, rtol=1e-9)
    np.testing.assert_allclose(found.gain, other.gain, rtol=1e-9)
