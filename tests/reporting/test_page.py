"""Pages of fits: self-contained, escaped, with the numbers of the fit."""

import json
import math
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

from pellicle.fitting.result import Rival
from pellicle.reporting.page.fit_page import fit_page
from pellicle.reporting.page.repetition import repetition

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


@pytest.fixture
def curved(fit):
    """The fit with the curves of its rivals, which differ from the best by a constant."""
    [part] = fit.parts
    curves = [(replace(part.curve, model=part.curve.model + shift),) for shift in (0.01, 0.02)]
    rivals = [replace(r, curves=c) for r, c in zip(fit.rivals, curves, strict=True)]
    return replace(fit, rivals=tuple(rivals))


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
    wrong = replace(
        wrong,
        verdict=nasty,
        warnings=(nasty,),
        rivals=(Rival({nasty: 1.0, "thickness": 3.0}, 2.0),),
        correlation_names=(nasty, *fit.correlation_names[1:]),
    )
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
    assert second[0]["name"] == "rival: A 1.4"
    assert [trace["showlegend"] for trace in second] == [True, False]


def test_rivals_are_buttons_where_their_curves_are_known(fit, curved):
    for result, count in ((fit, 0), (curved, 2)):
        buttons = [a for tag, a in Page(fit_page(result, IMAGE)).elements if "data-rival" in a]
        assert [button["data-rival"] for button in buttons] == ["0", "1"][:count]


def test_a_missing_number_is_none(fit, with_part):
    curve = fit.parts[0].curve
    holes = np.where(np.arange(41) == 5, np.nan, curve.model)
    fit = replace(fit, chi2_reduced=math.inf, correlation=np.full_like(fit.correlation, np.nan))
    page = Page(fit_page(with_part(fit, curve=replace(curve, model=holes)), IMAGE))
    [drawn] = [t for t in page.figures["data-0"]["traces"] if t["name"] == "fit"]
    assert drawn["y"][5] is None
    assert drawn["y"][6] is not None


def test_a_figure_of_many_points_is_thinned_and_says_so(fit, with_part):
    nm = np.linspace(400.0, 800.0, 50_000)
    wide = {
        name: np.full(nm.size, 0.3) for name in ("data", "model", "sigma", "n", "k", "n_stderr", "k_stderr")
    }
    curve = replace(fit.parts[0].curve, wavelength=nm, **wide)
    data = replace(fit.parts[0].data, wavelength=nm, values=wide["data"])
    text = fit_page(with_part(fit, curve=curve, data=data), IMAGE)
    page = Page(text)
    assert len(page.figures["data-0"]["traces"][0]["x"]) <= 4000
    assert "One point of 13 is drawn" in page.text
    assert len(text.encode()) < 5_000_000


def test_the_page_has_what_repeats_the_fit(fit, tmp_path):
    recipe = tmp_path / "film.toml"
    recipe.write_text('[data]\nsignal = "R"\n')
    again = dict(repetition(fit, {"recipe": str(recipe), "reading": {"range": (400.0, 900.0)}}))
    assert again["Command"].endswith("--range 400.0:900.0")
    assert again["Recipe film.toml"] == '[data]\nsignal = "R"\n'
    flags = {"layer": "SiO2 of (me)", "plate_mm": 1.0}
    [(_, command)] = repetition(fit, {"flags": flags, "reading": {"folded": True}})
    assert command == "pellicle fit /data/film.csv --layer 'SiO2 of (me)' --plate-mm 1.0 --folded"
    assert repetition(fit, None) == []
