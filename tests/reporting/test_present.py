"""Results show themselves in Python: report, figure, folder and HTML of every kind of result."""

import json
from dataclasses import replace

import numpy as np
import pytest

import pellicle as pl
from pellicle.accuracy.registry import Comparison, Cost, Result
from pellicle.fitting import comparison as fits
from pellicle.reporting.fit_text import report as fit_report
from pellicle.sampling.chain import Checks
from pellicle.sampling.density import mixture
from pellicle.sampling.result import Axis, Posterior, Prediction

FILES = {
    "fit": {"report.html", "report.txt", "result.json", "fit.csv", "nk.csv", "figure.png"},
    "brdf_fit": {"report.html", "report.txt", "result.json", "fit.csv", "figure.png"},
}


@pytest.fixture(params=["fit", "brdf_fit"])
def either(request):
    return request.getfixturevalue(request.param), FILES[request.param]


def test_a_fit_reports_draws_and_saves_itself(either, tmp_path):
    fit, files = either
    assert fit.report() == pl.report(fit) == fit_report(fit)
    assert len(fit.plot().axes) >= 2
    assert fit.save(tmp_path / "out") == tmp_path / "out"
    assert {path.name for path in (tmp_path / "out").iterdir()} == files
    assert (tmp_path / "out" / "report.txt").read_text() == fit.report()
    assert json.loads((tmp_path / "out" / "result.json").read_text())["schema"] == "pellicle.fit/1"


def test_a_fit_prints_status_verdict_and_free_parameters(fit):
    """And no arrays: this is what an interactive session shows."""
    assert repr(fit) == str(fit)
    assert len(repr(fit).splitlines()) == 1 + len(fit.free)
    html = fit._repr_html_()
    assert f"<b>ambiguous</b>: {fit.verdict}" in html
    assert "<td>thickness</td><td>486.28</td><td>3.6</td><td>nm</td>" in html
    assert html.count("<tr>") == 1 + len(fit.free)
    assert "[[Verdict]]" in html


def test_html_has_no_markup_of_the_data(fit, with_part):
    odd = with_part(fit, data=replace(fit.spectrum, path="<b>.csv"))
    assert "&lt;b&gt;.csv" in odd._repr_html_()


@pytest.fixture
def posterior(fit) -> Posterior:
    """Normal draws of thickness and A."""
    draws = np.random.default_rng(0).normal((486.0, 1.32), (3.0, 0.01), (200, 8, 2))
    rows = np.random.default_rng(1).random((20, 41))
    axis = Axis("wavelength", "wavelength (nm)", fit.curve.wavelength)
    return Posterior(
        fit=fit,
        names=("thickness", "A"),
        draws=draws,
        units=0.5 + 0.01 * np.random.default_rng(2).random((200, 8, 2)),
        log_density=np.zeros((200, 8)),
        modes=mixture(np.full((1, 2), 0.5), np.zeros(1), 1e-4 * np.eye(2)[None]),
        checks=Checks(200, 0, 2.0, 1.0, 0.3, 1, 1, 800),
        predict=lambda units, seed: (Prediction("R", "reflectance", axis, fit.curve.data, rows, rows),),
        seconds=1.0,
    )


def test_a_posterior_reports_draws_and_saves_itself(posterior, tmp_path):
    assert posterior.report().startswith(posterior.fit.report() + "[[Posterior]]")
    assert len(posterior.plot().axes) == 4
    posterior.save(tmp_path / "out")
    assert {"result.json", "posterior.nc", "corner.png", "predictive.png", "figure.png"} <= {
        path.name for path in (tmp_path / "out").iterdir()
    }
    assert "posterior" in json.loads((tmp_path / "out" / "result.json").read_text())
    assert repr(posterior).startswith("With 95 % probability thickness")
    assert posterior._repr_html_().count("<tr>") == 3


def test_a_comparison_reports_and_saves_itself(fit, with_part, tmp_path):
    worse = with_part(fit, curve=replace(fit.curve, model=fit.curve.model + 0.01))
    pairs = (("one", fit, 0.0), ("two", worse, 30.0))
    comparison = fits.Comparison(
        tuple(fits.Candidate(name, x, 1, d, d + 2, d + 3, -d / 2) for name, x, d in pairs), 20.0
    )
    assert comparison.report() == pl.report(comparison)
    assert comparison._repr_html_().startswith("<pre>[[Verdict]]")
    comparison.save(tmp_path / "out")
    files = {"report.html", "report.txt", "result.json"}
    assert {"one", "two"} | files == {path.name for path in (tmp_path / "out").iterdir()}
    assert repr(comparison) == str(comparison)


def test_a_plan_has_a_report(fit):
    lines = pl.report(fit.plan).splitlines()
    assert lines[0].split() == ["effect", "error", "bound", "why"]
    assert lines[2].split()[:3] == ["back-face", "on", "0"]
    assert lines[-1] == "error at most 0.0e+00 of R; the tolerance is 0"


def test_other_objects_have_no_report():
    with pytest.raises(TypeError):
        pl.report({})  # pyright: ignore[reportArgumentType]


def test_a_cost_reports_draws_and_saves_itself(tmp_path):
    methods = Comparison("forward", "float64", 1e-3, "R", 61, 64)
    methods.results = [
        Result("one order", "higher orders", 5e-4, 1e-6, 0.1, {"flops": 1e3}, True),
        Result("float64", "", 0.0, 2e-6, 0.2, {"flops": 2e3}, True),
    ]
    film = Cost(methods, no_solvers="nothing is free to fit")
    surface = Cost(values=methods, no_colours="the surface has no film")
    for cost, words in ((film, "No fits: nothing is free"), (surface, "No colours: the surface has no film")):
        text = cost.report()
        assert text.startswith("scene: ")
        assert "→ one order is the fastest within an error of 0.001 in R" in text
        assert words in text
        assert len(cost.plot().axes) == 1
        cost.save(tmp_path / "out")
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert names == {"report.txt", "result.json", "cost.csv", "cost.png"}
