"""Figures of the map of a cube: what they show at which pixel, and what they leave out."""

import numpy as np
import pytest

from pellicle.fitting.batch.data import CODES, STATUSES
from pellicle.reporting import map_panels
from pellicle.reporting.map_figures import figures
from pellicle.reporting.map_panels import COLOURS, HATCHES
from pellicle.reporting.map_places import Axis, MapAxes
from tests.reporting.test_map_text import made as described

pytest.importorskip("xarray")


def made(status, dims=("y", "x"), coords=None, values=None, **attrs):
    """A map of a thickness that grows by 2 nm in each column, with a standard error of 0.4 nm."""
    values = 300 + 2.0 * np.arange(np.shape(status)[-1]) if values is None else values
    return described(status, np.broadcast_to(values, np.shape(status)), dims, coords, **attrs)


def image(height=30, width=40):
    return np.full((height, width), CODES["converged"], np.uint8)


def panel(figure, title):
    [found] = [axes for axes in figure.axes if axes.get_title(loc="left").startswith(title)]
    return found


def heading(figure):
    return " ".join(figure.get_suptitle().replace("\u00a0", " ").split())


def test_values_are_drawn_where_they_can_be_used_and_hatched_elsewhere():
    status = image()
    status[:5, :5] = CODES["misfit"]
    status[10, 10] = CODES["by-neighbours"]
    status[20, 20] = CODES["no-data"]
    figure = dict(figures(made(status)))["map"]
    shown, hatching = panel(figure, "thickness (nm)").images
    values = shown.get_array()
    assert np.ma.getmaskarray(values)[:5, :5].all()
    assert np.ma.getmaskarray(values).sum() == 26
    assert values[10, 10] == 320
    scale = len(hatching.get_array()) // 30
    opaque = hatching.get_array()[::scale, ::scale, 3] == 1
    assert opaque[:5, :5].all()
    assert opaque.sum() == 25
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["misfit"]
    assert "97.8 % converged" in heading(figure)  # 1173 of 1199 with data


def test_statuses_have_their_own_colours_hatches_and_shares():
    assert set(COLOURS) == set(STATUSES)
    assert len(set(COLOURS.values())) == len(COLOURS)
    assert len(set(HATCHES.values())) == len(HATCHES)
    assert set(HATCHES) == set(STATUSES) - {"no-data", "converged", "by-neighbours"}
    status = image(10, 10)
    status[0] = CODES["ambiguous"]
    status[1] = CODES["no-data"]
    figure = dict(figures(made(status)))["map"]
    [legend] = [axes.get_legend() for axes in figure.axes if axes.get_legend() and axes.images]
    texts = {text.get_text() for text in legend.get_texts()}
    assert texts == {"converged 88.9 %", "ambiguous 11.1 %", "no-data 10.0 % of all"}
    from matplotlib.colors import to_hex

    drawn = legend.axes.images[0]
    colours = {to_hex(drawn.to_rgba(drawn.get_array())[i, 0]).upper() for i in range(3)}
    assert colours == {COLOURS[word] for word in ("ambiguous", "no-data", "converged")}


def test_outliers_do_not_set_the_colours():
    values = 300 + np.random.default_rng(0).uniform(-1, 1, (30, 40))
    values[3, 3] = 5000.0
    shown = panel(dict(figures(made(image(), values=values)))["map"], "thickness").images[0]
    assert 298.9 < shown.norm.vmin < shown.norm.vmax < 301.1
    assert shown.colorbar.extend == "max"


def test_coordinates_and_scales():
    micrometres = {"x": ("x", np.arange(40) * 2.0, {"units": "µm"}), "y": ("y", np.arange(30) * 2.0)}
    micrometres["y"] += ({"units": "µm"},)
    axes = panel(dict(figures(made(image(), coords=micrometres)))["map"], "thickness")
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("x (µm)", "y (µm)")
    assert axes.get_xlim() == (-1, 79)
    assert axes.get_ylim() == (-1, 59)  # lengths increase upward
    assert axes.get_aspect() == 1.0
    pixels = panel(dict(figures(made(image())))["map"], "thickness")
    assert pixels.get_xlabel() == "x (pixels)"
    assert pixels.get_ylim() == (29.5, -0.5)  # pixels downward, as in images


