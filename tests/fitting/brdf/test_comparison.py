"""Two surfaces compared on the same samples, against criteria computed by hand."""

import numpy as np
import pytest

import pellicle as pl

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
