"""Reports and figures of ellipsometric fits: degrees, several angles, and Δ that turns round."""

import dataclasses

import numpy as np

from pellicle.data.read_spectrum import read_spectrum
from pellicle.reporting.figures import draw_fit as draw
from pellicle.reporting.figures import of_part
from pellicle.reporting.fit_tables import fit_csv
from pellicle.reporting.matplotlib_figure import save_figure


def labels(drawn) -> list[str]:
    return [axes.get_ylabel() for axes in drawn.axes]


def named(axes) -> list[str]:
    return [line.get_label() for line in axes.lines if not line.get_label().startswith("_")]


def test_panels_of_several_angles(spectroscopic):
    drawn = draw(spectroscopic)
    assert labels(drawn) == ["Ψ (degrees)", "Δ (degrees)", "data − fit (degrees)", "misfit Δχ²", "n"]
    psi, delta, residuals = drawn.axes[:3]
    assert named(psi) == named(delta) == ["data", "fit, 65°", "fit, 75°"]
    assert residuals.get_xlabel() == "wavelength (nm)"
    for axes in (psi, delta):
        assert axes.get_shared_x_axes().joined(axes, residuals)
    curve, angle = spectroscopic.curve, spectroscopic.spectrum.angle
    for line, value in zip(psi.lines[1:], (65.0, 75.0), strict=True):
        np.testing.assert_array_equal(line.get_xdata(), curve.wavelength[angle == value])
        np.testing.assert_array_equal(line.get_ydata(), curve.model[angle == value])
    np.testing.assert_array_equal(delta.lines[0].get_ydata(), curve.delta_data)


def test_no_line_crosses_360_degrees(spectroscopic):
    lines = draw(spectroscopic).axes[1].lines[1:]
    assert [line.get_label() for line in lines] == ["fit, 65°", "fit, 75°"]
    for line in lines:
        assert np.isnan(line.get_ydata()).sum() == 1
        assert np.nanmax(np.abs(np.diff(line.get_ydata()))) < 180


def test_residuals_of_delta_are_the_short_way_round(spectroscopic):
    residuals = draw(spectroscopic).axes[2]
    assert named(residuals) == ["Ψ", "Δ"]
    of_delta = [line for line in residuals.lines if line.get_linestyle() == "--"]
    np.testing.assert_allclose(np.concatenate([line.get_ydata() for line in of_delta[:2]]), 2.0, atol=1e-12)


def test_one_wavelength_is_drawn_against_the_angle(angular, tmp_path):
    drawn = draw(angular)
    assert labels(drawn) == ["Ψ (degrees)", "Δ (degrees)", "data − fit (degrees)", "misfit Δχ²"]
    assert drawn.axes[2].get_xlabel() == "angle of incidence (degrees)"
    assert named(drawn.axes[0]) == ["data", "fit"]
    np.testing.assert_array_equal(drawn.axes[0].lines[1].get_xdata(), angular.spectrum.angle)
    save_figure(draw(angular), tmp_path / "figure.png")
    assert (tmp_path / "figure.png").stat().st_size > 20_000


def test_the_table_is_read_again_as_it_is(spectroscopic, with_part, tmp_path):
    size = len(spectroscopic.spectrum)
    sigma = {"sigma": np.full(size, 0.1), "delta_sigma": np.full(size, 0.2)}
    data = dataclasses.replace(spectroscopic.spectrum, **sigma)
    for spectrum in (spectroscopic.spectrum, data):
        text = fit_csv(with_part(spectroscopic, data=spectrum))
        (tmp_path / "fit.csv").write_text(text)
        again = read_spectrum(tmp_path / "fit.csv")
        assert again.signal == "psi-delta"
        for name in ("wavelength", "angle", "values", "delta", "sigma", "delta_sigma"):
            expected = getattr(spectrum, name)
            if expected is None:
                assert getattr(again, name) is None
            else:
                np.testing.assert_allclose(getattr(again, name), expected, rtol=1e-9)


def test_the_table_holds_model_and_residuals(spectroscopic):
    header, first, *others = fit_csv(spectroscopic).splitlines()[3:]
    assert {row.split(",")[-1] for row in others} == {"2"}
    columns = "psi_deg,psi_model,psi_residual,delta_deg,delta_model,delta_residual"
    assert header == f"wavelength_nm,angle_deg,{columns}"
    numbers = dict(zip(header.split(","), map(float, first.split(",")), strict=True))
    assert numbers["psi_residual"] == 0.1
    assert numbers["delta_residual"] == 2.0
    assert (numbers["psi_model"], numbers["delta_model"]) == (20.0, 300.0)


def test_reflectances_of_one_wavelength_are_drawn_against_the_angle(angular, with_part):
    """As those of a laser: one wavelength has no spectrum, in the figure as in the page."""
    values = angular.spectrum.values / 100
    spectrum = dataclasses.replace(angular.spectrum, signal="R", delta=None, values=values)
    curve = dataclasses.replace(angular.curve, delta_data=None, delta_model=None)
    of_laser = with_part(angular, data=spectrum, curve=curve)
    panel, residuals = draw(of_laser).axes[:2]
    assert named(panel) == ["data", "fit"]
    assert residuals.get_xlabel() == "angle of incidence (degrees)"
    for line in (*panel.lines, residuals.lines[0]):
        np.testing.assert_array_equal(line.get_xdata(), spectrum.angle)
    assert of_part(of_laser, 0)["layout"]["xaxis"]["title"]["text"] == "angle of incidence (degrees)"
