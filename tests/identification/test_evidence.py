"""Numbers within their bounds in the linear model of an attempt, against SciPy."""

import numpy as np
from scipy.optimize import lsq_linear

import pellicle as pl
from pellicle.identification.evidence import System, weigh
from pellicle.identification.problem import Attempt, Problem
from pellicle.identification.search import polished
from pellicle.identification.signal_view import SignalView
from pellicle.identification.structure import Material, Structure
from tests import by_tmm


def test_numbers_stay_within_their_bounds():
    """The best point of a Cauchy film whose B would leave its bounds, and of effects."""
    structure = Structure((Material("cauchy", 3000.0),))
    rng = np.random.default_rng(3)
    span = structure.upper - structure.lower
    x = structure.lower + span * [0.2, 0.3, 0.001]
    matrix, prior = rng.normal(size=(40, 5)) * [30, 30, 30, 1, 1], np.array([12.0, 12.0, 12.0, 1.0, 1.0])
    data = matrix @ [0.05, 0.02, -0.03, 0.5, -1.0] + 0.1 * rng.normal(size=40)
    system = System(Attempt(structure, x, data, matrix, 0.0), [], matrix, prior, data)
    _, solution, left = system.solved(1.0)
    rows, target = np.concatenate([matrix, np.diag(prior**0.5)]), np.concatenate([data, np.zeros(5)])
    lower = np.concatenate([(structure.lower - x) / span, [-np.inf, -np.inf]])
    upper = np.concatenate([(structure.upper - x) / span, [np.inf, np.inf]])
    expected = lsq_linear(rows, target, (lower, upper), tol=1e-12).x
    np.testing.assert_allclose(solution, expected, atol=1e-6)
    assert solution[2] == lower[2]
    np.testing.assert_allclose(left, data - matrix @ solution)


def test_an_index_of_a_curved_shape_is_described():
    """ψ and Δ of a film whose index is that of a Cauchy film but for a curvature of 0.4 %."""
    nm = np.linspace(450, 950, 101)
    t = np.linspace(-1, 1, nm.size)
    index = (1.9 + 1.5e4 / nm**2) * (1 + 0.004 * (2 * t**2 - 1)) + 0j
    ncs = by_tmm.ncs(nm, (1.0, index, np.asarray(pl.medium("Si")(nm), complex)), [400.0], 70.0)
    psi, delta = by_tmm.psi_delta(*ncs.T)
    noise = 0.05 * np.random.default_rng(1).normal(size=(2, nm.size))
    values = {"delta": (delta + noise[1]) % 360, "angle": np.full(nm.size, 70.0)}
    data = pl.Spectrum(nm, psi + noise[0], "psi-delta", **values)
    view = SignalView(data, pl.Scene(pl.Layer("SiO2", 0.0), "Si"))
    problem = Problem((view,), 3000.0)
    film = polished(problem, Structure((Material("cauchy", 3000.0),)), [np.array([400.0, 1.9, 1.5e4])])
    [found] = weigh(problem, [film], {})
    assert found.adequate
    assert found.strain < 2
    assert abs(found.x[0] - 400) < 2 * found.stderr[0] < 5
