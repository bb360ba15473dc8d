"""Smoother of a series against dense Gaussian conditioning, which knows no state space."""

import numpy as np
import pytest

from pellicle.mapping.state_space import Quadratics, Smoothed, smooth


def wiener(s, t, states, rate=(0, 0)):
    """Covariance of the derivatives `rate` of a Wiener process integrated states − 1 times from 0:
    the integral of (s − u)ⁿ⁻¹ (t − u)ᵐ⁻¹ over u, by Gauss and Legendre, exact for polynomials."""
    from math import factorial

    nodes, weights = np.polynomial.legendre.leggauss(8)
    end = np.minimum(s, t)[..., None]
    u, w = 0.5 * end * (nodes + 1), 0.5 * end * weights
    powers = [states - 1 - r for r in rate]
    terms = [(x[..., None] - u) ** p / factorial(p) for x, p in zip((s, t), powers, strict=True)]
    return np.sum(w * terms[0] * terms[1], axis=-1)


@pytest.mark.parametrize("states", [2, 3])
def test_values_rates_and_errors_are_those_of_all_times_together(states):
    """A slowly varying and a shared parameter, seen in one combination at each time; a break between."""
    rng = np.random.default_rng(3)
    t = np.array([0.0, 1.0, 2.5, 3.0, 4.2, 5.0, 7.0, 8.0])
    breaks = np.arange(8) == 5
    rows = np.stack([np.ones(8), rng.uniform(-1, 1, 8)], axis=1)
    sigma, y, power, fastest = 0.02, rng.uniform(0.3, 0.7, 8), 1e-3, 0.4
    information = rows[:, :, None] * rows[:, None, :] / sigma**2
    vector = rows * y[:, None] / sigma**2
    like = Smoothed(*[np.zeros(0)] * 6, derivatives=states, stiffness=np.array([np.log10(power)]))
    pushed = rng.uniform(-1, 1, (8, 3))  # changes of y by three effects
    pushes = rows[:, :, None] * pushed[:, None, :] / sigma**2
    quadratics = Quadratics(vector, information, pushes)
    found = smooth(t, quadratics, ("slowly", "shared"), breaks, fastest, like)

    part = np.cumsum(breaks)
    unit = np.median(np.diff(t))
    since = (t - np.array([t[part == p][0] for p in part])) / unit
    a, b = np.meshgrid(since, since, indexing="ij")
    same = part[:, None] == part[None, :]

    def covariance(i, j):
        """Prior covariance of the i-th and j-th derivative; those at a start have their own variance."""
        start = [
            (1.0 if k == 0 else fastest**2)
            * np.where(k >= i, a ** max(k - i, 0) / max(1, [1, 1, 2][max(k - i, 0)]), 0)
            * np.where(k >= j, b ** max(k - j, 0) / max(1, [1, 1, 2][max(k - j, 0)]), 0)
            for k in range(states)
        ]
        return np.where(same, power * wiener(a, b, states, (i, j)) + sum(start), 0.0)

    shared = np.ones((8, 8))
    prior = np.block([[covariance(0, 0), np.zeros((8, 8))], [np.zeros((8, 8)), shared]])
    design = np.concatenate([np.diag(rows[:, 0]), np.diag(rows[:, 1])], axis=1)
    seen = design @ prior @ design.T + sigma**2 * np.eye(8)
    off = y - 0.5 * rows.sum(axis=1)
    gain = prior @ design.T @ np.linalg.inv(seen)
    mean, left = 0.5 + gain @ off, prior - gain @ design @ prior
    np.testing.assert_allclose(found.mean[:, 0], mean[:8], rtol=1e-8)
    np.testing.assert_allclose(found.mean[:, 1], mean[8:], rtol=1e-8)
    np.testing.assert_allclose(found.variance[:, 0], np.diag(left)[:8], rtol=1e-6)
    np.testing.assert_allclose(found.variance[:, 1], np.diag(left)[8:], rtol=1e-6)
    cross = np.concatenate([covariance(1, 0), np.zeros((8, 8))], axis=1) @ design.T
    rate = cross @ np.linalg.solve(seen, off)
    spread = np.diag(covariance(1, 1) - cross @ np.linalg.solve(seen, cross.T))
    np.testing.assert_allclose(found.rate[:, 0] * unit, rate, rtol=1e-7)
    np.testing.assert_allclose(found.rate_variance[:, 0] * unit**2, spread, rtol=1e-5)
    systematic = np.sum((gain @ pushed) ** 2, axis=1)
    np.testing.assert_allclose(found.systematic.T.ravel(), systematic, rtol=1e-7)
    of_rate = np.sum((cross @ np.linalg.solve(seen, pushed)) ** 2, axis=1)
    np.testing.assert_allclose(found.rate_systematic[:, 0] * unit**2, of_rate, rtol=1e-7)


@pytest.mark.slow
def test_the_stiffness_is_that_of_the_data():
    """The noise of a straight line is averaged; a wave is followed; errors cover both."""
    rng, t = np.random.default_rng(4), np.linspace(0, 10, 300)
    for truth in (0.3 + 0.03 * t, 0.5 + 0.2 * np.sin(3 * t)):
        y = truth + 0.01 * rng.standard_normal(300)
        quadratics = Quadratics((y / 1e-4)[:, None], np.full((300, 1, 1), 1e4), np.zeros((300, 1, 0)))
        found = smooth(t, quadratics, ("slowly",), np.zeros(300, bool), 0.1)
        off = (found.mean[:, 0] - truth) / np.sqrt(found.variance[:, 0])
        assert np.abs(off).max() < 4
        assert np.median(np.sqrt(found.variance)) < 0.004


def test_a_freely_varying_parameter_has_the_error_of_its_time():
    t, sigma = np.arange(5.0), np.array([0.1, 0.2, 0.1, 0.3, 0.1])
    quadratics = Quadratics((0.4 / sigma**2)[:, None], (1 / sigma**2)[:, None, None], np.zeros((5, 1, 0)))
    found = smooth(t, quadratics, ("freely",), np.zeros(5, bool), 0.1)
    np.testing.assert_allclose(found.variance[:, 0], 1 / (1 / sigma**2 + 1), rtol=1e-10)


def test_a_kink_is_followed_by_a_stiff_smoother():
    """Two straight lines that meet within the step that may bend."""
    t, sigma = np.arange(40.0), 1e-3
    true = 0.3 + 0.01 * np.minimum(t, 20.4) - 0.005 * np.maximum(t - 20.4, 0)
    seen = true + sigma * np.random.default_rng(0).standard_normal(40)
    quadratics = Quadratics(seen[:, None] / sigma**2, np.full((40, 1, 1), sigma**-2), np.zeros((40, 1, 0)))
    like = Smoothed(*[np.zeros(0)] * 6, derivatives=2, stiffness=np.array([-12.0]))
    about = t, quadratics, ("slowly",), np.zeros(40, bool), 0.1, like
    bent = smooth(*about, kinks=1e-4 * (t == 21))
    off = (bent.mean - true[:, None]) / np.sqrt(bent.variance)
    assert np.abs(off).max() < 4
    np.testing.assert_allclose(
        bent.rate[[5, 35], 0], [0.01, -0.005], atol=4 * bent.rate_variance.max() ** 0.5
    )
    assert np.abs(smooth(*about).mean - true[:, None]).max() > 20 * np.abs(bent.mean - true[:, None]).max()
