"""The explorer in a headless Chromium, by real events: `make browser-tests`.

Skipped where Playwright, a browser or packages of the server are absent. PELLICLE_BROWSER names a Chromium.
"""

import json
import signal
import subprocess
import sys
from urllib.parse import unquote

import numpy as np
import pytest

import pellicle as pl
from tests.browser import wait_for
from tests.explorer.page import curve, drop, explorer, number, opening, settle, slider

pytest.importorskip("uvicorn", reason="uvicorn is absent: make browser-tests")
pytest.importorskip("starlette", reason="Starlette is absent: make browser-tests")

RECIPE = """
[data]
signal = "R"
wavelengths = { start = 400, stop = 800, step = 2 }

[scene]
ambient = "air"
substrate = "Si"

[[scene.layer]]
material = "SiO2"
thickness = { lower = 50, upper = 600, value = 250 }
"""


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    with explorer(tmp_path_factory.mktemp("explorer"), RECIPE) as (_, address):
        yield address


@pytest.fixture
def opened(browser, address):
    with opening(browser, address) as open_page:
        yield open_page


def agrees(page, thickness, atol=2e-6):
    return np.allclose(curve(page), reflectance(thickness, curve(page, axis="x")), atol=atol)


def shown(page):
    """What follows the sliders: the curve, the colour, the sphere, the address."""
    page.wait_for_selector(".sphere:not([hidden])")
    style = "getComputedStyle(document.querySelector('.patch')).backgroundColor"
    return {
        "curve": curve(page),
        "colour": page.evaluate(style),
        "sphere": page.locator(".sphere").get_attribute("src"),
        "address": page.url,
    }


def reflectance(thickness, wavelength=None):
    wavelength = np.arange(400.0, 801.0, 2.0) if wavelength is None else np.asarray(wavelength)
    return pl.reflectance(wavelength, thickness, pl.material("SiO2"), pl.material("Si"))


def csv(thickness=320.0, noise=0.002):
    wavelength = np.arange(420.0, 781.0, 4.0)
    values = np.array(reflectance(thickness, wavelength))
    values += noise * np.random.default_rng(1).standard_normal(len(values))
    rows = "\n".join(f"{x:g},{y:.6f}" for x, y in zip(wavelength, values, strict=True))
    return f"wavelength_nm,R\n{rows}\n".encode()


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [400, 1400])
def test_it_opens_at_every_width_without_error_or_foreign_request(opened, width, scheme):
    page = opened(width=width, scheme=scheme)
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert agrees(page, 250.0)
    background = page.evaluate("getComputedStyle(document.body).backgroundColor")
    assert (background == "rgb(255, 255, 255)") == (scheme == "light")
    left = [page.locator(place).bounding_box()["x"] for place in (".spectrum", ".controls")]
    beside = left[0] > left[1] + 100
    assert beside == (width == 1400)
    assert page.locator(".trouble").is_hidden()
    assert "L*" in page.locator(".patch").get_attribute("aria-label")
    assert "R: least" in page.locator("figcaption").inner_text()


def test_the_plot_follows_the_width_of_the_window(opened):
    page = opened()

    def sizes(place):
        box = page.locator(place).first.bounding_box()
        return [box["width"], box["height"]]

    for width in (1000, 420, 1300):
        page.set_viewport_size({"width": width, "height": 800})
        wait_for(page, lambda: sizes(".plot .main-svg") == pytest.approx(sizes(".plot"), abs=3))
        assert page.evaluate("document.documentElement.scrollWidth") <= width


def test_keys_on_a_slider_move_everything(opened):
    page = opened()
    before = shown(page)
    slider(page).focus()
    for _ in range(3):
        page.keyboard.press("PageUp")
    settle(page)
    after = shown(page)
    value = float(number(page).input_value())
    assert value > 250
    assert agrees(page, value)
    assert np.allclose(curve(page, "R before"), before["curve"])
    assert all(after[key] != before[key] for key in before)
    assert f"thickness={value:g}" in after["address"]
    page.keyboard.press("Delete")
    settle(page)
    assert np.allclose(curve(page), before["curve"])
    assert page.url == before["address"]


def test_a_drag_moves_everything_and_a_double_click_resets(opened):
    page = opened()
    before, box = shown(page), slider(page).bounding_box()
    middle = box["y"] + box["height"] / 2
    page.mouse.move(box["x"] + 0.36 * box["width"], middle)
    page.mouse.down()
    page.mouse.move(box["x"] + 0.75 * box["width"], middle, steps=10)
    wait_for(page, lambda: not np.allclose(curve(page), before["curve"]))
    assert page.url == before["address"]  # the address follows the release
    page.mouse.up()
    settle(page)
    after = shown(page)
    value = float(number(page).input_value())
    assert 400 < value < 520
    assert agrees(page, value)
    assert all(after[key] != before[key] for key in before)
    page.mouse.dblclick(box["x"] + 0.5 * box["width"], middle)
    settle(page)
    assert number(page).input_value() == "250"
    assert np.allclose(curve(page), before["curve"])


