"""Several angles of incidence in the explorer's page, by real events: `make browser-tests`."""

import numpy as np
import pytest

import pellicle as pl
from tests.browser import wait_for
from tests.explorer.page import drop, explorer, number, opening, settle, slider

pytest.importorskip("uvicorn", reason="uvicorn is absent: make browser-tests")
pytest.importorskip("starlette", reason="Starlette is absent: make browser-tests")

RECIPE = """
[data]
signal = "psi-delta"
angle = [65, 70, 75]
wavelengths = { start = 400, stop = 800, step = 4 }

[scene]
substrate = "Si"

[[scene.layer]]
material = "SiO2"
thickness = { lower = 50, upper = 600, value = 250 }
"""


@pytest.fixture
def opened(browser, address):
    with opening(browser, address) as open_page:
        yield open_page


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    with explorer(tmp_path_factory.mktemp("angles"), RECIPE) as (_, address):
        yield address


def traces(page, mode="lines"):
    """Lines or markers of the plot by their labels, those before the last change left out."""
    script = """(mode) => document.querySelector('.plot').data.filter((t) => t.mode === mode && !t.opacity)
      .map(({ meta, name, x, y, yaxis, showlegend, line, marker }) =>
        ({ meta, name, x, y, yaxis, showlegend, color: (line ?? marker).color }))"""
    return {trace["meta"]: trace for trace in page.evaluate(script, mode)}


def agrees(page, angles, thickness, atol=2e-3):
    drawn = traces(page)
    assert list(drawn) == [f"{signal} {angle:g}°" for signal in "ΨΔ" for angle in angles]
    layer = pl.Layer("SiO2", thickness)
    for angle in angles:
        light = pl.Light(angle=float(angle), signal="psi-delta")
        truth = pl.simulate(pl.Scene(layer, "Si", light=light), nm(page))
        for quantity, values in (("Ψ", truth.values), ("Δ", truth.delta)):
            own = drawn[f"{quantity} {angle:g}°"]["y"]
            assert np.allclose([y for y in own if y is not None], values, rtol=0, atol=atol)
    return True


def nm(page):
    ends = traces(page)["Ψ 70°"]["x"]
    return np.array(ends)


def angle_list(page):
    return page.get_by_role("textbox", name="angles")


@pytest.mark.parametrize(("width", "scheme"), [(400, "dark"), (1400, "light")])
def test_each_angle_has_its_colour_in_both_panels_and_one_entry(opened, width, scheme):
    page = opened(width=width, scheme=scheme)
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert agrees(page, (65, 70, 75), 250.0)
    drawn = traces(page)
    colour = "(name) => getComputedStyle(document.querySelector('.plot')).getPropertyValue(name).trim()"
    expected = [page.evaluate(colour, name) for name in ("--fit", "--blue", "--green")]  # those of reports
    for quantity, panel in (("Ψ", "y"), ("Δ", "y2")):
        own = [drawn[f"{quantity} {angle}°"] for angle in (65, 70, 75)]
        assert [trace["color"] for trace in own] == expected
        assert {trace["yaxis"] for trace in own} == {panel}
        assert [trace["name"] for trace in own] == ["65°", "70°", "75°"]
        assert [trace["showlegend"] for trace in own] == [quantity == "Ψ"] * 3
    assert "at 65°, 70°, 75°" in page.locator(".plot").get_attribute("aria-label")
    assert page.get_by_role("slider", name="angle of incidence in °").count() == 0
    assert page.locator(".patch").evaluate("(e) => getComputedStyle(e).backgroundImage").count("rgb") == 6
    page.locator(".plot").focus()
    page.keyboard.press("ArrowRight")
    assert "Ψ 65° " in page.locator(".reading").inner_text()


def test_a_slider_moves_every_curve_and_the_list_is_edited_by_keys(opened):
    page = opened()
    slider(page).focus()
    for _ in range(3):
        page.keyboard.press("PageUp")
    settle(page)
    value = float(number(page).input_value())
    assert value > 250
    assert agrees(page, (65, 70, 75), value)
    box = angle_list(page)
    assert box.input_value() == "65, 70, 75"
    box.fill("70 60")
    box.press("Enter")
    settle(page)
    assert agrees(page, (60, 70), value)
    assert box.input_value() == "60, 70"
    assert page.evaluate("document.activeElement.type") == "text"
    assert "angles=60%2C70" in page.url
    page.reload()
    settle(page)
    assert agrees(page, (60, 70), value)
    box.fill("70, 95")
    box.press("Enter")
    page.wait_for_selector(".trouble:not([hidden])")
    assert "from 0 to 89" in page.get_by_role("alert").inner_text()
    assert box.get_attribute("aria-invalid") == "true"
    box.fill("72")
    box.press("Enter")
    settle(page)
    assert page.locator(".trouble").is_hidden()
    assert page.get_by_role("spinbutton", name="angle of incidence (°)").input_value() == "72"
    page.get_by_role("button", name="Reset", exact=True).click()
    settle(page)
    assert agrees(page, (65, 70, 75), 250.0)
    assert "angles" not in page.url


def test_of_two_lists_the_later_counts_though_its_answer_comes_first(opened):
    page = opened()
    asked = []

    def first_is_late(route):
        asked.append(route.request.url)
        if len(asked) == 1:
            page.wait_for_timeout(1500)
        route.continue_()

    page.route("**/api/scene*", first_is_late)
    box = angle_list(page)
    for listed in ("60, 70", "55, 65"):
        box.fill(listed)
        box.press("Enter")
    settle(page)
    assert len(asked) == 2
    drawn = list(traces(page))
    assert drawn == [f"{signal} {angle}°" for signal in "ΨΔ" for angle in (55, 65)]
    assert box.input_value() == "55, 65"


