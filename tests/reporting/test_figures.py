"""Figures of fits: the right panels with the right things in them, and the tables of some signals."""

import os
from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

import pellicle as pl
from pellicle.data.read_spectrum import read_spectrum
from pellicle.errors import UsageError
from pellicle.fitting.curves import Index
from pellicle.fitting.reported_layer import principal_indices
from pellicle.fitting.result import Profile
from pellicle.materials import material
from pellicle.reporting.figures import draw_fit as draw
from pellicle.reporting.figures import index_panels, of_index, of_part
from pellicle.reporting.fit_tables import fit_csv, nk_csvs
from pellicle.reporting.fit_text import report
from pellicle.reporting.matplotlib_figure import save_figure
from pellicle.reporting.quantities import half_angle
from tests.data.tables import assert_read


def labels(drawn) -> list[str]:
    return [axes.get_ylabel() for axes in drawn.axes]


def png_size(path) -> tuple[int, int]:
    head = path.read_bytes()[:24]
    assert head[:8] == b"\x89PNG\r\n\x1a\n"
    return int.from_bytes(head[16:20], "big"), int.from_bytes(head[20:24], "big")


def test_a_png_of_a_readable_size_and_nothing_else(fit, tmp_path):
    assert save_figure(draw(fit), tmp_path / "figure.png") == tmp_path / "figure.png"
    width, height = png_size(tmp_path / "figure.png")
    assert 1000 <= width <= 1600
    assert 900 <= height <= 1800
    assert 20_000 < (tmp_path / "figure.png").stat().st_size < 1_000_000
    assert os.listdir(tmp_path) == ["figure.png"]


def test_a_figure_for_a_journal_has_its_width_no_title_and_no_scan(fit):
    drawn = draw(fit, 86)
    assert labels(drawn) == ["reflectance", "data − fit", "n"]
    assert drawn.get_suptitle() == ""
    assert drawn.get_figwidth() == pytest.approx(86 / 25.4)
    assert drawn.axes[0].yaxis.label.get_size() == 7
    with pytest.raises(UsageError, match="width_mm"):
        draw(fit, 3.4)  # of inches


def test_panels_and_what_they_show(fit):
    drawn = draw(fit)
    assert labels(drawn) == ["reflectance", "data − fit", "misfit Δχ²", "n"]
    labels_below = ["", "wavelength (nm)", "thickness (nm; searched 10 to 3000)", "wavelength (nm)"]
    assert [axes.get_xlabel() for axes in drawn.axes] == labels_below
    data, _, misfit, _ = drawn.axes
    shown = {line.get_label(): line for line in data.lines}
    np.testing.assert_array_equal(shown["data"].get_ydata(), fit.curve.data)
    np.testing.assert_array_equal(shown["fit"].get_ydata(), fit.curve.model)
    assert [text.get_text() for text in misfit.texts] == ["486.28", "242.87", "963.57"]
    marked = {line.get_label(): line for line in misfit.lines}
    np.testing.assert_array_equal(marked["rivals"].get_xydata(), [[242.87, 0.69], [963.57, 14.2]])
    np.testing.assert_array_equal(marked["best"].get_xydata(), [[486.28, 0.0]])
    title = drawn.get_suptitle()
    assert title.startswith("film.csv: ambiguous\nThe data do not determine")


def test_the_misfit_reaches_the_bottom_of_valleys_that_the_grid_missed(fit):
    curve = draw(fit).axes[2].lines[0]
    assert [486.28, 0.0] in curve.get_xydata().tolist()
    assert np.all(np.diff(curve.get_xdata()) > 0)


@pytest.mark.parametrize("scale", [1.0, 1e6])
def test_panels_and_their_labels_are_apart_and_inside_the_figure(fit, with_part, scale):
    scaled = {name: scale * getattr(fit.curve, name) for name in ("data", "model", "sigma")}
    curve = replace(fit.curve, k=np.full(41, 0.01), k_stderr=np.full(41, 0.002), **scaled)
    drawn = draw(with_part(replace(fit, verdict=20 * "A long verdict. "), curve=curve))
    drawn.canvas.draw()
    renderer = drawn.canvas.get_renderer()
    panels = [axes.get_tightbbox(renderer) for axes in drawn.axes]
    boxes = [drawn._suptitle.get_window_extent(renderer), *panels]
    for above, below in pairwise(boxes):
        assert above.y0 >= below.y1
    assert max(box.y1 for box in boxes) <= drawn.bbox.y1
    assert min(box.y0 for box in boxes) >= 0
    assert all(box.x0 >= 0 and box.x1 <= drawn.bbox.x1 for box in boxes)


