"""A few outliers move a plain fit and not a robust one; errors stay honest."""

import dataclasses

import numpy as np
import pytest
from scipy.optimize import least_squares

import pellicle as pl
from pellicle.fitting.robust_losses import LOSSES, inflation, spread

from ..airy import airy
from ..differences import derivative

INDEX = pl.dispersion.Constant(pl.Free(1.3, 1.7))
TRUTH = (1.46, 430.0)


def spoiled(data, seed):
    """13 of 128 points (10 %) too bright by 0.1 to 0.3."""
    random = np.random.default_rng(seed)
    values = data.values.copy()
    values[random.choice(values.size, 13, replace=False)] += random.uniform(0.1, 0.3, 13)
    return dataclasses.replace(data, values=values)


@pytest.mark.parametrize("loss", ["huber", "student-t"])
@pytest.mark.parametrize("sigma", [True, False])
def test_outliers_move_the_plain_fit_and_not_the_robust_one(film, measured, loss, sigma):
    scene = film(material=INDEX)
    data = spoiled(measured(scene, *TRUTH, sigma=sigma), 1)
    plain, robust = pl.fit(data, scene), pl.fit(data, scene, loss=loss)
    assert abs(plain["thickness"].value - 430) > 10
    assert robust.status == "converged"
    assert robust["thickness"].stderr_noise < 1
    for name, truth in zip(("n", "thickness"), TRUTH, strict=True):
        assert abs(robust[name].value - truth) < 3 * robust[name].stderr_noise
    assert any("count for less than half" in warning for warning in robust.warnings)


def test_huber_as_scipy_has_it(film, measured):
    """The same minimum as SciPy's own Huber loss finds, of Airy's formula written out."""
    scene = film(material=INDEX)
    data = spoiled(measured(scene, *TRUTH, sigma=True), 2)

    def residual(p):
        return (data.values - airy(data.wavelength, 100 * p[1], p[0], 3.9 + 0.02j)) / data.sigma

    theirs = least_squares(residual, [1.46, 4.3], loss="huber", f_scale=1.345, xtol=1e-12, ftol=1e-12).x
    ours = pl.fit(data, scene, loss="huber")
    assert ours["n"].value == pytest.approx(theirs[0], abs=0.05 * ours["n"].stderr)
    assert ours["thickness"].value == pytest.approx(100 * theirs[1], abs=0.05 * ours["thickness"].stderr)


@pytest.mark.parametrize("name", list(LOSSES))
def test_weight_and_curvature_are_derivatives_of_the_loss(name):
    loss, z = LOSSES[name], np.array([-7.0, -1.5, -0.3, 0.2, 1.1, 4.0])
    np.testing.assert_allclose(loss.weight(z) * z, derivative(loss.loss, z, 1e-5), rtol=1e-6)
    bent = derivative(lambda z: loss.weight(z) * z, z, 1e-5)
    np.testing.assert_allclose(loss.curvature(z), bent, atol=1e-6)


def test_spread_and_inflation_of_normal_noise():
    z = np.random.default_rng(3).normal(size=100_000)
    assert spread(5 * z) == pytest.approx(5, rel=0.02)
    # the mean of a normal sample by Huber's loss has a variance of 1/0.95 (Huber 1981, exhibit 4.1)
    huber = LOSSES["huber"]
    variance = inflation(huber, z) / np.mean(huber.weight(z))
    assert variance == pytest.approx(1 / 0.95, rel=0.01)
