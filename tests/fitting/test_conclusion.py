"""Limits and errors with what enlarges those of the noise."""

import numpy as np

from pellicle.fitting.conclusion import _widened
from pellicle.fitting.profile_likelihood import ONE_SIDED, Limits

ALL = np.inf
"""Degrees of freedom of a noise that is known."""


def widened(upper, variance, stderr=np.inf, linear=2.0) -> tuple[float, float]:
    """Limits of a number whose best value is 90 between 84 and 105."""
    limits = Limits(np.array([stderr]), np.array([np.nan]), np.array([upper]))
    value, linear, variance, freedom = (np.array([x]) for x in (90.0, linear, variance, ALL))
    every = _widened(limits, value, linear, variance, freedom, (np.array([84.0]), np.array([105.0])))
    return float(every.lower[0]), float(every.upper[0])


def test_a_limit_beside_a_side_that_the_data_do_not_see_has_the_errors_that_are_not_noise():
    reach = np.sqrt(ONE_SIDED)
    assert np.isnan(widened(90 + 2 * reach, 9.0)[0])
    assert np.isclose(widened(90 + 2 * reach, 9.0)[1], 90 + reach * np.hypot(2, 3))
    assert np.isnan(widened(90 + 2 * reach, 400.0)[1])  # it reaches the bound, and says no more


def test_a_limit_that_linear_errors_do_not_describe_is_that_of_the_noise():
    """As of an opaque film, which is the same at any larger thickness."""
    assert widened(100.0, 9.0, linear=0.5)[1] == 100.0
    assert widened(90.5, 9.0)[1] == 90.5


def test_a_limit_of_a_number_with_an_error_ends_at_the_bound():
    assert widened(93.0, 400.0, stderr=2.0)[1] == 105.0