def test_hopeless_thicknesses_are_left_out(fit):
    profile = Profile(np.linspace(10.0, 3000.0, 60), np.where(np.arange(60) < 20, 5.0, 1e8))
    _, right = draw(replace(fit, profile=profile)).axes[2].get_xlim()
    assert 963.57 < right < 1100


def test_without_a_scan_or_a_free_index_there_is_no_panel_for_it(fit, with_part):
    assert labels(draw(replace(fit, profile=None))) == ["reflectance", "data − fit", "n"]
    curve = replace(fit.curve, n_stderr=np.zeros(41))
    assert labels(draw(with_part(replace(fit, profile=None), curve=curve))) == ["reflectance", "data − fit"]


def test_an_infinite_error_leaves_a_gap_in_the_band(fit, with_part, tmp_path):
    curve = replace(fit.curve, n_stderr=np.where(np.arange(41) < 9, np.inf, 0.001))
    save_figure(draw(with_part(fit, curve=curve)), tmp_path / "figure.png")
    [band] = draw(with_part(fit, curve=curve)).axes[3].collections
    vertices = np.concatenate([path.vertices for path in band.get_paths()])
    assert np.isfinite(vertices).all()
    assert vertices[:, 0].min() == fit.curve.wavelength[9]


def test_lines_cross_neither_gaps_nor_angles(fit, with_part):
    half = np.flatnonzero((fit.curve.wavelength < 500) | (fit.curve.wavelength > 700))
    arrays = {name: array for name, array in vars(fit.curve).items() if array is not None}
    curve = replace(fit.curve, **{name: array[half] for name, array in arrays.items()})
    spectrum = replace(fit.spectrum, wavelength=curve.wavelength, values=curve.data)
    gapped = draw(with_part(fit, curve=curve, data=spectrum)).axes[0]
    fitted = gapped.lines[1].get_xdata()
    assert np.flatnonzero(np.isnan(fitted)).tolist() == [10]
    assert fitted.size == 21
    angled = replace(fit.spectrum, angle=np.where(np.arange(41) % 2, 30.0, 60.0))
    lines = draw(with_part(fit, data=angled)).axes[0].lines
    assert [line.get_xdata().size for line in lines] == [41, 20, 21]


def test_odd_fits_are_drawn_too(fit, with_part, tmp_path):
    odd = replace(
        with_part(fit, data=replace(fit.spectrum, path="a$b_{$.csv", calibrated=False, signal="T")),
        rivals=(),
        parameters={"A": fit["A"]},
        profile=Profile(np.linspace(1.0, 9.0, 5), np.full(5, 1e8)),
    )
    save_figure(draw(odd), tmp_path / "figure.png")
    assert labels(draw(odd))[0] == "transmittance × unknown scale"


def test_a_figure_belongs_to_no_window(fit):
    drawn = draw(fit)
    assert drawn.canvas.manager is None  # pyplot would have given it one
    assert type(drawn.canvas).__name__ == "FigureCanvasAgg"


def test_a_joint_fit_has_panels_for_each_file(fit, spectroscopic):
    parts = (replace(fit.parts[0], name="film"), replace(spectroscopic.parts[0], name="a$b"))
    drawn = draw(replace(fit, parts=parts, rms=None))
    panels = ["reflectance", "data − fit", "Ψ (degrees)", "Δ (degrees)", "data − fit (degrees)"]
    assert labels(drawn)[:5] == panels
    assert [at.get_title(loc="left") for at in drawn.axes[:5]] == ["film", "", r"a\$b", "", ""]
    assert drawn.axes[1].get_shared_x_axes().joined(drawn.axes[0], drawn.axes[1])
    assert not drawn.axes[0].get_shared_x_axes().joined(drawn.axes[0], drawn.axes[2])
    assert drawn.get_suptitle().startswith("film.csv and film.csv: ambiguous")


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
    for line in draw(spectroscopic).axes[1].lines[1:]:
        assert np.isnan(line.get_ydata()).sum() == 1
        assert np.nanmax(np.abs(np.diff(line.get_ydata()))) < 180


