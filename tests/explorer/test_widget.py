"""The explorer's widget: messages of its Python side, and its script in a headless Chromium."""

import json
import time

import numpy as np
import pytest

import pellicle as pl
from tests.browser import pages, wait_for

pytest.importorskip("anywidget", reason="anywidget is absent: pip install 'pellicle[explore]'")

WAVELENGTH = np.linspace(400.0, 800.0, 64)


@pytest.fixture(scope="module")
def widget():
    return pl.explore(pl.Scene(pl.Layer(1.46, 250.0), 3.9), wavelength=WAVELENGTH)


@pytest.fixture
def sent(widget, monkeypatch):
    """Answers of the widget."""
    sent = []
    monkeypatch.setattr(type(widget), "send", lambda self, content, buffers=None: sent.append(content))
    return sent


@pytest.fixture
def ask(widget, sent):
    """Function that sends a message as the notebook does, and returns the answer."""

    def ask(request, body, count=[0]):  # noqa: B006
        count[0] += 1
        message = {"id": f"view-{count[0]}", "request": request, "body": body}
        widget._handle_custom_msg(json.loads(json.dumps(message)), [])
        until = time.monotonic() + 30
        while not (found := [each for each in sent if each["id"] == message["id"]]):
            assert time.monotonic() < until, f"{request} has no answer"
            time.sleep(0.01)
        [answer] = found
        return json.loads(json.dumps(answer["answer"], allow_nan=False))

    return ask


def test_values_are_those_of_the_sliders(widget, ask):
    controls = ask("scene", {})["controls"]
    assert widget.values == {each["name"]: each["value"] for each in controls}
    assert widget.values["thickness"] == 250.0


def test_a_view_is_that_of_the_library(ask):
    answer = ask("view", {"values": {"thickness": 300.0}, "want": ["curves"], "serial": 7, "wait": True})
    assert answer["serial"] == 7
    [curve] = answer["curves"]
    assert np.allclose(curve["x"], WAVELENGTH, atol=1e-4)
    assert np.allclose(curve["y"], pl.reflectance(WAVELENGTH, 300.0, 1.46, 3.9), atol=2e-7)


def test_its_recipe_has_the_angles_of_the_list(widget):
    before = widget.values
    widget.angles = [40, 50]
    assert "angle = [40, 50]" in widget.recipe()
    assert "angle" in before
    assert "angle" not in widget.values
    with pytest.raises(ValueError, match="from 0 to 89"):
        widget.angles = [95]
    widget.angles = []
    assert widget.values == before
    assert "angle" not in widget.recipe()


def test_other_messages_are_ignored(widget, ask, sent):
    widget._handle_custom_msg("text", [])
    widget._handle_custom_msg({"request": "scene"}, [])
    ask("scene", {})
    assert len(sent) == 1


def test_its_module_loads_nothing(widget):
    module = widget._esm
    assert "export default" in module
    own = module[: module.index("const PLOTLY")]
    assert not any(word in own for word in ("import ", "import(", "http:", "https:", "fetch("))


MODEL = """async (module) => {
  const listeners = [];
  const traits = { angles: [] };
  window.saved = [];
  window.model = {
    get: (name) => traits[name],
    set: (name, value) => { traits[name] = value; },
    save_changes: () => window.saved.push({ ...traits }),
    on: (name, listener) => listeners.push([name, listener]),
    off: () => {},
    send: async (message) => {
      const answer = await window.ask(message.request, message.body);
      for (const [name, listener] of listeners) {
        if (name === "msg:custom") listener({ id: message.id, answer });
      }
    },
    fromPython: (wanted) => {
      Object.assign(traits, wanted);
      for (const [name, listener] of listeners) if (name.slice("change:".length) in wanted) listener();
    },
  };
  traits.values = await window.ask("defaults", {});
  const address = URL.createObjectURL(new Blob([module], { type: "text/javascript" }));
  const { default: widget } = await import(address);
  window.close = await widget.render({ model, el: document.getElementById("cell") });
}"""
"""A stand-in for anywidget's model, whose messages go to the session."""


@pytest.fixture
def cell(browser, widget):
    """A page that shows the widget as a notebook does, without a network."""
    defaults = widget.values

    def answer(request, body):
        return defaults if request == "defaults" else widget._session.answer(request, body)

    with pages(browser) as new_page:
        page = new_page(700)
        page.expose_function("ask", answer)
        page.set_content("<!doctype html><body data-jp-theme-light='false'><div id='cell'></div></body>")
        page.route("**/*", lambda route: route.abort())
        page.add_style_tag(content=widget._css)
        page.evaluate(MODEL, widget._esm)
        page.wait_for_selector(".plot[data-ready]")
        page.wait_for_selector(".pellicle-explorer:not(.compiling)")
        yield page


def test_the_widget_follows_its_slider_and_its_model(cell):
    curve = "document.querySelector('.plot').data.find((t) => t.name === 'R').y"
    assert np.allclose(cell.evaluate(curve), pl.reflectance(WAVELENGTH, 250.0, 1.46, 3.9), atol=2e-7)
    background = "getComputedStyle(document.querySelector('.pellicle-explorer')).backgroundColor"
    assert cell.evaluate(background) == "rgb(18, 23, 28)"  # dark as the notebook, in a light browser
    cell.get_by_role("slider", name="thickness in nm").press("PageUp")

    def follows(thickness):
        return np.allclose(cell.evaluate(curve), pl.reflectance(WAVELENGTH, thickness, 1.46, 3.9), atol=2e-7)

    thickness = "saved.at(-1)?.values.thickness ?? 250"
    wait_for(cell, lambda: cell.evaluate(thickness) > 250 and follows(cell.evaluate(thickness)))
    cell.evaluate("model.fromPython({ values: { ...model.get('values'), thickness: 321 } })")
    wait_for(cell, lambda: follows(321.0))
    assert cell.get_by_role("spinbutton", name="thickness (nm)").input_value() == "321"
    cell.evaluate("model.fromPython({ angles: [40, 50] })")
    drawn = "document.querySelector('.plot').data.map((t) => t.meta).join() === 'R 40°,R 50°'"
    cell.wait_for_function(drawn, timeout=60_000)  # compiles a program
    cell.wait_for_selector(".pellicle-explorer:not(.compiling)")
    # the model is saved after the drawing
    wait_for(cell, lambda: cell.evaluate("saved.at(-1)").get("angles") == [40, 50])
    saved = cell.evaluate("saved.at(-1)")
    assert saved["values"]["thickness"] == 321
    assert "angle" not in saved["values"]
    assert cell.get_by_role("button", name="Copy link").count() == 0
    cell.evaluate("close()")
