"""Two surfaces compared on the same samples, against criteria computed by hand."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import pellicle as pl
from pellicle.errors import UsageError
from pellicle.fitting.comparison import compare

pytestmark = pytest.mark.usefixtures("no_search")


@pytest.mark.slow
def test_the_right_index_is_better_by_the_criteria(grey, grey_samples):
    samples = grey_samples()
    result = pl.compare(samples, {"1.5": grey(), "1.3": grey(n=1.3)})
    assert result.best.name == "1.5"
    assert "1.5 is better than 1.3" in result.verdict
    points = result.effective_points
    assert 0.5 * 120 < points <= 120
    for candidate in result.candidates:
        square = np.sum(((samples.values - candidate.fit.model) / samples.sigma) ** 2)
        deviance = square * points / 120  # σ is known; correlated samples count as fewer
        assert candidate.free == 3
        assert candidate.deviance == pytest.approx(deviance, rel=1e-6)
        assert candidate.aic == pytest.approx(deviance + 2 * 3, rel=1e-6)
        assert candidate.bic == pytest.approx(deviance + 3 * np.log(points), rel=1e-6)


@pytest.mark.slow  # compiles two surfaces
def test_fits_of_other_samples_are_not_compared(grey, grey_samples):
    samples = grey_samples()
    one = pl.fit(samples, grey())
    other = pl.fit(dataclasses.replace(samples, values=1.01 * samples.values), grey())
    residual = pl.fit(samples, grey(), residual="cube-root")
    for second in (other, residual):
        with pytest.raises(UsageError, match="do not use the same points"):
            compare({"one": one, "other": second})
