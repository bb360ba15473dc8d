"""Words and numbers on the map of a cube, against maps whose statuses and values are put in by hand."""

import json
from dataclasses import replace

import numpy as np
import pytest

from pellicle.fitting.batch.data import CODES, STATUSES
from pellicle.mapping.map_result import Run
from pellicle.reporting.map_places import map_axes, place
from pellicle.reporting.map_sites import sites_csv
from pellicle.reporting.map_summary import summarise
from pellicle.reporting.map_text import cube_json, cube_report, share

xr = pytest.importorskip("xarray")

HEIGHT, WIDTH = 60, 80


def made(status, thickness=None, dims=("y", "x"), coords=None, **attrs):
    """A map of the thickness: 300 nm, with errors of 0.4 nm in all and 0.1 nm of noise."""
    status = np.asarray(status, np.uint8)
    values = np.full(status.shape, 300.0) if thickness is None else thickness
    known = status != CODES["no-data"]
    nm = {"units": "nm"}
    errors = {"": 0.4, "_noise": 0.1}
    arrays = {f"thickness_stderr{x}": (dims, np.full(status.shape, y, "f4"), nm) for x, y in errors.items()}
    arrays |= {"thickness": (dims, np.where(known, values, np.nan), nm), "status": (dims, status)}
    return xr.Dataset(arrays, coords=coords, attrs={"path": "wafer.nc", "signal": "R", **attrs})


def image(fill="converged"):
    return np.full((HEIGHT, WIDTH), CODES[fill], np.uint8)


def words(text):
    return " ".join(text.split())


def where(found, **axes):
    """The place of these pixels of an image, in words."""
    found = np.asarray(found, bool)
    return place(found, np.ones_like(found), map_axes(made(np.where(found, 0, 1), **axes)))


def blank():
    return np.zeros((HEIGHT, WIDTH), bool)


def test_one_pixel_is_no_pixels():
    assert "Parameters at the 1 pixel with status converged" in cube_report(made([[CODES["converged"]]]))


def test_shares_are_those_of_pixels_with_data():
    status = image()
    status[:, :20] = CODES["no-data"]  # 1200 of 4800
    status[0, 20:] = status[-1, 20:] = CODES["ambiguous"]  # 120 of 3600
    status[1:-1, 20] = status[1:-1, -1] = CODES["ambiguous"]  # 116 more: 6.6 %
    text = words(cube_report(made(status)))
    assert "93.4 % converged, 6.6 % ambiguous along the edge." in text
    assert "no data 1200 pixels (25.0 %) along the left edge, x = 0 to 19 pixels" in text
    assert "Choose among the rivals" in text
    assert "misfit" not in text


@pytest.mark.parametrize(("count", "text"), [(0, "0"), (10**6, "100"), (999_999, "> 99.9"), (1, "0.0001")])
def test_a_share_is_never_rounded_to_none_or_all(count, text):
    assert share(count, 10**6) == text


PATCH, FEW = np.s_[10:20, 30:43], ([40, 45, 50, 55, 59], [3, 60, 20, 70, 5])


@pytest.mark.parametrize(
    ("parts", "text"),
    [
        ([PATCH], "in one patch of 130 pixels around x = 36, y = 14 pixels"),
        ([PATCH, np.s_[40:50, 60:70]], "in 2 patches, of 130 pixels around x = 36, y = 14 pixels and of 100"),
        ([PATCH, FEW], "in one patch of 130"),  # 96 % of all
        ([PATCH, FEW, np.s_[35:38, 70:74]], "mostly in one patch of 130"),  # 88 %
        ([np.s_[range(10, 50), range(20, 60)]], "in one patch of 40 pixels at x = 20 to 59 pixels, y = 10"),
        ([np.s_[12:15]], "in 3 rows, y = 12 to 14 pixels"),
        ([np.s_[:3]], "along the top edge, y = 0 to 2 pixels"),
        ([np.s_[:, [7, 30, 31]]], "in 3 columns, x = 7 pixels and x = 30 to 31 pixels"),
        ([np.s_[:, [7, 30, 31]], np.s_[:, ::4]], "in 23 columns"),  # 20 and the 3 above
        ([(3, 5), (40, 70)], "at x = 5, y = 3 pixels and at x = 70, y = 40 pixels"),
    ],
)
def test_a_place_in_words(parts, text):
    found = blank()
    for part in parts:
        found[part] = True
    assert where(found).startswith(text)


