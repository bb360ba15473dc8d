"""The figure of a fit of a BRDF: every sample is in it, where its half angle says."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pellicle.data.brdf_samples import BrdfSamples
from pellicle.effects.surface import exact
from pellicle.fitting.result import BrdfCurve, Fit, LayerTest, Part, Status
from pellicle.reporting.brdf_figure import half_angle
from pellicle.reporting.fit_figure import draw
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
    part = Part(
        name="",
        data=samples,
        curve=BrdfCurve(samples.values + 0.1, np.full((3, 1), -2.0)),
        plan=exact(surface_view(surface, samples)),
        rms=1.0,
        chi2_reduced=1.0,
        effective_points=3.0,
    )
    return Fit(
        parts=(part,),
        status=Status.MISFIT,
        verdict="",
        parameters={},
        rivals=(),
        chi2_reduced=1.0,
        rms=1.0,
        effective_points=3.0,
        correlation_names=(),
        correlation=np.zeros((0, 0)),
        warnings=(),
        profile=None,
        seconds=0.0,
        scene=surface,
        layer_test=LayerTest(False, 1.0, (), "linear"),
    )


def test_half_angles(fit):
    np.testing.assert_allclose(half_angle(fit.samples), [10.0, 0.0, 10.0], atol=1e-6)


def test_samples_model_and_residuals_in_sigma_are_drawn(fit):
    above, below = draw(fit).axes
    shown, model, _ = above.lines
    np.testing.assert_allclose(shown.get_ydata(), [0.1, 1.0, 0.2])
    np.testing.assert_allclose(model.get_ydata(), [0.2, 1.1, 0.3])
    assert above.get_yscale() == "log"
    np.testing.assert_allclose(below.lines[0].get_ydata(), -2.0)
    assert below.get_ylabel() == "residual / σ"


def test_without_sigma_residuals_have_the_unit_of_the_brdf(fit, with_part):
    curve = replace(fit.parts[0].curve, model=fit.model - 0.3)
    fit = with_part(fit, data=replace(fit.samples, sigma=None), curve=curve)
    above, below = draw(fit).axes
    assert above.get_yscale() == "linear"
    np.testing.assert_allclose(below.lines[0].get_ydata(), 0.2, atol=1e-12)
    assert below.get_ylabel() == "residual (1/sr)"
