"""Bands of predictions join what belongs together, and are seen at single points."""

import numpy as np
import pytest

import pellicle as pl
from pellicle.colour import sensor
from pellicle.reporting.predictive_figure import draw_predictions
from pellicle.sampling.result import Axis, Prediction


def predicted(data, values, spread, wraps=False):
    """A prediction of a data set whose draws lie evenly within `spread` around the values."""
    around = values + np.linspace(-spread, spread, 401)[:, None]
    draws = np.mod(around, 360.0) if wraps else around
    axis = Axis("wavelength_nm", "wavelength (nm)", getattr(data, "wavelength", np.arange(len(values))))
    return Prediction("x", "x", axis, values, draws, draws, data, wraps=wraps)


def bands(figure):
    """Vertices of each band of the first panel that are finite."""
    paths = [path.vertices for band in figure.axes[0].collections for path in band.get_paths()]
    return [path for path in paths if len(path)]


def test_a_band_joins_the_points_of_one_angle():
    nm = np.tile([400.0, 500.0, 600.0], 2)
    angle = np.repeat([50.0, 70.0], 3)
    data = pl.Spectrum(nm, np.array([0.1, 0.2, 0.3, 0.7, 0.8, 0.9]), "R", angle=angle)
    figure = draw_predictions([predicted(data, data.values, 0.01)])
    drawn = bands(figure)
    assert len(drawn) == 4  # of measurements and of the model
    for path in drawn:
        assert (path[:, 0].min(), path[:, 0].max()) == (400.0, 600.0)
        assert np.ptp(path[:, 1]) == pytest.approx(0.2 + 0.02 * 0.95, abs=1e-3)


def test_one_wavelength_is_drawn_along_the_angle():
    angle = np.array([50.0, 60.0, 70.0])
    values = np.array([0.1, 0.2, 0.3])
    data = pl.Spectrum(np.full(3, 658.0), values, "R", angle=angle)
    figure = draw_predictions([predicted(data, values, 0.01)])
    assert figure.axes[0].get_xlabel() == "angle of incidence (degrees)"
    assert all((path[:, 0].min(), path[:, 0].max()) == (50.0, 70.0) for path in bands(figure))


def test_draws_on_both_sides_of_360_degrees_are_one_narrow_band():
    nm, delta = np.linspace(500.0, 600.0, 4), np.array([356.0, 359.5, 0.5, 3.0])
    data = pl.Spectrum(nm, np.full(4, 40.0), "psi-delta", angle=np.full(4, 60.0), delta=delta)
    figure = draw_predictions([predicted(data, delta, 2.0, wraps=True)])
    assert max(np.ptp(path[:, 1]) for path in bands(figure)) < 8.0


def test_a_single_colour_has_a_band_that_is_seen():
    values = np.array([[0.3, 0.4, 0.6]])
    data = pl.Colours(values, sensor()[:2], "srgb")
    figure = draw_predictions([predicted(data, values[:, 0], 0.02)])
    drawn = bands(figure)
    assert len(drawn) == 2
    for path in drawn:
        assert np.ptp(path[:, 0]) > 0.1
        assert np.ptp(path[:, 1]) == pytest.approx(0.04 * 0.95, abs=1e-3)
    assert [text.get_text() for text in figure.axes[0].get_xticklabels()] == ["1"]