def test_an_address_with_wrong_angles_shows_the_scene(opened):
    page = opened("&angles=65,x&thickness=300")
    assert "from 0 to 89" in page.get_by_role("alert").inner_text()
    assert agrees(page, (65, 70, 75), 300.0)


def drop_spectrum(page, name, spectrum):
    """Drop a file of Ψ and Δ on the page."""
    rows = np.transpose([spectrum.wavelength, spectrum.angle, spectrum.values, spectrum.delta])
    lines = [",".join(map(str, row)) for row in rows]
    text = "\n".join(["wavelength_nm,angle_deg,psi_deg,delta_deg", *lines])
    drop(page, name, text.encode())
    page.locator(".notes").get_by_text(name).first.wait_for()
    both = """() => {
      const { data } = document.querySelector(".plot");
      const curve = (label) => data.some((t) => t.mode === "lines" && t.meta === label);
      return data.some((t) => t.mode === "markers") && data.every((t) => t.mode === "lines" || curve(t.meta));
    }"""
    page.wait_for_function(both, timeout=60_000)
    settle(page)


def lines(page):
    """Lines on the screen in pixels, by trace: NaN before each piece of an interrupted one."""
    script = """() => [...document.querySelectorAll('.plot .scatterlayer .trace')].map((trace) =>
      [...trace.querySelectorAll('.js-line')].map((path) => path.getAttribute('d')).join(''))"""
    pieces = [path.replace("M", "LNaN,NaNL").split("L")[1:] for path in page.evaluate(script)]
    return [np.array([point.split(",") for point in points], float).reshape(-1, 2) for points in pieces]


def test_while_a_slider_is_dragged_the_lines_are_those_that_plotly_draws(opened):
    page = opened()
    drop_spectrum(page, "wafer.csv", measured((65.0, 70.0, 75.0), np.arange(400.0, 801.0, 10.0)))
    page.evaluate("""() => {
      const { react } = window.Plotly;
      Object.assign(window, { whole: 0, drawn: 0 });
      window.Plotly.react = (...all) => { window.whole += 1; return react(...all); };
      document.querySelector("main").addEventListener("drawn", ({ detail }) => {
        window.drawn += 1;
        window.thickness = detail.values.thickness;
      });
    }""")
    box = slider(page).bounding_box()
    middle = box["y"] + box["height"] / 2
    page.mouse.move(box["x"] + 0.36 * box["width"], middle)
    page.mouse.down()
    for share in np.linspace(0.4, 0.8, 20):
        page.mouse.move(box["x"] + share * box["width"], middle)
        page.wait_for_timeout(60)
    value = float(number(page).input_value())
    wait_for(page, lambda: page.evaluate("thickness") == value)
    assert 2 * page.evaluate("whole") <= page.evaluate("drawn") > 5
    moved = lines(page)
    page.evaluate("((el) => Plotly.react(el, el.data, el.layout))(document.querySelector('.plot'))")
    whole = lines(page)
    page.mouse.up()
    assert [len(points) for points in moved] == [len(points) for points in whole]
    for ours, plotly in zip(moved, whole, strict=True):
        assert np.allclose(ours, plotly, rtol=0, atol=0.01, equal_nan=True)
    pieces = [int(np.isnan(points).any(axis=1).sum()) for points in moved if len(points)]
    assert sum(pieces) > len(pieces)  # Δ passes 360 degrees


def measured(angles, wavelength):
    pairs = np.repeat(angles, len(wavelength)), np.tile(wavelength, len(angles))
    light = pl.Light(angle=pairs[0], signal="psi-delta")
    return pl.simulate(pl.Scene(pl.Layer("SiO2", 320.0), "Si", light=light), pairs[1], noise=0.05, seed=1)


def test_a_dropped_file_of_several_angles_is_fitted_and_one_wavelength_is_drawn_against_them(opened):
    page = opened()
    drop_spectrum(page, "wafer.csv", measured((55.0, 65.0), np.arange(400.0, 800.0, 20.0)))
    assert angle_list(page).input_value() == "55, 65"
    data = traces(page, "markers")
    assert {label: len(trace["x"]) for label, trace in data.items()} == dict.fromkeys(
        ("Ψ 55°", "Ψ 65°", "Δ 55°", "Δ 65°"), 20
    )
    assert data["Δ 65°"]["color"] == traces(page)["Δ 65°"]["color"] != data["Δ 55°"]["color"]
    page.get_by_role("button", name="Fit", exact=True).click()
    page.wait_for_selector(".fitted p", timeout=120_000)
    settle(page)
    thickness = number(page)
    assert float(thickness.input_value()) == pytest.approx(320.0, abs=0.3)
    drop_spectrum(page, "laser.csv", measured(np.arange(50.0, 71.0, 2.0), np.array([633.0])))
    title = "document.querySelector('.plot').layout.xaxis.title.text"
    assert page.evaluate(title) == "angle of incidence (°)"
    assert traces(page, "markers")["Ψ"]["x"] == np.arange(50.0, 71.0, 2.0).tolist()
    assert angle_list(page).is_hidden()
    assert "against the angle of incidence" in page.locator(".angles").inner_text()
    curve = traces(page)["Δ"]
    assert (curve["x"][0], curve["x"][-1]) == (50.0, 70.0)
