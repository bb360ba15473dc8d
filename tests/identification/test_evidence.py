"""Numbers within their bounds in the linear model of an attempt, against SciPy."""

import numpy as np
from scipy.optimize import lsq_linear

from pellicle.identification.evidence import System
from pellicle.identification.problem import Attempt
from pellicle.identification.structure import Material, Structure


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
