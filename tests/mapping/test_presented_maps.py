"""Maps show themselves as other results do: report, figure and folder; their arrays outlive them."""

import gc
import json

import pytest

import pellicle as pl
from pellicle.mapping.pixels.results import CODES
from pellicle.mapping.run import run_map
from pellicle.reporting.map_text import cube_report


def test_a_map_is_reported_drawn_and_saved(cube, scene, fake_fits, tmp_path):
    made = run_map(cube, scene, tmp_path / "map.zarr", fit=fake_fits.fit)
    text = pl.report(made)
    assert text == made.report() == cube_report(made)
    assert "100 % converged." in text
    assert "no data  2 pixels (0.1 %) at x = 5, y = 1.5 mm and at x = 7, y = 3.5 mm" in text
    assert "read     percent" in text
    assert "pixels/s" in text
    assert "dispersion" not in text.split("left out")[0].split("[[Plan")[1]
    assert len(made.plot().axes) >= 4
    made.save(tmp_path / "out")
    assert {path.name for path in (tmp_path / "out").iterdir()} == {
        *("result.json", "report.txt", "report.html", "map.png", "rival.png")
    }
    record = json.loads((tmp_path / "out" / "result.json").read_text())
    assert record["schema"] == "pellicle.cube-map/1"
    assert record["status"] == {"converged": 45 * 32 - 2, "no-data": 2}
    assert {row["effect"] for row in record["plan"]} > {"absorption", "dispersion"}


@pytest.mark.slow
def test_arrays_of_a_map_in_a_temporary_folder_outlive_it(cube, scene, fake_fits, monkeypatch):
    """Zarr takes a chunk whose file is absent as one without values, and says nothing."""
    monkeypatch.setattr("pellicle.mapping.pixels.fit.fit_pixels", fake_fits.fit)
    dataset = pl.map(cube, scene).dataset
    gc.collect()
    assert int((dataset["status"] == CODES["converged"]).sum()) == 45 * 32 - 2
