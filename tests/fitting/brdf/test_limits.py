"""Limits beside bounds against SciPy: each number fixed, the others fitted again to the same samples."""

import dataclasses
import math

import jax
import numpy as np
import pytest
from scipy.optimize import brentq, least_squares

import pellicle as pl
from pellicle.api.fits import fit
from pellicle.brdf import direction, model
from pellicle.data.brdf_samples import BrdfSamples
from pellicle.fitting import conclusion as shared
from pellicle.fitting.brdf import fit as module
from pellicle.fitting.profile_likelihood import Limits
from pellicle.fitting.progress import quiet
from pellicle.fitting.result import Status
from pellicle.fitting.reweighting import linearised
from pellicle.scene.free import Free
from pellicle.scene.surface import Surface

from .conftest import GREY
from .known_surface import from_all_sides, search_from

pytestmark = pytest.mark.slow  # compiles for seconds

TRUTH = GREY | {"n": (1.5,), "exponent_transmission": 1000.0, "diffuse": 0.3, "wavelengths": (550.0,)}
BOUNDS = {"exponent_transmission": (1.0, 1000.0), "deviation": (0.0, 20.0), "specular": (0.0, 100.0)}
FREE = {key: Free(lower, upper) for key, (lower, upper) in BOUNDS.items()}
FIXED = {key: x for key, x in TRUTH.items() if key not in (*FREE, "wavelengths")}
EXACT = pl.SurfaceUncertainty.none()
SURFACE = Surface("granier-heidrich", {**FIXED, **FREE}, (550.0,), uncertainty=EXACT)
WIDE = {"exponent_transmission": 100.0, "specular": 1.5}
SIGMA = 0.1


@pytest.fixture(scope="module")
def simulated():
    """Samples in a plane around the mirror direction, noisy enough for neither bound to be ruled out."""
    theta_i = np.repeat([20.0, 40.0, 60.0], 40)
    theta_o = theta_i + np.tile(np.linspace(-12, 12, 40), 3)
    zero = np.zeros(120)
    i, o = direction(theta_i, zero), direction(theta_o, zero + 180)
    rho = jax.jit(lambda p: model("granier-heidrich")({**TRUTH, **p}, i, o))
    values = rho({}) + SIGMA * np.random.default_rng(2).standard_normal((120, 1))
    samples = BrdfSamples(
        theta_i, zero, theta_o, zero + 180, np.abs(values), ("value",), np.full((120, 1), SIGMA)
    )
    return samples, rho


@pytest.fixture(scope="module")
def judged(simulated):
    """The fit below one start, without a search, and its minima."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "search", search_from([0.3] * 3))
        return module.fitted(simulated[0], SURFACE, 0.0, quiet)


def profile(simulated, name):
    """χ² against one number, by SciPy."""
    samples, rho = simulated
    others = [key for key in BOUNDS if key != name]
    ends = np.array([BOUNDS[key] for key in others]).T

    def residual(x, value):
        values = np.asarray(rho({name: value, **dict(zip(others, x, strict=True))}))
        return (values - samples.values).ravel() / SIGMA

    def chi2(value):
        start = [TRUTH[key] for key in others]
        best = least_squares(residual, start, bounds=ends, args=(value,), x_scale=(100, 1)[: len(others)])
        return 2 * best.cost

    return chi2


@pytest.mark.parametrize(("name", "side"), [("deviation", 1), ("exponent_transmission", -1)])
def test_a_limit_is_where_the_profile_has_risen(simulated, judged, name, side):
    p, chi2 = judged[0][name], profile(simulated, name)
    [view_fit] = judged[1].fits
    assert math.isfinite(p.stderr)
    best = chi2(p.value)
    end = BOUNDS[name][int(side > 0)]
    far = p.value + side * min(6 * p.stderr, abs(end - p.value))
    expected = brentq(lambda x: chi2(x) - best - 2.71 * view_fit.variance, p.value, far, xtol=1e-3)
    limit, other = (p.upper_limit, p.lower_limit) if side > 0 else (p.lower_limit, p.upper_limit)
    assert limit == pytest.approx(expected, rel=0.02)
    assert other is None


@pytest.fixture(scope="module")
def turned():
    """A deviation of 8 degrees at an azimuth of 60, seen at incidences around the normal."""
    surface = Surface("granier-heidrich", {**FIXED, "deviation": 8.0, "azimuth": 60.0, **WIDE}, (550.0,))
    return pl.simulate(surface, directions=from_all_sides(("value",)), noise=0.01)


@pytest.mark.parametrize(
    ("tilt", "azimuth", "stderr"),
    [
        (Limits(0.1), Limits(3.0), 3.0),
        (Limits(0.1, upper=0.3), Limits(3.0), math.inf),  # there may be no tilt: its azimuth means nothing
        (Limits(math.inf), Limits(3.0), math.inf),
        (Limits(0.1), Limits(math.inf, -20.0), math.inf),  # and a whole turn has no sides
    ],
)
def test_the_azimuth_of_a_tilt(monkeypatch, turned, tilt, azimuth, stderr):
    free = {"deviation": Free(0, 20), "azimuth": Free(-180, 180)}
    surface = Surface("granier-heidrich", {**FIXED, **WIDE, **free}, (550.0,), uncertainty=EXACT)
    monkeypatch.setattr(module, "search", search_from([0.6, 0.7]))
    of_one_fit = [np.array([pair], float) for pair in zip(tilt, azimuth, strict=True)]
    monkeypatch.setattr(shared, "limits", lambda *arguments: Limits(*of_one_fit))
    result = fit(turned, surface)
    assert result["deviation"].value == pytest.approx(8.0, abs=0.1)
    estimate = result["azimuth"]
    assert estimate.value == pytest.approx(60.0, abs=2.0)
    # a minimum is found to a part of the error: the distance to it counts
    assert estimate.stderr == pytest.approx(stderr, rel=1e-6)
    assert (estimate.lower_limit, estimate.upper_limit, estimate.at_bound) == (None, None, False)


def test_of_a_misfit_no_limits_are_sought(monkeypatch, simulated):
    """Values of another shape altogether, with a σ that no model can reach: errors of the noise are those of
    the covariance, and residuals enlarge them."""
    samples, _ = simulated
    off = dataclasses.replace(samples, values=np.random.default_rng(0).random((120, 1)) * 100)
    monkeypatch.setattr(module, "search", search_from([0.3] * 3))
    monkeypatch.setattr(shared, "limits", lambda *arguments: pytest.fail("a profile was made"))
    result, ranked = module.fitted(off, SURFACE, 0.0, quiet)
    assert result.status is Status.MISFIT
    _, errors = linearised(ranked)
    for name in BOUNDS:
        assert (result[name].lower_limit, result[name].upper_limit) == (None, None)
        assert result[name].stderr_noise in (errors.stderr[errors.names.index(name)], math.inf)
        assert result[name].stderr >= 0.9 * math.sqrt(result.chi2_reduced) * result[name].stderr_noise
