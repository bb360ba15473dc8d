"""Page of a comparison: the curve of each recipe, the criteria in order, links to the pages of the fits."""

from dataclasses import replace

import numpy as np
import pytest

from pellicle.fitting.comparison import compare
from pellicle.reporting.comparison import comparison_page
from tests.reporting.test_page import Page


@pytest.fixture
def worse(fit, with_part):
    """The fit with a model that misses the data by a constant more."""
    curve = fit.parts[0].curve
    return replace(with_part(fit, curve=replace(curve, model=curve.model + 0.02)), rivals=())


def test_the_best_is_first_and_the_others_curves_can_be_shown(fit, worse):
    page = Page(comparison_page(compare({"<b>a.toml": worse, "b c.toml": fit}), ["a/report.html", None]))
    assert not page.open
    figure = page.figures["data-0"]
    [curve, residual] = figure["rivals"][0]
    assert curve["name"] == "&lt;b&gt;a.toml"
    np.testing.assert_allclose(curve["y"], worse.parts[0].curve.model, rtol=1e-5)
    np.testing.assert_allclose(residual["y"], worse.parts[0].curve.residual, atol=1e-6)
    buttons = [own for tag, own in page.elements if tag == "button" and "data-rival" in own]
    assert [(own["data-rival"], own["data-about"]) for own in buttons] == [("0", "<b>a.toml")]
    assert [own["href"] for tag, own in page.elements if tag == "a"] == ["a/report.html"]
    rows = page.text.partition("Criteria relative")[2]
    assert rows.index("b c.toml") < rows.index("<b>a.toml")
