"""Weights of lobes against SciPy's nonnegative least squares of each lobe alone."""

import numpy as np
import pytest
from scipy.optimize import nnls

import pellicle as pl
from pellicle.data.brdf_samples import BrdfSamples
from pellicle.fitting.brdf.problem import make, without_layer
from pellicle.fitting.brdf.search import scan
from pellicle.fitting.problem import Problem
from pellicle.scene.free import Free
from pellicle.scene.surface import Surface

SURFACE = Surface(
    "microfacet-film", {"roughness": Free(0.003, 1), "specular": Free(0, 100), "diffuse": Free(0, 2)}
)


@pytest.fixture(scope="module")
def layered() -> Problem:
    """Values of either sign around the model's, so that some best weights are 0."""
    rng = np.random.default_rng(1)
    theta_i = np.repeat([20.0, 40.0, 60.0], 20)
    theta_o = theta_i + np.tile(np.linspace(-12, 12, 20), 3)
    values = np.abs(0.2 + 0.3 * rng.standard_normal((60, 3)))
    zero = np.zeros(60)
    data = BrdfSamples(
        theta_i, zero, theta_o, zero + 180, values, ("R", "G", "B"), sigma=rng.uniform(0.1, 0.3, (60, 3))
    )
    return make([data], [""], SURFACE, [pl.plan(SURFACE, directions=data)], "linear")


def expected(problem: Problem, shapes: np.ndarray) -> tuple[np.ndarray, float]:
    """The best weights at values `shapes` of the other numbers, in their own units, and χ²."""
    [view] = problem.views
    count = len(problem.parameters) - len(shapes)
    weights, chi2 = np.zeros(count), 0.0

    def residuals(weights):
        rows = view.residuals(view.local(np.concatenate([shapes, weights])))
        return rows if count > 2 else rows.reshape(-1, 1)  # grey: one problem of all channels

    data = residuals(weights)
    lobes = np.array([data - residuals(one) for one in np.eye(count)])
    groups = data.shape[1]
    for channel in range(groups):
        own = slice(channel, None, groups)
        weights[own], norm = nnls(lobes[own, :, channel].T, data[:, channel])
        chi2 += norm**2
    return weights, chi2


@pytest.mark.slow
@pytest.mark.parametrize("kind", [lambda p: p, without_layer], ids=["layer", "two lobes"])
def test_weights_are_the_nonnegative_least_squares(layered, kind):
    """Of all channels together where a weight is grey, else of each channel."""
    problem = kind(layered)
    [view] = problem.views
    size = 1 if kind is not without_layer else 3
    units = np.random.default_rng(2).random((12, size))
    solved = scan((problem.coordinates, view.form), *view.arrays, problem.box, units)
    lower, upper = problem.box.lower[size:], problem.box.upper[size:]
    on_zero = 0
    for unit, chi2, weights in zip(units, solved.chi2, np.asarray(solved.weights), strict=True):
        shapes = np.asarray(problem.values(np.concatenate([unit, weights])))[:size]
        best, least = expected(problem, shapes)
        np.testing.assert_allclose(lower + weights * (upper - lower), best, atol=1e-6 * (1 + best.max()))
        assert float(chi2) == pytest.approx(least, rel=1e-8)
        on_zero += np.count_nonzero(best == 0)
    assert 0 < on_zero < 12 * len(lower)
