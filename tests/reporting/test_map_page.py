"""Page of the map of a cube: its figures with descriptions, its numbers, escaped names."""

import numpy as np
import pytest

from pellicle.mapping.pixels.results import CODES
from pellicle.reporting.map_files import map_page
from pellicle.reporting.map_summary import summarise
from tests.reporting.test_map_text import image, made
from tests.reporting.test_page import Page

pytest.importorskip("xarray")


def test_a_page_of_figures_and_tables():
    status = image()
    status[:6] = CODES["ambiguous"]  # a tenth
    summary = summarise(made(status, path="/data/<b>wafer.nc"))
    page = Page(map_page(summary, {"map": b"\x89PNG map", "rival": b"\x89PNG rival"}))
    assert not page.open
    assert "Map of <b>wafer.nc" in page.text
    images = [own for tag, own in page.elements if tag == "img"]
    assert [own["src"].startswith("data:image/png;base64,") for own in images] == [True, True]
    assert images[0]["alt"].startswith("Values, standard errors")
    assert "90.0 % converged; 10.0 % ambiguous along the top edge" in images[0]["alt"]
    assert "median 300.00 nm" in page.text
    assert f"{np.sum(status == CODES['converged'])} pixels" in page.text
    assert "plotly" not in page.scripts