def test_places_in_millimetres():
    """Lengths increase upward: row 0 is below."""
    sizes = {"x": WIDTH, "y": HEIGHT}
    lengths = {axis: (axis, np.arange(size) * 0.05, {"units": "mm"}) for axis, size in sizes.items()}
    patch, rows = blank(), blank()
    patch[PATCH] = rows[:3] = True
    assert where(patch, coords=lengths) == "in one patch of 130 pixels around x = 1.80, y = 0.70 mm"
    assert where(rows, coords=lengths).startswith("along the bottom edge, y = 0.0")


@pytest.mark.parametrize("density", [0.01, 0.1, 0.3, 0.45])
def test_pixels_at_random_are_scattered(density):
    assert where(np.random.default_rng(1).random((HEIGHT, WIDTH)) < density) == "in scattered pixels"


def test_the_edge_of_a_round_wafer():
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    radius = np.hypot(y - 30, x - 40)
    wafer = radius < 29
    axes = map_axes(made(np.where(wafer, 1, 0)))
    assert place(wafer & (radius > 26.5), wafer, axes) == "along the edge"
    patch = wafer & (np.hypot(y - 30, x - 66) < 3)  # at the edge, but on one side only
    assert place(patch, wafer, axes).startswith("in one patch")
    assert place(wafer & (radius < 5), wafer, axes).endswith("around x = 40, y = 30 pixels")


def test_pixels_outside_a_mask_are_around_it():
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    for radius in (20, 28):
        expected = f"all around x = {40 - radius} to {40 + radius} pixels, y = {30 - radius} to"
        assert where(np.hypot(y - 30, x - 40) > radius).startswith(expected)
    assert where((y < 2) | (y >= HEIGHT - 2) | (x < 2) | (x >= WIDTH - 2)) == "along the edge"


def test_frames_of_a_series():
    found = np.zeros((20, 12, 16), bool)
    dims, seconds = ("time", "y", "x"), {"time": ("time", np.arange(20) * 0.5, {"units": "s"})}
    found[4:6] = True
    assert where(found, dims=dims, coords=seconds) == "in all pixels at time = 2.0 to 2.5 s"
    found[:] = False
    found[4:6, 2:6, 8:14] = True
    assert where(found, dims=dims, coords=seconds).endswith("2.5 s, in one patch around x = 10, y = 4 pixels")
    found[:, 2:6, 8:14] = True
    assert where(found, dims=dims, coords=seconds) == "in one patch around x = 10, y = 4 pixels"


def test_sites_of_a_wafer():
    angle = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    x = np.concatenate([[0.0], 20 * np.cos(angle), 40 * np.cos(angle)])
    y = np.concatenate([[0.0], 20 * np.sin(angle), 40 * np.sin(angle)])
    coords = {"x": ("site", x, {"units": "mm"}), "y": ("site", y, {"units": "mm"})}
    radius = np.hypot(x, y)
    assert where(radius > 30, dims=("site",), coords=coords) == "at the outer sites"
    assert where(radius == 0, dims=("site",), coords=coords) == "at x = 0.0, y = 0.0 mm"  # others at 17.3
    assert where(np.arange(25) % 4 == 1, dims=("site",), coords=coords) == "at scattered sites"
    assert "25 sites" in cube_report(made(np.full(25, CODES["converged"]), dims=("site",), coords=coords))