def test_residuals_of_delta_are_the_short_way_round(spectroscopic):
    residuals = draw(spectroscopic).axes[2]
    assert named(residuals) == ["Ψ", "Δ"]
    of_delta = [line for line in residuals.lines if line.get_linestyle() == "--"]
    np.testing.assert_allclose(np.concatenate([line.get_ydata() for line in of_delta[:2]]), 2.0, atol=1e-12)


def test_one_wavelength_is_drawn_against_the_angle(angular):
    drawn = draw(angular)
    assert labels(drawn) == ["Ψ (degrees)", "Δ (degrees)", "data − fit (degrees)", "misfit Δχ²"]
    assert drawn.axes[2].get_xlabel() == "angle of incidence (degrees)"
    assert named(drawn.axes[0]) == ["data", "fit"]
    np.testing.assert_array_equal(drawn.axes[0].lines[1].get_xdata(), angular.spectrum.angle)


@pytest.mark.parametrize("sigma", [(None, None), (np.full(40, 0.1), np.full(40, 0.2))])
def test_the_table_is_read_again_as_it_is(spectroscopic, with_part, write, sigma):
    data = replace(spectroscopic.spectrum, sigma=sigma[0], delta_sigma=sigma[1])
    again = read_spectrum(write(fit_csv(with_part(spectroscopic, data=data)), "fit.csv"))
    names = ("signal", "wavelength", "angle", "values", "delta", "sigma", "delta_sigma")
    assert_read(again, 1e-9, **{name: getattr(data, name) for name in names})


def test_the_table_holds_model_and_residuals(spectroscopic):
    header, first, *others = fit_csv(spectroscopic).splitlines()[3:]
    assert {row.split(",")[-1] for row in others} == {"2"}
    columns = "psi_deg,psi_model,psi_residual,delta_deg,delta_model,delta_residual"
    assert header == f"wavelength_nm,angle_deg,{columns}"
    _, _, _, *of_psi, _, model, residual = map(float, first.split(","))
    assert [*of_psi, model, residual] == [20.0, 0.1, 300.0, 2.0]


def test_reflectances_of_one_wavelength_are_drawn_against_the_angle(angular, with_part):
    """As those of a laser: one wavelength has no spectrum, in the figure as in the page."""
    values = angular.spectrum.values / 100
    spectrum = replace(angular.spectrum, signal="R", delta=None, values=values)
    curve = replace(angular.curve, delta_data=None, delta_model=None)
    of_laser = with_part(angular, data=spectrum, curve=curve)
    panel, residuals = draw(of_laser).axes[:2]
    assert named(panel) == ["data", "fit"]
    assert residuals.get_xlabel() == "angle of incidence (degrees)"
    for line in (*panel.lines, residuals.lines[0]):
        np.testing.assert_array_equal(line.get_xdata(), spectrum.angle)
    assert of_part(of_laser, 0)["layout"]["xaxis"]["title"]["text"] == "angle of incidence (degrees)"


def test_samples_model_and_residuals_in_sigma_are_drawn(brdf_fit):
    np.testing.assert_allclose(half_angle(brdf_fit.samples), [10.0, 0.0, 10.0], atol=1e-6)
    above, below = draw(brdf_fit).axes
    shown, model = above.lines
    np.testing.assert_allclose(shown.get_ydata(), [0.1, 1.0, 0.2])
    np.testing.assert_allclose(model.get_ydata(), [0.2, 1.1, 0.3])
    assert above.get_yscale() == "log"
    np.testing.assert_allclose(below.lines[0].get_ydata(), -2.0, atol=1e-12)
    assert below.get_ylabel() == "residual / σ"


def test_a_sample_of_zero_leaves_the_axis_of_a_brdf_logarithmic(brdf_fit, with_part):
    values = np.where(brdf_fit.samples.values == brdf_fit.samples.values.min(), 0.0, brdf_fit.samples.values)
    above = draw(with_part(brdf_fit, data=replace(brdf_fit.samples, values=values))).axes[0]
    assert above.get_yscale() == "log"
    np.testing.assert_allclose(above.get_ylim(), [0.1, 2.2])


