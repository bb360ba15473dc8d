"""Pages of fits, comparisons and maps: self-contained, escaped, with their numbers."""

import json
import math
import os
import re
from dataclasses import replace
from html.parser import HTMLParser

import equinox as eqx
import numpy as np
import pytest

from pellicle.fitting.batch.data import CODES
from pellicle.fitting.comparison import Candidate, Comparison
from pellicle.fitting.result import Estimate, Rival
from pellicle.recipes.read import read_recipe
from pellicle.reporting.comparison import comparison_page
from pellicle.reporting.json_record import failure, to_json
from pellicle.reporting.map_figures import map_page
from pellicle.reporting.map_summary import summarise
from pellicle.reporting.page.batch_page import batch_page
from pellicle.reporting.page.fit_pages import fit_page
from pellicle.reporting.page.repetition import repetition
from pellicle.scene.film import Light, Scene, with_wavelength
from pellicle.scene.free import Free
from pellicle.scene.layers import Layer
from pellicle.scene.surface import Surface
from pellicle.simulation.surface_sphere import in_plane
from tests.reporting.test_map_text import image, made

IMAGE = b"\x89PNG\r\n"
VOID = {"meta", "img", "input", "br", "link", "hr"}


class Page(HTMLParser):
    """Elements of a page with their attributes, its text outside scripts and styles, what is not closed."""

    def __init__(self, text):
        super().__init__(convert_charrefs=True)
        self.elements, self.text, self.open, self.scripts = [], "", [], {}
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attributes):
        self.elements.append((tag, dict(attributes)))
        if tag not in VOID:
            self.open.append((tag, dict(attributes)))

    def handle_endtag(self, tag):
        assert self.open.pop()[0] == tag

    def handle_data(self, data):
        tag, attributes = self.open[-1] if self.open else ("", {})
        if tag in ("script", "style"):
            self.scripts[attributes.get("id", tag)] = self.scripts.get(attributes.get("id", tag), "") + data
        else:
            self.text += data

    @property
    def figures(self):
        return {figure["id"]: figure for figure in json.loads(self.scripts["figures"])}


def test_it_is_one_file_that_loads_nothing(fit):
    text = fit_page(fit, IMAGE)
    page = Page(text)
    assert not page.open
    for _, attributes in page.elements:
        for name in ("src", "href", "action", "srcset", "poster"):
            assert attributes.get(name, "#").startswith(("#", "data:"))
        if "http-equiv" in attributes:
            policy = attributes["content"]
    assert policy.startswith("default-src 'none'")
    assert "http" not in policy
    assert "@import" not in text
    assert "url(" not in page.scripts["style"]
    assert len(text.encode()) < 1_500_000


def test_names_and_messages_are_text_and_nothing_else(fit, with_part):
    nasty = "</script><script>alert(1)</script><img src=x onerror=alert(2)>'\"&amp;"
    plain = Page(fit_page(fit, IMAGE))
    wrong = with_part(fit, data=replace(fit.parts[0].data, path=f"/data/{nasty}", notes=(nasty,)), name=nasty)
    words = {"verdict": nasty, "warnings": (nasty,), "correlation_names": (nasty, *fit.correlation_names[1:])}
    wrong = replace(wrong, rivals=(Rival({nasty: 1.0, "thickness": 3.0}, 2.0),), **words)
    page = Page(fit_page(wrong, IMAGE, again=[(nasty, nasty)]))
    assert page.text.count(nasty) >= 6
    kinds = [tag for tag, _ in page.elements]
    for tag in ("script", "style"):
        assert kinds.count(tag) == [each for each, _ in plain.elements].count(tag)
    assert kinds.count("img") == 1
    assert not any(name.startswith("on") for _, attributes in page.elements for name in attributes)
    drawn = json.dumps([{k: v for k, v in f.items() if k not in ("columns",)} for f in page.figures.values()])
    assert "<script" not in drawn.replace(json.dumps(nasty)[1:-1], "")


def test_the_figure_has_the_data_the_fit_and_the_residuals(curved):
    figure = Page(fit_page(curved, IMAGE)).figures["data-0"]
    curve = curved.parts[0].curve
    traces = {trace["name"]: trace for trace in figure["traces"]}
    for name, values in (("data", curve.data), ("fit", curve.model), ("residual", curve.residual)):
        assert np.allclose(traces[name]["x"], curve.wavelength)
        assert np.allclose(traces[name]["y"], values, rtol=1e-5)
    columns = {column["name"]: column["values"] for column in figure["columns"]}
    assert np.allclose(columns["residual"], curve.residual, rtol=1e-5)
    second = figure["rivals"][1]
    assert np.allclose(second[0]["y"], curve.model + 0.02, rtol=1e-5)
    assert np.allclose(second[1]["y"], curve.residual - 0.02, rtol=1e-5)
    assert second[0]["name"] == "rival: thickness 963.57 nm"
    assert [trace["showlegend"] for trace in second] == [True, False]


