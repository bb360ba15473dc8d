"""Pages in a headless Chromium, by real events: `make browser-tests`.

Skipped where Playwright or a browser is absent. PELLICLE_BROWSER names another Chromium.
"""

from dataclasses import replace

import numpy as np
import pytest

from pellicle.fitting.result import Profile
from pellicle.reporting.folders import LIBRARY, SELF_CONTAINED, folder_per_file, write_fit, write_index
from pellicle.reporting.json_record import failure, to_json
from pellicle.reporting.page.batch_page import batch_page
from pellicle.reporting.page.fit_pages import fit_page
from tests.browser import pages, wait_for

IMAGE = b"\x89PNG\r\n"
HOVER = ":is(.hoverlayer .hovertext, .hoverlayer .legend)"


@pytest.fixture
def curved(curved):
    """The fit with the curves of its rivals and a scan."""
    scan = Profile(np.linspace(100.0, 1000.0, 60), 60 + 50 * np.cos(np.linspace(0.0, 20.0, 60)))
    return replace(curved, profile=scan)


@pytest.fixture
def opened(browser, tmp_path):
    """Function that opens a page from disk at a width."""
    path = tmp_path / "report.html"
    with pages(browser, path.as_uri()) as new_page:

        def open_page(text, width=1400, scheme="light"):
            path.write_text(text, encoding="utf-8")
            page = new_page(width, scheme)
            page.goto(path.as_uri())
            page.set_viewport_size({"width": width, "height": 5000})  # figures are drawn when they are near
            for plot in page.query_selector_all(".plot"):
                page.wait_for_selector(f"#{plot.get_attribute('id')}[data-ready]")
            return page

        yield open_page


def drawn(page, name, figure="data-0"):
    """Ordinates of the traces of a figure whose names begin with `name`."""
    traces = "document.getElementById(id).data.filter(t => t.name.startsWith(name))"
    return page.evaluate(f"([id, name]) => {traces}.map(t => t.y)", [figure, name])


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [400, 1400])
def test_it_opens_at_every_width_without_error_or_request(opened, curved, width, scheme):
    page = opened(fit_page(curved, IMAGE), width, scheme)
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert page.locator(".plot .main-svg").count() >= 3
    assert page.locator("#trouble").is_hidden()
    [box] = [page.locator("#data-0").bounding_box()]
    assert 0.8 * width < box["width"] + 32 <= width + 32
    background = page.evaluate("getComputedStyle(document.body).backgroundColor")
    assert (background == "rgb(255, 255, 255)") == (scheme == "light")


def test_a_rivals_button_shows_its_curve_and_hides_it_again(opened, curved):
    page = opened(fit_page(curved, IMAGE), 400)
    assert drawn(page, "rival: thickness 963.57 nm") == []
    button = page.get_by_role("button", name="Show thickness 963.57 nm")
    button.click()
    curve, residual = drawn(page, "rival: thickness 963.57 nm")
    assert np.allclose(curve, curved.curve.model + 0.02, rtol=1e-5)
    assert np.allclose(residual, curved.curve.residual - 0.02, atol=1e-6)
    assert button.get_attribute("aria-pressed") == "true"
    assert "thickness 963.57 nm" in page.locator("#rival-note").inner_text()
    page.get_by_role("button", name="Show thickness 242.87 nm").press("Enter")
    assert drawn(page, "rival: thickness 963.57 nm") == []
    assert len(drawn(page, "rival: thickness 242.87 nm")) == 2
    page.get_by_role("button", name="Show thickness 242.87 nm").press("Enter")
    assert drawn(page, "rival") == []


def test_a_click_on_a_rival_in_the_misfit_shows_its_curve(opened, curved):
    page = opened(fit_page(curved, IMAGE))
    x, y = page.evaluate(
        """() => {
          const plot = document.getElementById("misfit"), layout = plot._fullLayout;
          const points = plot.data.find((trace) => trace.name === "rivals");
          const box = plot.getBoundingClientRect();
          return [
            box.x + layout.xaxis._offset + layout.xaxis.d2p(points.x[0]),
            box.y + layout.yaxis._offset + layout.yaxis.d2p(points.y[0]),
          ];
        }"""
    )
    page.mouse.move(x - 5, y)
    page.mouse.move(x, y)
    page.locator(f"#misfit {HOVER}").first.wait_for()
    page.mouse.click(x, y)
    wait_for(page, lambda: drawn(page, "rival: thickness 242.87 nm"))
    [curve, _] = drawn(page, "rival: thickness 242.87 nm")
    assert np.allclose(curve, curved.curve.model + 0.01, rtol=1e-5)


def test_a_drag_zooms_and_a_double_click_shows_all(opened, curved):
    page = opened(fit_page(curved, IMAGE))
    box = page.locator("#data-0 .draglayer .nsewdrag").first.bounding_box()
    middle = box["y"] + box["height"] / 2

    def span():
        return np.ptp(page.evaluate("document.getElementById('data-0')._fullLayout.xaxis.range"))

    before = span()
    page.mouse.move(box["x"] + 0.4 * box["width"], middle)
    page.mouse.down()
    page.mouse.move(box["x"] + 0.6 * box["width"], middle, steps=5)
    page.mouse.up()
    wait_for(page, lambda: span() == pytest.approx(0.2 * before, rel=0.05))
    page.mouse.move(box["x"] + 0.5 * box["width"], middle, steps=3)
    page.locator(f"#data-0 {HOVER}").first.wait_for()
    page.mouse.dblclick(box["x"] + 0.5 * box["width"], middle)
    wait_for(page, lambda: span() == pytest.approx(before, rel=0.01))