def test_without_sigma_residuals_have_the_unit_of_the_brdf(brdf_fit, with_part):
    curve = replace(brdf_fit.parts[0].curve, model=brdf_fit.model - 0.3)
    brdf_fit = with_part(brdf_fit, data=replace(brdf_fit.samples, sigma=None), curve=curve)
    above, below = draw(brdf_fit).axes
    assert above.get_yscale() == "linear"
    np.testing.assert_allclose(below.lines[0].get_ydata(), 0.2, atol=1e-12)
    assert below.get_ylabel() == "residual (1/sr)"


NM = np.linspace(400.0, 800.0, 41)


def index(n, error):
    rising = n + 1e-4 * (NM - 400.0)
    return Index(NM, rising, np.zeros(41), np.full(41, error), np.zeros(41))


@pytest.fixture
def birefringent(fit, with_part):
    """n_o is 1.33, n_e 1.48."""
    flat = Index(NM, np.linspace(0.15, 0.19, 41), np.zeros(41), np.full(41, 0.004), np.zeros(41))
    principal = {"ordinary": index(1.33, 0.001), "extraordinary": index(1.48, 0.003), "birefringence": flat}
    return with_part(fit, curve=replace(fit.curve, principal=principal))


def test_each_principal_index_is_a_material(birefringent, tmp_path, write):
    tables = nk_csvs(birefringent)
    assert list(tables) == ["nk_ordinary.csv", "nk_extraordinary.csv"]
    for name, n in (("nk_ordinary.csv", 1.33), ("nk_extraordinary.csv", 1.48)):
        path = write(tables[name], name)
        np.testing.assert_allclose(np.real(material(str(path))(NM)), n + 1e-4 * (NM - 400.0), rtol=1e-9)
    frame = pd.read_csv(tmp_path / "nk_extraordinary.csv", comment="#")
    np.testing.assert_allclose(frame["birefringence"], np.linspace(0.15, 0.19, 41))
    np.testing.assert_allclose(frame["birefringence_stderr"], 0.004)


def test_report_states_the_birefringence_with_its_error(birefringent, fit):
    text = report(birefringent)
    for line in ("400 nm  0.15000 ± 0.004", "600 nm  0.17000 ± 0.004", "800 nm  0.19000 ± 0.004"):
        assert line in text
    assert "Birefringence" not in report(fit)


def test_figures_show_each_index_with_its_band(birefringent):
    axes = [a for a in draw(birefringent).axes if a.get_ylabel() == "n"]
    assert [line.get_label() for line in axes[0].lines] == ["ordinary", "extraordinary"]
    assert axes[0].lines[1].get_ydata()[0] == pytest.approx(1.48)
    assert [word in str(of_index(birefringent)) for word in ("extraordinary", "birefringence")] == [True] * 2


def test_birefringence_has_the_error_of_a_difference():
    """Variances of both indices less twice their covariance; slopes are those of n_o, n_e in themselves."""
    free = [pl.dispersion.Constant(pl.Free(1.4, 1.9)) for _ in range(2)]
    scene = pl.Scene(pl.Layer(pl.Anisotropic(*free), 100.0), 1.5)
    slope = np.zeros((4, 3, 2))
    slope[0, :, 0] = slope[2, :, 1] = 1.0
    values = np.array([[1.5] * 3, [0.0] * 3, [1.7] * 3, [0.0] * 3])
    at = SimpleNamespace(layer=values, layer_slope=slope)
    covariance = np.array([[4.0, 3.0], [3.0, 9.0]]) * 1e-6
    found = principal_indices(scene, at, covariance, NM[:3])
    np.testing.assert_allclose(found["extraordinary"].n_stderr, 0.003)
    np.testing.assert_allclose(found["birefringence"].n, 0.2)
    np.testing.assert_allclose(found["birefringence"].n_stderr, np.sqrt(4 + 9 - 6) * 1e-3)
    isotropic = pl.Scene(pl.Layer(free[0], 100.0), 1.5)
    assert principal_indices(isotropic, at, covariance, NM[:3]) == {}


def test_the_band_of_k_ends_at_zero(fit, with_part):
    curve = replace(fit.curve, k=np.full(41, 0.01), k_stderr=np.full(41, 0.5))
    [_, panel] = index_panels(with_part(fit, curve=curve))
    assert panel.bands[0].low.min() == 0
    assert panel.bands[0].high.max() == pytest.approx(0.51)