def test_each_part_of_a_joint_fit_has_its_own_figure_with_its_own_rivals(curved):
    [part] = curved.parts
    [curve] = curved.rivals[0].curves
    other = replace(curve, model=curve.model + 0.1)
    rival = replace(curved.rivals[0], curves=(curve, other))
    both = replace(curved, parts=(replace(part, name="one"), replace(part, name="two")), rivals=(rival,))
    figures = Page(fit_page(both, IMAGE)).figures
    for i, shown in enumerate((curve, other)):
        assert np.allclose(figures[f"data-{i}"]["rivals"][0][0]["y"], shown.model, rtol=1e-5)
    assert figures["data-1"]["layout"]["meta"].startswith("two: ")


def test_rivals_are_buttons_where_their_curves_are_known(fit, curved):
    for result, count in ((fit, 0), (curved, 2)):
        buttons = [a for tag, a in Page(fit_page(result, IMAGE)).elements if "data-rival" in a]
        assert [button["data-rival"] for button in buttons] == ["0", "1"][:count]


def test_a_missing_number_is_none(fit, with_part):
    holes = replace(fit.curve, model=np.where(np.arange(41) == 5, np.nan, fit.curve.model))
    fit = replace(fit, chi2_reduced=math.inf, correlation=np.full_like(fit.correlation, np.nan))
    page = Page(fit_page(with_part(fit, curve=holes), IMAGE))
    [drawn] = [t for t in page.figures["data-0"]["traces"] if t["name"] == "fit"]
    assert [y is None for y in drawn["y"][4:7]] == [False, True, False]


def test_a_figure_of_many_points_is_thinned_and_says_so(fit, with_part):
    nm = np.linspace(400.0, 800.0, 50_000)
    names = ("data", "model", "sigma", "n", "k", "n_stderr", "k_stderr")
    wide = {name: np.full(nm.size, 0.3) for name in names}
    curve = replace(fit.curve, wavelength=nm, **wide)
    data = replace(fit.data, wavelength=nm, values=wide["data"])
    page = Page(text := fit_page(with_part(fit, curve=curve, data=data), IMAGE))
    assert len(page.figures["data-0"]["traces"][0]["x"]) <= 4000
    assert "One point of 13 is drawn" in page.text
    assert len(text.encode()) < 5_000_000


def test_the_page_has_what_repeats_the_fit(fit, write):
    recipe = write('[data]\nsignal = "R"\n', "film.toml")
    again = dict(repetition(fit, {"recipe": str(recipe), "reading": {"range": (400.0, 900.0)}}))
    assert again["Command"].endswith("--range 400.0:900.0")
    assert again["Recipe film.toml"] == '[data]\nsignal = "R"\n'
    flags = {"layer": "SiO2 of (me)", "plate_mm": 1.0}
    [(_, command)] = repetition(fit, {"flags": flags, "reading": {"folded": True}})
    assert command == "pellicle fit /data/film.csv --layer 'SiO2 of (me)' --plate-mm 1.0 --folded"
    assert repetition(fit, None) == []


def test_the_page_of_a_fit_without_a_recipe_has_one(fit, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    film = Scene(Layer("SiO2", Free(10.0, 1000.0)), "Si", light=Light(np.array([500.0, 600.0]), 30.0))
    own = replace(fit, scene=film)
    [(name, text)] = repetition(own, None)
    assert repetition(own, {"flags": {"layer": "SiO2"}})[1] == (name, text)
    (tmp_path / "film.toml").write_text(text)
    recipe = read_recipe(tmp_path / "film.toml")
    assert [os.path.abspath(file) for file in recipe.files] == ["/data/film.csv"]
    assert eqx.tree_equal(recipe.scene(), with_wavelength(film, None))
    odd = replace(film, light=Light(np.array([500.0, 600.0]), np.array([30.0, 40.0])))
    assert repetition(replace(fit, scene=odd), None) == []  # two angles that the file does not have


def luminance(colour):
    """Relative luminance of #rrggbb (WCAG 2.2)."""
    channels = [int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)]
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in channels]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


@pytest.mark.parametrize("mode", [0, 1], ids=["light", "dark"])
def test_colours_have_the_contrast_of_wcag_aa(fit, mode):
    """4.5 for text, 3 for lines and markers of figures."""
    style = Page(fit_page(fit, IMAGE)).scripts["style"]
    block = style.split(":root {")[mode + 1].split("}")[0]
    colours = dict(re.findall(r"--([\w-]+): (#\w{6});", block))
    texts = [(name, back) for name in ("text", "soft", "link") for back in ("page", "panel")]
    texts += [(tone, back) for tone in ("good", "warn", "bad") for back in ("page", f"{tone}-back")]
    lines = "data", "fit", "rival", "index-n", "index-k", "red", "green", "blue", "fourth", "focus"
    pairs = [(*pair, 4.5) for pair in texts] + [(name, "page", 3.0) for name in lines]
    for one, other, least in pairs:
        low, high = sorted((luminance(colours[one]), luminance(colours[other])))
        assert (high + 0.05) / (low + 0.05) >= least, (one, other)