def test_uneven_coordinates_are_drawn_where_they_are():
    y, x = np.arange(2.0), np.array([0.0, 1.0, 2.0, 10.0])  # the border of the last two is at 6
    axes = MapAxes("image", Axis("x", "mm", x), Axis("y", "mm", y), None, (2, 4))
    row = map_panels.evenly(np.array([[0, 1, 2, 3], [4, 5, 6, 7]]), axes, 1)[0]
    centres = -0.5 + (np.arange(row.size) + 0.5) * 14.5 / row.size  # from -0.5 to 14
    assert list(row) == list(np.searchsorted([0.5, 1.5, 6.0], centres))


def test_large_maps_are_drawn_by_blocks(monkeypatch):
    monkeypatch.setattr("pellicle.reporting.map_panels.MOST_POINTS", 20)
    monkeypatch.setattr("pellicle.reporting.map_panels.SLAB", 200)  # several slabs
    status = image(31, 59)  # blocks of 3, and smaller ones at the end
    status[0:2, 0:3] = CODES["misfit"]  # most of the first block
    status[3, 3] = CODES["misfit"]  # least of another one
    figure = dict(figures(made(status)))["map"]
    values = panel(figure, "thickness").images[0].get_array().filled(np.nan)
    assert values.shape == (11, 20)
    columns = 300 + 2.0 * np.arange(59)
    assert values[5] == pytest.approx([columns[i : i + 3].mean() for i in range(0, 59, 3)])
    assert values[1, 1] == pytest.approx(np.delete(np.tile(columns[3:6], 3), 0).mean())
    assert "A point is a block of 3 x 3 pixels" in heading(figure)
    [codes] = [axes.images[0].get_array() for axes in figure.axes if axes.images and axes.get_legend()]
    assert codes[0, 0] == CODES["misfit"]
    assert (codes == CODES["converged"]).sum() == 219


def test_other_parameters_rivals_and_a_preview():
    dataset = made(image(), preview=8)
    shape = ("y", "x")
    scale = {"parameter": "instrument.scale"}
    dataset["instrument_scale"] = (shape, np.full((30, 40), 1.02), scale)
    dataset["instrument_scale_stderr"] = (shape, np.full((30, 40), 0.01))
    delta = np.full((30, 40), np.nan)
    delta[4, 5] = 3.0
    dataset["rival_delta_chi2"] = (shape, delta)
    drawn = dict(figures(dataset))
    assert set(drawn) == {"map", "instrument_scale", "rival"}
    assert panel(drawn["instrument_scale"], "instrument.scale").images
    values = panel(drawn["rival"], "Δχ²").images[0].get_array()
    assert values[4, 5] == 3
    assert np.ma.count(values) == 1
    assert "Preview of every 8th pixel" in heading(drawn["map"])


def test_the_first_thickness_comes_first_and_labels_have_room():
    dataset = made(image(12, 10))
    index = 1.45 + 0.0171 * np.linspace(0, 1, 120).reshape(12, 10)
    dataset["A"] = (("y", "x"), index, {"parameter": "n"})
    dataset["A_stderr"] = (("y", "x"), np.full((12, 10), 0.001))
    drawn = dict(figures(dataset))
    assert set(drawn) == {"map", "A"}
    map = panel(drawn["map"], "thickness (nm)")
    assert all(tick == round(tick) for tick in (*map.get_xticks(), *map.get_yticks()))
    [histogram] = [axes for axes in drawn["A"].axes if axes.get_ylabel() == "pixels" and axes.patches]
    assert len(histogram.get_xticks()) <= 6  # of seven characters, in 3.5 inches


def test_the_histogram_counts_the_pixels_that_can_be_used():
    status = image()
    status[:10] = CODES["not-identifiable"]
    figure = dict(figures(made(status)))["map"]
    [axes] = [axes for axes in figure.axes if axes.get_ylabel() == "pixels" and axes.patches]
    assert sum(bar.get_height() for bar in axes.patches if hasattr(bar, "get_height")) >= 800
    counts = [bar.get_height() for bar in axes.containers[0]]
    assert sum(counts) == 800