def test_values_errors_and_the_slope_of_a_wedge():
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    coords = {"x": ("x", np.arange(WIDTH) * 0.1, {"units": "mm"}), "y": ("y", np.arange(HEIGHT) * 0.1)}
    coords["y"] += ({"units": "mm"},)
    thickness = 300 + 2.0 * x - 0.5 * y  # 20 and -5 nm/mm
    status = image()
    status[20:30, 20:30] = CODES["misfit"]
    thickness[20:30, 20:30] = 5000.0  # must not count
    record = cube_json(made(status, thickness, coords=coords))
    own = record["parameters"]["thickness"]
    assert own["plane"]["slopes"] == pytest.approx({"x": 20.0, "y": -5.0})
    assert own["plane"]["unit"] == "nm/mm"
    assert own["plane"]["explains"] == pytest.approx(1.0)
    assert (own["least"], own["largest"]) == (300 - 0.5 * 59, 300 + 2.0 * 79)
    assert own["stderr"] == pytest.approx(0.4)
    assert own["stderr_noise"] == pytest.approx(0.1)
    text = words(cube_report(made(status, thickness, coords=coords)))
    assert "slope x +20, y -5 nm/mm" in text
    assert "standard error 0.4 nm (median), of the noise 0.1 nm" in text
    assert "4700 pixels with status converged" in text


def test_no_plane_where_there_is_none():
    random = np.random.default_rng(0).normal(300, 1, (HEIGHT, WIDTH))
    assert "plane" not in cube_json(made(image(), random))["parameters"]["thickness"]


def test_large_maps_are_thinned_for_percentiles_but_not_for_shares(monkeypatch):
    monkeypatch.setattr("pellicle.reporting.map_summary.MOST_PIXELS", 600)  # every third of 60 x 80
    x = np.arange(WIDTH) + np.zeros((HEIGHT, 1))
    status = image()
    status[1, 1] = CODES["misfit"]
    dataset = made(status, 300 + 2.0 * x)
    assert cube_json(dataset)["status"] == {"converged": 4799, "misfit": 1}
    assert cube_json(dataset)["parameters"]["thickness"]["median"] == pytest.approx(379, abs=6)
    assert "Percentiles are those of every 3rd pixel" in words(cube_report(dataset))


def test_the_record_is_strict_json_even_of_an_empty_map():
    empty = made(image("no-data"))
    record = json.loads(json.dumps(cube_json(empty), allow_nan=False))
    assert record["schema"] == "pellicle.cube-map/1"
    assert record["converged"] == 0.0
    assert record["parameters"]["thickness"]["median"] is None
    assert "No pixel has data." in cube_report(empty)


def test_provenance_time_plan_and_preview():
    effects = [
        {"effect": "absorption", "on": False, "why": "no layer absorbs", "error_bound": 0.0},
        {"effect": "back-face", "on": True, "why": "the substrate is a plate", "error_bound": 0.0},
    ]
    dataset = made(image(), notes="values are percent\nbands 3 and 17 are left out", preview=8)
    dataset.attrs["plan"] = json.dumps(effects)
    text = words(cube_report(dataset))
    assert "read values are percent bands 3 and 17 are left out" in text
    assert "preview of every 8th pixel in each direction" in text
    assert "back-face on: the substrate is a plate" in text
    assert "left out absorption" in text
    assert cube_json(dataset)["plan"] == effects
    assert cube_json(dataset)["seconds"] is None
    assert cube_json(dataset)["preview"] == 8


def test_time_of_the_run():
    timed = replace(summarise(made(image())), run=Run(4000, 800, 2, 2.5, 1.25))
    text = words(cube_report(made(image()), timed))
    assert "time 2.5 s, 1.2 s of it compilation, 3 200 pixels/s, 2 processes, without 800 pixels" in text
    assert cube_json(made(image()), timed)["pixels_per_second"] == 3200