def test_the_page_of_a_batch_escapes_and_links(fit):
    nasty = "<img src=x onerror=alert(1)>.csv"
    records = [failure(f"/data/{nasty}", nasty), to_json(fit)]
    page = Page(batch_page(records, [None, "a b/%41.html"]))
    links = [attributes["href"] for tag, attributes in page.elements if tag == "a"]
    assert links == ["summary.csv", "a%20b/%2541.html"]
    assert page.text.count(nasty) == 2
    assert "img" not in [tag for tag, _ in page.elements]
    [trace] = page.figures["results"]["traces"]
    assert (trace["x"], trace["y"], trace["error_y"]["array"]) == ([2], [486.28], [3.6])
    assert trace["customdata"] == [{"link": "a%20b/%2541.html"}]


def test_a_page_of_a_surface_has_the_lobes_of_the_fitted_numbers(brdf_fit):
    numbers = {"n": [1.5], "exponent": 20.0, "diffuse": 0.1}
    free = Surface("blinn-phong-film", numbers | {"thickness": Free(10.0, 500.0)}, (550.0,))
    parameters = {"thickness": Estimate("thickness", 40.0, 1.0, "nm", 10.0, 500.0, True)}
    page = Page(fit_page(replace(brdf_fit, scene=free, parameters=parameters), IMAGE))
    fitted = replace(free, numbers=numbers | {"thickness": 40.0})
    exact = in_plane(fitted, 45.0, np.linspace(-88.0, 88.0, 177))
    [drawn] = [trace for trace in page.figures["lobes"]["traces"] if trace["yaxis"] == "y2"]
    assert np.allclose(drawn["y"], exact[:, 0], rtol=1e-5)
    assert [tag for tag, _ in page.elements].count("img") == 2


def test_the_page_of_a_map_has_figures_and_tables():
    status = image()
    status[:6] = CODES["ambiguous"]  # a tenth
    summary = summarise(made(status, path="/data/<b>wafer.nc"))
    again = [("Command", "pellicle map <b>wafer.nc")]
    page = Page(map_page(summary, {"map": b"\x89PNG map", "rival": b"\x89PNG rival"}, again))
    assert not page.open
    assert "Map of <b>wafer.nc" in page.text
    images = [own for tag, own in page.elements if tag == "img"]
    assert [own["src"].startswith("data:image/png;base64,") for own in images] == [True, True]
    assert images[0]["alt"].startswith("Values, standard errors")
    assert "90.0 % converged; 10.0 % ambiguous along the top edge" in images[0]["alt"]
    assert "median 300.00 nm" in page.text
    assert f"{np.sum(status == CODES['converged'])} pixels" in page.text
    assert "plotly" not in page.scripts
    box = page.text.partition("Figures")[0]
    assert "thickness: median 300.00 nm" in box
    assert "pellicle map <b>wafer.nc" in page.text.partition("Repeat it")[2]


def test_the_page_of_a_batch_has_statistics_and_a_figure_of_each_parameter(fit):
    records = [to_json(fit) for _ in range(3)]
    for record, nm in zip(records, (480.0, 486.0, 498.0), strict=True):
        record["status"] = "converged"
        thickness = record["parameters"]["thickness"] | {"value": nm, "stderr": 1700.0}
        record["parameters"] = {"thickness": thickness, "n": thickness | {"value": 1.5, "unit": ""}}
    records[2]["status"] = "misfit"  # not counted
    page = Page(batch_page(records, [None] * 3))
    words = " ".join(page.text.split())
    assert "thickness (nm)24834.20.88 %480 to 4860.62 %" in words
    assert "480 ± 1700" in words
    assert [own["value"] for tag, own in page.elements if tag == "option" and "value" in own] == [
        *("results", "results-1", ""),
    ]
    parts = [own for tag, own in page.elements if own.get("class") == "of-parameter"]
    assert [(own["data-of"], "hidden" in own) for own in parts] == [("results", False), ("results-1", True)]


def test_the_best_of_a_comparison_is_first_and_the_others_curves_can_be_shown(fit, with_part):
    missing = replace(fit.curve, model=fit.curve.model + 0.02)
    worse = replace(with_part(fit, curve=missing), rivals=())
    pairs = (("<b>a.toml", worse, 30.0), ("b c.toml", fit, 0.0))
    every = tuple(Candidate(name, x, 1, d, d + 2, d + 3, -d / 2) for name, x, d in pairs)
    comparison = Comparison(every, 20.0)
    page = Page(comparison_page(comparison, ["a/report.html", None]))
    assert not page.open
    figure = page.figures["data-0"]
    [curve, residual] = figure["rivals"][0]
    assert curve["name"] == "&lt;b&gt;a.toml"
    np.testing.assert_allclose(curve["y"], missing.model, rtol=1e-5)
    np.testing.assert_allclose(residual["y"], missing.residual, atol=1e-6)
    buttons = [own for tag, own in page.elements if tag == "button" and "data-rival" in own]
    assert [(own["data-rival"], own["data-about"]) for own in buttons] == [("0", "<b>a.toml")]
    assert [own["href"] for tag, own in page.elements if tag == "a"] == ["a/report.html"]
    rows = page.text.partition("Criteria relative")[2]
    assert rows.index("b c.toml") < rows.index("<b>a.toml")