def test_sites_are_points_without_interpolation():
    coords = {"x": ("site", np.array([0.0, 10, 20, 30])), "y": ("site", np.array([0.0, 5, 5, 0]))}
    status = [CODES["converged"]] * 3 + [CODES["ambiguous"]]
    figure = dict(figures(made(status, ("site",), coords)))["map"]
    axes = panel(figure, "thickness")
    assert not axes.images
    unsure, sure = axes.collections
    assert sure.get_offsets().tolist() == [[0, 0], [10, 5], [20, 5]]
    assert list(sure.get_array()) == [300, 302, 304]
    assert unsure.get_offsets().tolist() == [[30, 0]]
    assert unsure.get_hatch()


def test_a_series_has_its_first_middle_and_last_frame_and_its_mean():
    status = np.full((5, 6, 8), CODES["converged"], np.uint8)
    status[4, :3] = CODES["misfit"]
    seconds = {"time": ("time", np.arange(5) * 2.0, {"units": "s"})}
    values = 500 - 50.0 * np.arange(5)[:, None, None] + np.zeros((6, 8))
    values[4, :3] = 9e9  # must not count
    figure = dict(figures(made(status, ("time", "y", "x"), seconds, values)))["map"]
    titles = [axes.get_title(loc="left") for axes in figure.axes if axes.images]
    assert titles[:3] == ["thickness (nm), time = 0 s", "time = 4 s", "time = 8 s"]
    [curve] = [line for axes in figure.axes for line in axes.lines if line.get_label() == "mean"]
    assert curve.get_xdata().tolist() == [0, 2, 4, 6, 8]
    assert curve.get_ydata().tolist() == [500, 450, 400, 350, 300]
    [shares] = [line for axes in figure.axes for line in axes.lines if "right" in str(line.get_label())]
    assert shares.get_ydata().tolist() == [100, 100, 100, 100, 50]


def test_lines_and_lines_in_time():
    status = [CODES["converged"]] * 9 + [CODES["misfit"]]
    figure = dict(figures(made(status, ("x",))))["map"]
    curves = {str(line.get_label()): line for axes in figure.axes for line in axes.lines}
    assert curves["misfit"].get_xdata().tolist() == [9]
    assert sum(line.get_xdata().size for name, line in curves.items() if name != "misfit") == 9
    seconds = {"time": ("time", np.arange(4.0), {"units": "s"})}
    figure = dict(figures(made(np.ones((4, 10)) * CODES["converged"], ("time", "x"), seconds)))["map"]
    axes = panel(figure, "thickness")
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("x (pixels)", "time (s)")
    assert axes.get_aspect() == "auto"


def test_a_map_without_a_usable_pixel_is_drawn():
    figure = dict(figures(made(np.full((6, 8), CODES["misfit"]))))["map"]
    assert any("no pixel has numbers" in text.get_text() for axes in figure.axes for text in axes.texts)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("shape", "preview"), [((30, 40), 8), ((4, 200), 1), ((200, 4), 8), ((30, 240), 8), ((200, 30), 1)]
)
def test_texts_do_not_overlap_and_lie_within_the_page(shape, preview):
    status = image(*shape)
    for i, word in enumerate(HATCHES):
        status.ravel()[i :: 8 + i] = CODES[word]
    figure = dict(figures(made(status, preview=preview)))["map"]
    renderer = figure.canvas.get_renderer()
    figure.draw(renderer)
    boxes = [figure._suptitle.get_window_extent(renderer), figure.legends[0].get_window_extent(renderer)]
    boxes += [axes.get_tightbbox(renderer) for axes in figure.axes]
    width, height = figure.bbox.size
    for i, box in enumerate(boxes):
        assert box.x0 >= -1
        assert box.y0 >= -1
        assert box.x1 <= width + 1
        assert box.y1 <= height + 1
        for other in boxes[:i]:
            assert not (
                min(box.x1, other.x1) - max(box.x0, other.x0) > 2
                and min(box.y1, other.y1) - max(box.y0, other.y0) > 2
            )