def test_parameters_in_the_order_of_the_fit():
    dataset = made(image(), parameters={"thickness": "nm", "A": "", "instrument.scale": ""})
    for name in ("A", "instrument_scale", "thickness_rate"):
        dataset[name] = (("y", "x"), np.ones((HEIGHT, WIDTH)), {"parameter": name.replace("_", ".")})
        dataset[f"{name}_stderr"] = (("y", "x"), np.ones((HEIGHT, WIDTH)))
    dataset = dataset[sorted(dataset.data_vars)]
    assert list(cube_json(dataset)["parameters"]) == ["thickness", "A", "instrument.scale"]
    dataset.attrs["parameters"] = ["thickness (nm)", "A ()", "instrument.scale ()"]  # as in NetCDF
    assert list(cube_json(dataset)["parameters"]) == ["thickness", "A", "instrument.scale"]


def test_every_status_has_advice():
    status = np.resize(np.arange(1, len(STATUSES)), (HEIGHT, WIDTH))
    text = cube_report(made(status))
    advice = text.split("[[Status: what to do]]\n")[1].split("[[")[0].splitlines()
    assert [line.split()[0] for line in advice if line[4] != " "] == list(STATUSES[1:])


def test_rates_of_a_series():
    time = np.arange(8.0)
    status = np.full((8, 5), CODES["converged"], np.uint8)
    status[2:, 4] = CODES["misfit"]  # two times are left
    thickness = 300.0 - 2.5 * time[:, None] + np.zeros((8, 5))
    thickness[:, 3] += 0.5 * (time - 3.5) ** 2
    coords = {"time": ("time", time, {"units": "s"})}
    series = made(status, thickness, dims=("time", "x"), coords=coords)
    text = words(cube_report(series))
    assert "thickness median -2.5 nm/s" in text
    assert "constant at 3 of 4 pixels; a straight line does not fit the others" in text
    [rate] = cube_json(series)["rates"].values()
    assert (rate["unit"], rate["constant"], rate["not_constant"]) == ("nm/s", 3, 1)
    assert rate["stderr_noise"] == pytest.approx(0.1 / np.sqrt(np.sum((time - 3.5) ** 2)))
    assert cube_json(made(image()))["rates"] == {}


def test_the_edge_of_a_large_map_is_sought_on_fewer_pixels(monkeypatch):
    monkeypatch.setattr("pellicle.reporting.map_places.MOST_PIXELS", 1200)  # every second
    found = ~blank()
    found[4:-4, 4:-4] = False
    assert where(found) == "along the edge"


def test_sites_have_a_row_each_and_statistics_below():
    status = np.array([CODES[x] for x in ("converged", "converged", "misfit", "converged")])
    nm = np.array([98.0, 100.0, 500.0, 105.0])
    where = {"x": ("site", [0.0, 1, 2, 3], {"units": "mm"}), "y": ("site", [0.0, 0, 1, 1], {"units": "mm"})}
    files = np.array(["a.csv", "b.csv", "c.csv", "d.csv"], np.dtypes.StringDType())  # as zarr has them
    dataset = made(status, nm, ("site",), where | {"file": ("site", files)})
    header, *rows = sites_csv(dataset, summarise(dataset)).splitlines()
    errors = "thickness_stderr,thickness_stderr_noise"
    assert header == f"\ufeffsite,x (mm),y (mm),status,thickness (nm),{errors}"
    assert rows[1] == "b.csv,1,0,converged,100,0.400000006,0.1000000015"
    assert rows[2].startswith("c.csv,2,1,misfit,500,")
    statistics = {name: float(text) for name, *_, text, _, _ in (row.split(",") for row in rows[4:])}
    # of 98, 100 and 105 nm
    wanted = {"mean": 101.0, "standard deviation": 13**0.5, "range": 7.0, "uniformity (%)": 350 / 101}
    assert statistics == pytest.approx(wanted)
