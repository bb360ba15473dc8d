"""Figure of a BRDF fit: every sample is drawn at its half angle."""

from dataclasses import replace

import numpy as np

from pellicle.reporting.figures import draw_fit as draw
from pellicle.reporting.quantities import half_angle


def test_half_angles(brdf_fit):
    np.testing.assert_allclose(half_angle(brdf_fit.samples), [10.0, 0.0, 10.0], atol=1e-6)


def test_samples_model_and_residuals_in_sigma_are_drawn(brdf_fit):
    above, below = draw(brdf_fit).axes
    shown, model = above.lines
    np.testing.assert_allclose(shown.get_ydata(), [0.1, 1.0, 0.2])
    np.testing.assert_allclose(model.get_ydata(), [0.2, 1.1, 0.3])
    assert above.get_yscale() == "log"
    np.testing.assert_allclose(below.lines[0].get_ydata(), -2.0, atol=1e-12)
    assert below.get_ylabel() == "residual / σ"


def test_without_sigma_residuals_have_the_unit_of_the_brdf(brdf_fit, with_part):
    curve = replace(brdf_fit.parts[0].curve, model=brdf_fit.model - 0.3)
    brdf_fit = with_part(brdf_fit, data=replace(brdf_fit.samples, sigma=None), curve=curve)
    above, below = draw(brdf_fit).axes
    assert above.get_yscale() == "linear"
    np.testing.assert_allclose(below.lines[0].get_ydata(), 0.2, atol=1e-12)
    assert below.get_ylabel() == "residual (1/sr)"