def test_a_number_is_typed(opened):
    page = opened()
    box = number(page)
    box.fill("123.4")
    box.press("Enter")
    settle(page)
    assert agrees(page, 123.4)
    box.fill("9999")
    box.press("Tab")
    assert box.input_value() == "600"


def test_a_dropped_file_is_drawn_and_fitted(opened):
    page = opened()
    drop(page, "wafer.csv", csv())
    page.locator(".notes").get_by_text("wafer.csv").first.wait_for()
    page.wait_for_selector("main:not(.compiling)")
    assert len(curve(page, "R data")) == 91
    fit = page.get_by_role("button", name="Fit", exact=True)
    fit.click()
    page.wait_for_selector(".fitted p", timeout=120_000)
    settle(page)
    box = number(page)
    assert float(box.input_value()) == pytest.approx(320.0, abs=1.0)
    assert "(95 %), ±" in page.locator(".error-of-fit").first.inner_text()
    assert page.locator(".verdict.good").inner_text().startswith("converged: ")
    residual = np.array(curve(page, "R data")) - reflectance(
        float(box.input_value()), curve(page, "R data", "x")
    )
    assert np.allclose(curve(page, "R residual"), residual, atol=1e-4)
    assert page.get_by_text("Left out (").evaluate("(line) => line.tagName") == "SUMMARY"
    assert agrees(page, float(box.input_value()), atol=1e-4)  # six digits of the thickness
    page.reload()
    settle(page)
    assert len(curve(page, "R data")) == 91
    assert agrees(page, float(box.input_value()), atol=1e-4)


def test_a_click_on_a_film_that_is_left_shows_it(browser, tmp_path):
    """In a session of its own, whose scene becomes that of the film."""
    with explorer(tmp_path, RECIPE) as (_, address), opening(browser, address) as open_page:
        page = open_page()
        drop(page, "wafer.csv", csv())
        page.locator(".notes").get_by_text("wafer.csv").first.wait_for()
        page.get_by_role("button", name="Which film?").click()
        page.get_by_role("button", name="Show SiO2", exact=True).click(timeout=120_000)
        settle(page)
        assert float(number(page).input_value()) == pytest.approx(320.0, abs=8.0)
        assert len(curve(page, "R data")) == 91
        assert "SiO2" in page.locator(".fitted").inner_text()


def test_a_layer_is_added_in_the_page_and_a_reload_keeps_it(opened):
    page = opened()
    page.get_by_role("button", name="+ layer").click()
    page.get_by_role("combobox", name="material of layer 2").wait_for()
    settle(page)
    box = page.get_by_role("combobox", name="material of layer 1")
    box.fill("TiO3")
    box.press("Enter")
    said = page.get_by_role("group", name="layer 1", exact=True).locator(".bad")
    said.wait_for()
    assert "unknown material 'TiO3'" in said.inner_text()
    box.fill("TiO2")
    box.press("Enter")
    page.get_by_role("group", name="layer 1 (TiO2)").wait_for()
    settle(page)
    stack = pl.Scene([pl.Layer("TiO2", 100.0), pl.Layer("SiO2", 250.0)], "Si")
    expected = pl.simulate(stack, np.asarray(curve(page, axis="x"))).values
    assert np.allclose(curve(page), expected, atol=2e-6)
    page.reload()
    settle(page)
    assert np.allclose(curve(page), expected, atol=2e-6)
    page.get_by_role("button", name="Remove layer 1").click()
    page.get_by_role("group", name="layer 2").first.wait_for(state="detached")
    settle(page)
    assert agrees(page, 250.0)
    page.get_by_role("button", name="Reset", exact=True).click()
    wait_for(page, lambda: "film=" not in page.url)


SLOWLY = """() => {
  const before = window.fetch;
  window.fetch = async (address, options) => {
    if (address.endsWith("/api/layers")) await new Promise((ended) => setTimeout(ended, 1500));
    return before(address, options);
  };
}"""
"""Answers to changes of layers come late."""


