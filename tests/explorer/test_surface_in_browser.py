"""A surface in the explorer's page, and samples of its BRDF, by real events: `make browser-tests`."""

import numpy as np
import pytest

import pellicle as pl
from tests.explorer.page import curve, drop, explorer, number, opening, settle, slider

pytest.importorskip("uvicorn", reason="uvicorn is absent: make browser-tests")
pytest.importorskip("starlette", reason="Starlette is absent: make browser-tests")

SURFACE = """
[scene.surface]
model = "microfacet-film"
wavelengths = [645, 525, 445]
thickness = { value = 180, lower = 100, upper = 300 }
n = 1.46
roughness = 0.2
base_n = 2.9
base_k = 3.0
"""


def samples(thickness):
    """File of BRDF samples of the surface with another thickness, with noise of 0.002/sr."""
    numbers = {"thickness": thickness, "n": 1.46, "roughness": 0.2, "base_n": 2.9, "base_k": 3.0}
    measured = pl.simulate(pl.Surface("microfacet-film", numbers), noise=0.002)
    columns = [measured.theta_i, measured.phi_i, measured.theta_o, measured.phi_o, measured.values]
    rows = (",".join(f"{x:.9g}" for x in row) for row in np.column_stack(columns))
    return "\n".join(["theta_i,phi_i,theta_o,phi_o,R,G,B", *rows]).encode()


def test_a_surface_shows_its_lobes_in_one_panel(browser, tmp_path):
    with explorer(tmp_path, SURFACE) as (_, address), opening(browser, address) as open_page:
        page = open_page()
        lobes = [curve(page, name) for name in ("645 nm", "525 nm", "445 nm")]
        assert page.evaluate("document.querySelector('.plot').data.map((t) => t.yaxis)") == ["y"] * 3
        assert min(map(min, lobes)) >= 0
        slider(page).press("PageUp")
        settle(page)
        assert curve(page, "645 nm") != lobes[0]
        assert page.locator(".patch").is_hidden()
        assert page.get_by_role("button", name="Which film?").is_hidden()


def test_samples_dropped_on_a_surface_are_drawn_fitted_and_removed(browser, tmp_path):
    with explorer(tmp_path, SURFACE) as (_, address), opening(browser, address) as open_page:
        page = open_page()
        drop(page, "blade.csv", samples(230.0))
        page.locator(".notes").get_by_text("blade.csv").first.wait_for()
        settle(page)
        assert len(curve(page, "525 nm data")) == len(curve(page, "525 nm")) == 400
        assert np.std(curve(page, "525 nm residual")) > 0.01  # 180 nm are not 230
        page.get_by_role("button", name="Fit", exact=True).click()
        page.wait_for_selector(".verdict", timeout=300_000)
        settle(page)
        assert float(number(page).input_value()) == pytest.approx(230.0, abs=1.0)
        assert "Evidence of a layer" in page.locator(".verdict.good").inner_text()
        assert np.std(curve(page, "525 nm residual")) < 0.003
        page.get_by_role("button", name="Remove blade.csv").click()
        page.get_by_role("slider", name="angle of incidence of the lobes").wait_for()
        settle(page)
        assert curve(page, "525 nm data") is None