def test_the_keyboard_reads_points_and_zooms(opened, curved):
    page = opened(fit_page(curved, IMAGE))
    plot = page.locator("#data-0")
    plot.focus()
    for _ in range(3):
        plot.press("ArrowRight")
    said = page.locator("#data-0-reading").inner_text()
    assert said.startswith("wavelength (nm) 420.00, reflectance ")

    def limits():
        return page.evaluate("document.getElementById('data-0')._fullLayout.xaxis.range")

    before = limits()
    plot.press("+")
    wait_for(page, lambda: np.ptp(limits()) == pytest.approx(np.ptp(before) / 2))
    after = limits()
    assert after[0] < 420 < after[1]


def test_the_numbers_of_a_figure_unfold_as_a_table(opened, curved):
    page = opened(fit_page(curved, IMAGE))
    page.locator("details[data-figure='data-0'] summary").click()
    rows = page.locator("details[data-figure='data-0'] tbody tr")
    rows.last.wait_for()
    assert rows.count() == 41
    shown = float(rows.nth(4).locator("td").nth(1).inner_text())
    assert shown == pytest.approx(curved.curve.data[4], rel=1e-5)


def test_colours_follow_the_mode_while_the_page_is_open(opened, curved):
    page = opened(fit_page(curved, IMAGE))
    colour = "document.getElementById('data-0').data.find((t) => t.name === 'fit').line.color"
    light = page.evaluate(colour)
    page.emulate_media(color_scheme="dark")
    wait_for(page, lambda: page.evaluate(colour) != light)


def test_nothing_in_a_file_name_or_message_runs(opened, curved):
    nasty = "</script><script>alert(1)</script><img src=x onerror=alert(2)><a href='javascript:x()'>x</a>"
    [part] = curved.parts
    wrong = replace(curved, warnings=(nasty,), verdict=nasty, parts=(replace(part, name=nasty),))
    page = opened(fit_page(wrong, IMAGE, again=[(nasty, nasty)]))
    assert page.locator("ul.warnings li").inner_text() == nasty
    assert page.locator("a[href^='javascript']").count() == 0


def test_the_table_of_a_batch_sorts_filters_and_leads_to_pages(browser, curved, tmp_path):
    thicker = replace(curved.parameters["thickness"], value=900.0)
    other = replace(curved, parameters=curved.parameters | {"thickness": thicker}, rivals=())
    records = [to_json(other), failure("/data/<b>broken.csv", "no <i>numbers"), to_json(curved)]
    root = write_fit(tmp_path / "out" / "one", curved).parent
    (root / "result.json").write_text('{"schema": "pellicle.fits/1"}')
    write_index(root, records, [root / "none", root / "two", root / "one"])
    page = browser.new_page(viewport={"width": 1400, "height": 900})
    page.goto((root / "report.html").as_uri())
    rows = "[...document.querySelectorAll('tbody tr:not([hidden])')]"
    names = f"{rows}.map((row) => row.cells[3].dataset.value)"
    assert page.evaluate(names) == ["900", "", "486.28"]
    head = page.get_by_role("button", name="thickness (nm)")
    head.click()
    assert page.evaluate(names) == ["486.28", "900", ""]
    assert page.locator("th[aria-sort=ascending]").inner_text() == "thickness (nm)"
    head.click()
    assert page.evaluate(names) == ["900", "486.28", ""]
    page.locator("#filter-status").select_option("failed")
    assert page.evaluate(names) == [""]
    assert page.locator("tbody tr:visible .verdict-cell").inner_text() == "no <i>numbers"
    page.locator("#filter-status").select_option("")
    page.locator("#filter-text").fill("film")
    assert page.locator("#filter-count").inner_text() == "2 of 3 shown"
    page.get_by_role("link", name="film.csv").click()
    page.wait_for_selector("#data-0[data-ready]")
    page.close()


def test_pages_of_many_fits_share_plotly(browser, curved, tmp_path):
    root = folder_per_file(tmp_path / "out", [f"{i}.csv" for i in range(SELF_CONTAINED + 1)])[0].parent
    text = (write_fit(root / "one", curved) / "report.html").read_text(encoding="utf-8")
    assert len(text) < 0.6 * len(fit_page(curved, (root / "one/figure.png").read_bytes()))
    page = browser.new_page(viewport={"width": 1400, "height": 2000})
    page.goto((root / "one/report.html").as_uri())
    page.wait_for_selector("#data-0[data-ready]")
    (root / LIBRARY).unlink()  # a page alone still has its picture, and a sentence
    page.reload()
    wait_for(page, lambda: "plotly.min.js is missing" in page.locator("#trouble").inner_text())
    assert page.locator("figure img").count()
    page.close()


def test_one_parameter_of_a_batch_is_chosen(opened, curved):
    record = to_json(curved)
    record["parameters"]["n"] = record["parameters"]["thickness"] | {"value": 1.5, "unit": ""}
    text = batch_page([record, record], [None, None])
    page = opened(text.replace(" hidden>", ">"))
    page.locator("#parameter").select_option("results-1")
    assert [page.locator(f"#{name}").is_visible() for name in ("results", "results-1")] == [False, True]
