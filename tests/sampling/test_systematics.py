"""Systematic effects in a posterior: against explicit covariances, and against the errors of a fit."""

import dataclasses
from typing import NamedTuple

import jax
import numpy as np
import pytest

import pellicle as pl
from pellicle.fitting.linear_system import Effect, Evidence
from pellicle.fitting.problem import Explained
from pellicle.sampling.density import systematics

from ..by_tmm import films
from ..differences import jacobian

ROWS = 30
X = np.linspace(-1.0, 1.0, ROWS)
SIGMA = 0.02
CHANGES = {"shift": 0.05 * np.exp(X), "bend": 0.1 * X**2}
NUISANCES = np.stack([0.3 * np.ones(ROWS), 0.2 * X], axis=1)
"""Changes by one standard deviation of the priors of scale and offset: they follow a part of both effects."""


class View(NamedTuple):
    """A linear model of no parameters: its residuals, effects and nuisances, in the unit of the data."""

    residual: np.ndarray
    effects: tuple[Effect, ...]
    nuisances: np.ndarray
    share: float

    @property
    def evidence(self) -> Evidence:
        sigma = np.full((ROWS, 1), SIGMA)
        columns = self.nuisances[:, None, :]
        return Evidence(np.zeros((ROWS, 1)), columns, sigma, SIGMA, 1 / sigma, self.effects, lambda rest: 1.0)

    @property
    def explained(self) -> Explained:
        """With nuisances at their best under their priors, as a fit has them, after four rows of padding."""
        matrix = np.vstack([self.nuisances / SIGMA, np.eye(self.nuisances.shape[1])])
        data = np.concatenate([self.residual / SIGMA, np.zeros(self.nuisances.shape[1])])
        rest = data - matrix @ np.linalg.lstsq(matrix, data, rcond=None)[0]
        # of a prior the residual is the coefficient less its mean
        padded = np.concatenate([rest[:ROWS], np.zeros(4), -rest[ROWS:]])
        return Explained(np.zeros(ROWS), padded, np.asarray(np.sum(rest**2)))


def effect(name: str, shared: bool = True) -> Effect:
    return Effect(name, 1.0, "", CHANGES[name][:, None], shared=shared)


def explicit(views: list[View], sources: list[list[int]]) -> float:
    """rᵀ C⁻¹ r of all views, where each of the `sources` of a view is a number of a standard effect."""
    size = ROWS * len(views)
    covariance, columns = np.zeros((size, size)), np.zeros((size, 4))
    for i, (view, own) in enumerate(zip(views, sources, strict=True)):
        rows = slice(i * ROWS, (i + 1) * ROWS)
        noise = SIGMA**2 * np.eye(ROWS) + view.nuisances @ view.nuisances.T
        covariance[rows, rows] = noise / view.share
        for each, at in zip(view.effects, own, strict=True):
            columns[rows, at] = each.change[:, 0]
    residual = np.concatenate([view.residual for view in views])
    return float(residual @ np.linalg.solve(covariance + columns @ columns.T, residual))


def deviance(views: list[View]) -> float:
    shares, evidence = [view.share for view in views], [view.evidence for view in views]
    with jax.enable_x64(True):
        effects = systematics(evidence, shares, [1] * len(views), 0)
        return float(effects.deviance([view.explained for view in views]) - effects.volume)


def residual(seed: int) -> np.ndarray:
    return 0.1 * np.random.default_rng(seed).standard_normal(ROWS)


@pytest.mark.parametrize("nuisances", [np.zeros((ROWS, 0)), NUISANCES])
@pytest.mark.parametrize("share", [1.0, 0.3])
def test_the_likelihood_is_that_of_a_dense_covariance(nuisances, share):
    view = View(residual(1), (effect("shift"), effect("bend")), nuisances, share)
    assert deviance([view]) == pytest.approx(explicit([view], [[0, 1]]), rel=1e-9)


def test_the_volume_is_that_of_a_dense_covariance():
    view = View(residual(1), (effect("shift"), effect("bend")), np.zeros((ROWS, 0)), 1.0)
    columns = np.stack([CHANGES["shift"], CHANGES["bend"]], axis=1) / SIGMA
    expected = np.linalg.slogdet(np.eye(ROWS) + columns @ columns.T)[1]
    assert systematics([view.evidence], [1.0], [1], 0).volume == pytest.approx(expected, rel=1e-9)


def test_effects_explain_no_more_than_there_is():
    """Far from the best fit the scale follows another signal than the one that the effects were taken at."""
    here = View(0.0 * X, (effect("shift"), effect("bend")), 100 * NUISANCES, 1.0)
    far = here._replace(residual=X**2, nuisances=100 * np.stack([X**3, np.cos(9 * X)], axis=1))
    with jax.enable_x64(True):
        effects = systematics([here.evidence], [1.0], [1], 0)
        assert effects.deviance([far.explained]) > effects.volume


