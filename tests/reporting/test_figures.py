"""Figures of fits: the right panels with the right things in them, and a file that is a PNG."""

import os
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from pellicle.fitting.result import Profile
from pellicle.reporting.figures import draw_fit as draw
from pellicle.reporting.matplotlib_figure import save_figure


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