def test_what_is_typed_while_the_page_is_made_anew_stays(opened):
    """Slow answers: one field is typed during the change of another, a second one is left."""
    page = opened()
    page.evaluate(SLOWLY)
    page.get_by_role("combobox", name="material of substrate").fill("BK7")
    page.keyboard.press("Enter")
    thickness = page.get_by_role("textbox", name="thickness in nm of layer 1")
    thickness.fill("100:40")
    page.get_by_role("combobox", name="material of ambient").fill("1.3")
    page.keyboard.press("Tab")
    thickness.focus()
    page.keyboard.press("End")
    wait_for(page, lambda: "BK7" in page.url)
    settle(page)
    assert thickness.evaluate("(field) => field === document.activeElement")
    page.keyboard.type("0")
    page.keyboard.press("Enter")
    settle(page)
    wait_for(page, lambda: "1.3|SiO2@100:400|BK7" in unquote(page.url))
    scene = pl.Scene(pl.Layer("SiO2", float(number(page).input_value())), "BK7", ambient=1.3)
    assert np.allclose(curve(page), pl.simulate(scene, np.asarray(curve(page, axis="x"))).values, atol=2e-6)
    page.get_by_role("button", name="Reset", exact=True).click()
    wait_for(page, lambda: "film=" not in page.url)


BAD = {
    "words.csv": b"this is a letter\nand no spectrum\n",
    "empty.csv": b"",
    "binary.csv": bytes(range(256)) * 40,
    "huge.csv": b"400,0.5\n" * 3_000_000,
    "<img src=x onerror=alert(1)>.csv": b"wavelength,R\n400,<script>alert(2)</script>\n",
}


@pytest.mark.parametrize("name", BAD)
def test_a_bad_file_gives_one_sentence_and_the_page_lives_on(opened, name):
    page = opened()
    drop(page, name, BAD[name])
    page.wait_for_selector(".trouble:not([hidden])", timeout=60_000)
    said = page.get_by_role("alert").inner_text()
    assert len(said) > 20
    assert "\n" not in said
    assert "Traceback" not in said
    slider(page).press("PageUp")
    settle(page)
    value = float(number(page).input_value())
    assert agrees(page, value)
    drop(page, "wafer.csv", csv())
    page.wait_for_selector(".trouble", state="hidden")


def test_fields_of_a_file_that_needs_them_are_without_the_notes_of_another(opened):
    page = opened()
    drop(page, "wafer.csv", csv())
    page.get_by_text("How wafer.csv is read").wait_for()
    assert page.locator(".how .notes li").count() > 0
    drop(page, "odd.csv", b"x;y\n400;12\n500;13\n600;14\n")
    page.get_by_text("How odd.csv is read").wait_for()
    assert page.locator(".how .notes li").count() == 0


def test_the_recipe_reads_back_and_the_snippet_runs(opened, tmp_path):
    page = opened("&thickness=300")
    page.get_by_role("button", name="Recipe").click()
    with page.expect_download() as download:
        page.get_by_role("link", name="Download").click()
    path = tmp_path / "recipe.toml"
    download.value.save_as(path)
    assert path.read_text() == page.locator("dialog code").text_content()
    layer = pl.read_recipe(path).scene().layers[0]
    assert layer.thickness == pl.Free(50.0, 600.0, start=300.0)
    page.keyboard.press("Escape")
    page.get_by_role("button", name="Python").click()
    page.get_by_role("heading", name="Python").wait_for()
    code = page.locator("dialog code").text_content()
    (tmp_path / "wafer.csv").write_bytes(csv())
    ran = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr


def test_one_request_is_sent_at_a_time_and_the_newest_next(browser, address):
    """Slow answers: the sliders' events in between are not queued."""
    page = browser.new_page()
    bodies = []

    def slowly(route):
        body = json.loads(route.request.post_data)
        if "curves" in body["want"]:
            bodies.append(body["values"]["thickness"])
            page.wait_for_timeout(150)
        route.continue_()

    page.goto(address)
    settle(page)
    page.route("**/api/view", slowly)
    slider(page).focus()
    for _ in range(10):
        page.keyboard.press("ArrowRight")
    settle(page)
    last = float(number(page).input_value())
    assert bodies[-1] == last
    assert len(bodies) < 10
    assert agrees(page, last)
    page.close()


def test_a_server_that_ended_is_said_in_one_sentence(browser, tmp_path):
    with explorer(tmp_path, RECIPE) as (server, address):
        page = browser.new_page()
        page.goto(address)
        settle(page)
        server.send_signal(signal.SIGINT)
        server.wait(timeout=20)
    slider(page).press("PageUp")
    page.wait_for_selector(".trouble:not([hidden])")
    assert "does not answer" in page.get_by_role("alert").inner_text()
    page.close()
