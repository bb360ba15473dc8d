"""Errors under noise in proportion to the signal, which nobody gives or which is given as a share."""

import dataclasses

import numpy as np
import pytest

import pellicle as pl
from pellicle.fitting.brdf.fit import fit
from pellicle.scene.surface import Surface


def _clean(grey_samples, grey, truth):
    """Samples of the truth without noise or σ."""
    data = grey_samples()
    exact = Surface("granier-heidrich", {**grey().numbers, **truth}, (550.0,))
    return dataclasses.replace(data, values=pl.simulate(exact, directions=data).values, sigma=None)


@pytest.mark.slow  # compiles a model of its own
def test_a_share_of_the_signal_is_one_of_the_model(grey_samples, grey, truth, no_search):
    """Of two samples 20 % above and below the truth a noise in proportion favours neither.

    With the noise of the measured values the fit is 1 - 0.96/1.04, 8 %, too dark.
    """
    clean = _clean(grey_samples, grey, truth)
    twice = clean.at(np.repeat(np.arange(len(clean)), 2))
    sign = np.where(np.arange(len(twice)) % 2, 1, -1)[:, None]
    data = dataclasses.replace(twice, values=twice.values * (1 + 0.2 * sign)).with_noise("20 %")
    found = fit(data, grey())
    assert found["specular"].value == pytest.approx(truth["specular"], rel=2e-3)
    assert found.chi2_reduced == pytest.approx(1, rel=0.02)  # (0.2/0.2)², less the degrees of freedom