def test_without_effects_the_likelihood_is_that_of_the_noise():
    view = View(residual(1), (), np.zeros((ROWS, 0)), 1.0)
    assert deviance([view]) == pytest.approx(np.sum((view.residual / SIGMA) ** 2), rel=1e-12)


def test_an_effect_of_the_sample_is_the_same_in_all_views():
    """But one of the instrument has a value in each."""
    views = [
        View(residual(1), (effect("shift"), effect("bend", shared=False)), NUISANCES, 0.5),
        View(residual(2), (effect("bend", shared=False), effect("shift")), np.zeros((ROWS, 0)), 1.0),
    ]
    assert deviance(views) == pytest.approx(explicit(views, [[0, 1], [2, 0]]), rel=1e-9)


def reflectance(nm: np.ndarray, thickness: float, index: float = 1.46) -> np.ndarray:
    """R of the film, by the tmm package."""
    return films("s", nm, [1.0, index, 3.9 + 0.02j], [thickness])


@pytest.mark.slow  # two posteriors
@pytest.mark.parametrize("uncertainty", [0.02, 0.0])
def test_an_uncertain_index_widens_a_posterior_as_it_does_the_error(bands, film, uncertainty):
    """Data without noise, but with its σ: the values need no shift."""
    data = bands(530.0, 0.004)
    scene = film(430.0, 630.0)
    fixed = dataclasses.replace(scene, layers=(pl.Layer(1.46, 530.0),))
    clean = pl.Spectrum(data.wavelength, pl.simulate(fixed, data.wavelength).values, "R", sigma=data.sigma)
    layer = dataclasses.replace(scene.layers[0], index_uncertainty=uncertainty)
    posterior = pl.sample(clean, dataclasses.replace(scene, layers=(layer,)))
    estimate = posterior.fit["thickness"]
    # least squares of thickness and index, of which the latter has a normal prior
    slopes = jacobian(lambda x: reflectance(data.wavelength, x[0], 1.46 * x[1]), [530.0, 1.0], 1e-4) / 0.004
    normal = slopes.T @ slopes + np.diag([0.0, 1 / max(uncertainty, 1e-9) ** 2])
    expected = np.sqrt(np.linalg.inv(normal)[0, 0])
    assert posterior.trusted
    assert estimate.stderr == pytest.approx(expected, rel=0.02)
    assert estimate.stderr_noise == pytest.approx(1 / np.sqrt(normal[0, 0]), rel=0.02)
    assert (estimate.stderr > 3 * estimate.stderr_noise) == bool(uncertainty)
    # the sd of a chain of 50 autocorrelation times and 32 walkers is known to 2 %
    assert posterior["thickness"].sd == pytest.approx(expected, rel=0.08)


@pytest.mark.slow
def test_effects_bring_back_minima_that_noise_rules_out(bands, film):
    """Scale, its slope and curvature, and offset are badly known: five bands are next to one number.

    By noise alone the second thickness has a Δχ² of 76, with the effects a tenth of the posterior.
    """
    data, noise, scale, offset = bands(650.0, 0.01), 0.01, 0.2, 0.1
    allowed = dataclasses.replace(pl.Uncertainty.none(), scale=scale, offset=offset)
    posterior = pl.sample(data, dataclasses.replace(film(), uncertainty=allowed))
    grid = np.arange(50.0, 1500.5)
    residual = data.values - np.array([reflectance(data.wavelength, d) for d in grid])
    alone = np.sum(residual**2, axis=1) / noise**2
    best = reflectance(data.wavelength, grid[np.argmin(alone)])
    x = (data.wavelength - 625.0) / 175.0
    columns = [scale * best, scale * best * x, scale / 2 * best * (2 * x**2 - 1), np.full(5, offset)]
    covariance = noise**2 * np.eye(5) + sum(np.outer(own, own) for own in columns)
    chi2 = np.einsum("gi,ij,gj->g", residual, np.linalg.inv(covariance), residual)
    weight = np.exp(-0.5 * (chi2 - chi2.min()))
    expected = weight[abs(grid - 421.0) < 60].sum() / weight.sum()
    assert alone[grid == 421.0] - alone.min() > 60
    assert expected > 0.05
    assert posterior.trusted
    # 2000 independent draws know a share to ± 0.01
    drawn = posterior.draws[..., 0]
    assert np.mean(abs(drawn - 421.0) < 60) == pytest.approx(expected, abs=0.04)
