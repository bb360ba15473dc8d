"""The figure of a fit of a BRDF: every sample is in it, where its half angle says."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pellicle.fitting.brdf.result import BrdfFit

from pellicle.data.brdf_samples import BrdfSamples
from pellicle.effects.surface import exact
from pellicle.fitting.result import Status
from pellicle.reporting.brdf_figure import draw, half_angle
from pellicle.scene.surface import Surface, surface_view


@pytest.fixture
def fit():
    """In the plane of incidence the half angle is half of what the two angles differ by."""
    theta_o = np.array([10.0, 30.0, 50.0])
    samples = BrdfSamples(
        theta_i=np.full(3, 30.0),
        phi_i=np.zeros(3),
        theta_o=theta_o,
        phi_o=np.full(3, 180.0),
        values=np.array([[0.1], [1.0], [0.2]]),
        channels=("value",),
        sigma=np.full((3, 1), 0.05),
    )
    surface = Surface("microfacet-film", {"thickness": 40.0, "n": 1.5, "base_n": 2.7}, (550.0,))
    return BrdfFit(
        samples=samples,
        surface=surface,
        residual="linear",
        status=Status.MISFIT,
        verdict="",
        layered=False,
        parameters={},
        rivals=(),
        baselines=(),
        held_out=1.0,
        chi2_reduced=1.0,
        rms=1.0,
        effective_points=3.0,
        correlation_names=(),
        correlation=np.zeros((0, 0)),
        plan=exact(surface_view(surface, samples)),
        warnings=(),
        model=samples.values + 0.1,
        seconds=0.0,
    )


def test_half_angles(fit):
    np.testing.assert_allclose(half_angle(fit), [10.0, 0.0, 10.0], atol=1e-6)


def test_samples_model_and_residuals_in_sigma_are_drawn(fit):
    above, below = draw(fit).axes
    shown, model, _ = above.lines
    np.testing.assert_allclose(shown.get_ydata(), [0.1, 1.0, 0.2])
    np.testing.assert_allclose(model.get_ydata(), [0.2, 1.1, 0.3])
    assert above.get_yscale() == "log"
    np.testing.assert_allclose(below.lines[0].get_ydata(), -2.0)
    assert below.get_ylabel() == "residual / σ"


def test_without_sigma_residuals_have_the_unit_of_the_brdf(fit):
    fit = replace(fit, samples=replace(fit.samples, sigma=None), model=fit.model - 0.3)
    above, below = draw(fit).axes
    assert above.get_yscale() == "linear"
    np.testing.assert_allclose(below.lines[0].get_ydata(), 0.2, atol=1e-12)
    assert below.get_ylabel() == "residual (1/sr)"
