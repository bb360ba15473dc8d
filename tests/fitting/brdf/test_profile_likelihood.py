"""Limits beside bounds against SciPy: each number held, the others fitted again to the same samples."""

from __future__ import annotations

import dataclasses
import math

import jax
import numpy as np
import pytest
from scipy.optimize import brentq, least_squares

from pellicle.brdf import direction, model
from pellicle.data.brdf_samples import BrdfSamples
from pellicle.fitting.brdf import estimates, fit
from pellicle.fitting.brdf.problem import polished
from pellicle.fitting.brdf.search import Minima
from pellicle.fitting.profile_likelihood import Limits
from pellicle.fitting.result import Status
from pellicle.scene.free import Free
from pellicle.scene.surface import Surface

TRUTH = {
    "thickness": 320.0,
    "n": (1.5,),
    "exponent_reflection": 60.0,
    "exponent_transmission": 1000.0,
    "deviation": 0.0,
    "azimuth": 0.0,
    "specular": 1.5,
    "diffuse": 0.3,
    "wavelengths": (550.0,),
}
BOUNDS = {"exponent_transmission": (1.0, 1000.0), "deviation": (0.0, 20.0), "specular": (0.0, 100.0)}
FREE = {key: Free(lower, upper) for key, (lower, upper) in BOUNDS.items()}
HELD = {key: x for key, x in TRUTH.items() if key not in (*FREE, "wavelengths")}
SIGMA = 0.1


@pytest.fixture(scope="module")
def seen():
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
def found(seen):
    samples, _ = seen
    surface = Surface("granier-heidrich", {**HELD, **FREE}, (550.0,))
    whole = fit.problem(samples, surface, "linear", surface.brdf.evaluate)
    units, _, converged = polished(*whole.program, np.full((1, 3), 0.3))
    assert converged[0]
    at = estimates.local(whole, np.asarray(units[0]), sigma_known=True)
    known = estimates.by_profile(surface, whole, at)
    return estimates.estimates(surface, whole, at, known), at


def profile(seen, name):
    """χ² against one number, by SciPy."""
    samples, rho = seen
    others = [key for key in BOUNDS if key != name]
    ends = np.array([BOUNDS[key] for key in others]).T

    def residual(x, value):
        return (
            np.asarray(rho({name: value, **dict(zip(others, x, strict=True))})) - samples.values
        ).ravel() / SIGMA

    def chi2(value):
        start = [TRUTH[key] for key in others]
        return (
            2
            * least_squares(residual, start, bounds=ends, args=(value,), x_scale=(100, 1)[: len(others)]).cost
        )

    return chi2


@pytest.mark.parametrize(("name", "side"), [("deviation", 1), ("exponent_transmission", -1)])
def test_a_limit_is_where_the_profile_has_risen(seen, found, name, side):
    parameters, at = found
    p, chi2 = parameters[name], profile(seen, name)
    assert math.isfinite(p.stderr)
    best = chi2(p.value)
    end = BOUNDS[name][int(side > 0)]
    far = p.value + side * min(6 * p.stderr, abs(end - p.value))
    truth = brentq(lambda x: chi2(x) - best - 2.71 * at.variance, p.value, far, xtol=1e-3)
    limit, other = (p.upper_limit, p.lower_limit) if side > 0 else (p.lower_limit, p.upper_limit)
    assert limit == pytest.approx(truth, rel=0.02)
    assert other is None


TILTED = Surface(
    "granier-heidrich",
    {"deviation": Free(0, 20), "azimuth": Free(-180, 180)},
    (550.0,),
)


@pytest.mark.parametrize(
    ("tilt", "azimuth", "stderr"),
    [
        (Limits(0.1), Limits(3.0), 3.0),
        (Limits(0.1, None, 0.3), Limits(3.0), math.inf),  # no tilt may be all: its azimuth means nothing
        (Limits(math.inf), Limits(3.0), math.inf),
        (Limits(0.1), Limits(math.inf, -20.0, None), math.inf),  # and a whole turn has no sides
    ],
)
def test_the_azimuth_of_a_tilt(monkeypatch, tilt, azimuth, stderr):
    phi = np.repeat([120.0, 200.0], 20)
    samples = BrdfSamples(phi / 4, 0 * phi, phi / 5, phi, np.ones((40, 1)), ("value",))
    whole = fit.problem(samples, TILTED, "linear", TILTED.brdf.evaluate)
    at = estimates.local(whole, np.array([0.7, 0.5]), sigma_known=False)
    monkeypatch.setattr(estimates, "limits", lambda around: [tilt, azimuth])
    known = estimates.by_profile(TILTED, whole, at)
    found = estimates.estimates(TILTED, whole, at, known)["azimuth"]
    assert found.stderr == stderr
    assert (found.lower_limit, found.upper_limit, found.at_bound) == (None, None, False)


def test_of_a_misfit_no_limits_are_sought(monkeypatch, seen):
    """Values of another shape altogether, with a σ that no model can reach."""
    samples, _ = seen
    surface = Surface("granier-heidrich", {**HELD, **FREE}, (550.0,))
    off = dataclasses.replace(samples, values=np.random.default_rng(0).random((120, 1)) * 100)
    whole = fit.problem(off, surface, "linear", surface.brdf.evaluate)
    units, chi2, _ = polished(*whole.program, np.full((1, 3), 0.3))
    minima = Minima(np.asarray(units), np.asarray(chi2), np.array([True]))
    at = estimates.local(whole, minima.units[0], sigma_known=True)
    monkeypatch.setattr(estimates, "limits", lambda around: pytest.fail("a profile was made"))
    status, parameters = fit.judged(surface, whole, minima, at, (), sigma_known=True)
    assert status is Status.MISFIT
    for name in BOUNDS:
        assert (parameters[name].lower_limit, parameters[name].upper_limit) == (None, None)
    expected = at.stderr[at.names.index("specular")]
    assert parameters["specular"].stderr in (expected, math.inf)
