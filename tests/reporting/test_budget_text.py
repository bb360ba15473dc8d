"""Uncertainty budget of a report."""

import math
from dataclasses import replace

import pytest

from pellicle.fitting.result import SystematicEffect
from pellicle.reporting.fit_text import budget, report


def effect(name, change, uncertainty=0.5, unit="nm"):
    return SystematicEffect(name, uncertainty, unit, {"thickness": change, "A": 0.0}, 0.0, 0.0)


def with_budget(fit, *rows, **changes):
    """The fit with a thickness of 486.28 ± 3.6 nm, of which 0.9 nm is noise."""
    lead = replace(fit["thickness"], **{"stderr_noise": 0.9} | changes)
    return replace(fit, parameters=fit.parameters | {"thickness": lead}, budget=rows)


def cells(line):
    return [cell for cell in line.strip().split("  ") if cell]


def test_effects_in_their_own_unit_and_what_they_change(fit):
    rows = effect("wavelength shift", -3.0), effect("scale", 0.2, 0.01, "")
    title, noise, first, second, sums = budget(with_budget(fit, *rows))
    assert title.strip() == "thickness: standard uncertainties, and what each alone would change"
    assert [part.strip() for part in cells(noise)] == ["noise and residuals (type A)", "0.9 nm"]
    assert [part.strip() for part in cells(first)] == ["wavelength shift", "0.5 nm", "3 nm"]
    assert [part.strip() for part in cells(second)] == ["scale", "1 %", "0.2 nm"]
    # a normal distribution: 1.96 · 3.6
    assert sums.strip() == (
        "together, less what the residuals exclude: 3.6 nm; expanded, 95 %: 7.1 nm (coverage factor 1.96)"
    )


def test_few_degrees_of_freedom_are_said(fit):
    """Without systematic effects: Student's t of 5 degrees of freedom, 2.571 (GUM 2008, table G.2)."""
    lines = budget(with_budget(fit, effect("scale", 0.2), stderr_noise=3.6, degrees_of_freedom=5.0))
    assert " ".join(line.strip() for line in lines).endswith(
        "expanded, 95 %: 9.3 nm (coverage factor 2.57, 5 degrees of freedom)"
    )


def test_small_effects_are_counted_and_eight_are_listed(fit):
    """Below a hundredth of the error of 3.6 nm an effect is small."""
    lines = budget(with_budget(fit, effect("scale", 0.04), effect("offset", 0.03), effect("angle", 0.0)))
    assert len(lines) == 5
    assert lines[3].strip() == "... and 2 smaller in the JSON"
    lines = budget(with_budget(fit, *(effect(f"e{i}", 9.0 - i) for i in range(9))))
    assert [line.split()[0] for line in lines[2:10]] == [f"e{i}" for i in range(8)]
    assert lines[10].strip() == "... and 1 smaller in the JSON"


@pytest.mark.parametrize("stderr", [math.inf, math.nan])
def test_no_budget_of_an_infinite_error(fit, stderr):
    assert budget(with_budget(fit, effect("scale", 1.0), stderr=stderr)) == []


def test_no_budget_without_effects_or_free_parameters(fit):
    assert budget(with_budget(fit)) == []
    fixed = {name: replace(p, free=False) for name, p in fit.parameters.items()}
    assert budget(replace(with_budget(fit, effect("scale", 1.0)), parameters=fixed)) == []
    assert "Uncertainty budget" not in report(fit)


def test_the_report_has_it_after_the_parameters_within_100_columns(fit):
    text = report(with_budget(fit, effect("mixed interface with the substrate of a long name " * 3, 1.0)))
    assert text.index("[[Parameters]]") < text.index("[[Uncertainty budget]]") < text.index("[[Correlations")
    assert max(map(len, text.splitlines())) <= 100
