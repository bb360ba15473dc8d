"""The text of a report, as a user reads it; its uncertainty budget."""

import math
from dataclasses import replace

import numpy as np
import pytest

from pellicle.fitting.result import Estimate, Rival, Status, SystematicEffect
from pellicle.reporting.fit_text import ADVICE, budget, report


def block(text: str, title: str) -> list[str]:
    """The lines under `[[title...]]`, without their indent."""
    [found] = [part for part in text.split("[[") if part.startswith(title)]
    return [line.strip() for line in found.splitlines()[1:]]


def words(line: str) -> str:
    """A line without its alignment."""
    return " ".join(line.split())


def with_parameter(fit, name="thickness", **changes):
    return replace(fit, parameters=fit.parameters | {name: replace(fit[name], **changes)})


def test_the_verdict_comes_first_with_status_advice_file_and_points(fit):
    text = report(fit)
    assert text.startswith("[[Verdict]]\n    The data do not determine thickness: 486.28 nm fits best")
    lines = block(text, "Verdict")
    assert f"status  ambiguous. {ADVICE[Status.AMBIGUOUS]}" in lines
    assert "file    /data/film.csv" in lines
    assert "data    R, 41 points from 400 to 800 nm, worth 12 independent ones" in lines


def test_every_status_has_one_sentence_of_advice():
    assert set(ADVICE) == set(Status)
    assert all(text.endswith(".") and len(text) < 90 for text in ADVICE.values())


def test_parameters_with_errors_bounds_and_what_is_fixed(fit):
    lines = block(report(fit), "Parameters")
    assert words(lines[0]) == "thickness: 486.3 ± 3.6 nm (0.74 %) [10, 3000]"
    assert words(lines[1]) == "A: 1.3240 ± 0.0012 (0.091 %) [1.2, 2.8]"
    assert words(lines[2]) == "instrument.scale: 4.50 ± 0.40 (8.9 %)"  # infinite bounds are none
    assert words(lines[-1]) == "B: 3102.06 nm^2 (fixed)"


@pytest.mark.parametrize(("value", "side"), [(10.0, "LOWER"), (3000.0, "UPPER")])
def test_a_parameter_on_a_bound_is_marked(fit, value, side):
    lines = block(report(with_parameter(fit, value=value, at_bound=True)), "Parameters")
    assert lines[0].endswith(f"[10, 3000]  AT ITS {side} BOUND")
    assert sum("BOUND" in line for line in lines) == 1


def test_an_infinite_error_is_said_in_words_with_the_limits_there_are(fit):
    unseen = with_parameter(fit, stderr=math.inf, upper_limit=143.83)
    lines = block(report(unseen), "Parameters")
    assert "not determined (best 486.28 nm, at most 143.8 nm at 95 %)" in lines[0]
    assert "inf" not in report(unseen)
    lines = block(report(with_parameter(fit, stderr=math.nan, lower_limit=99.0)), "Parameters")
    assert "not determined (best 486.28 nm, at least 99 nm at 95 %)" in lines[0]


def test_a_one_sided_limit_stands_beside_a_finite_error(fit):
    k = Estimate("k", 0.0, 0.002, "", 0.0, 1.0, True, True, None, 0.0033)
    lines = block(report(replace(fit, parameters={"k": k})), "Parameters")
    assert lines == ["k:  0.0000 ± 0.0020 (at most 0.0033 at 95 %)  [0, 1]  AT ITS LOWER BOUND"]


def test_correlations_above_a_half_largest_first_without_pairs_of_nuisances(fit):
    lines = block(report(fit), "Correlations")
    assert [line.split() for line in lines] == [
        ["C(thickness,", "instrument.scale_1)", "-0.970"],
        ["C(thickness,", "A)", "+0.620"],
    ]


def test_at_most_ten_correlations(fit):
    names = tuple(f"p{i}" for i in range(6))
    text = report(replace(fit, correlation_names=names, correlation=np.full((6, 6), 0.7)))
    lines = block(text, "Correlations")
    assert len(lines) == 11
    assert lines[-1] == "... and 5 more in the JSON"


def test_no_correlations_no_block(fit):
    assert "Correlations" not in report(replace(fit, correlation=np.eye(5)))
    assert "Correlations" not in report(replace(fit, correlation=np.full((5, 5), np.nan)))


def test_rivals_nearest_first_at_most_six(fit):
    lines = block(report(fit), "Rivals")
    assert words(lines[0]) == "Δχ² 0.69 thickness 242.87 nm A 1.33"
    assert words(lines[1]) == "Δχ² 14.2 thickness 963.57 nm A 1.4"
    many = tuple(Rival({"thickness": 100.0 * i}, float(i)) for i in range(9, 0, -1))
    lines = block(report(replace(fit, rivals=many)), "Rivals")
    assert [line.split()[1] for line in lines[:6]] == list("123456")
    assert lines[6:] == ["... and 3 more in the JSON"]


def test_plan_warnings_and_statistics(fit):
    text = report(fit)
    # the column is as wide as the longest name of the plan
    row = "back-face  on   the substrate is a plate; its back face adds incoherently"
    assert block(text, "Plan")[1] == row
    assert block(text, "Warnings")[0].startswith("- SiO2 has no data for k")
    assert block(text, "Fit statistics") == [
        "rms residual        0.00141",
        "noise               sigma 0.002, as given",
        "reduced chi-square  1.02",
        "seconds             0.42",
    ]
    assert "Warnings" not in report(replace(fit, warnings=()))


def test_no_line_is_longer_than_100_columns(fit, with_part):
    spectrum = replace(fit.spectrum, path="/a folder/" + 30 * "long/" + "film.csv")
    rival = Rival({f"parameter_{i}": 1.0 for i in range(9)}, 3.0)
    parameters = {name: Estimate(name, 1.0, 0.1, "", 0.0, 2.0, True) for name in rival.parameters}
    words = {"verdict": 40 * "words ", "warnings": (60 * "and ",)}
    long = replace(with_part(fit, data=spectrum), rivals=(rival,), parameters=parameters, **words)
    text = report(long)
    assert max(map(len, text.splitlines())) <= 100
    [path] = [line for line in block(text, "Verdict") if line.startswith("file    …")]
    assert path.endswith("long/film.csv")
    assert "\x1b" not in text


def test_a_joint_fit_has_a_line_for_each_file(fit, spectroscopic):
    parts = replace(fit.parts[0], name="film"), replace(spectroscopic.parts[0], name="angles")
    text = report(replace(fit, parts=parts, rms=None))
    verdict = block(text, "Verdict")
    assert "film    R, 41 points from 400 to 800 nm, worth 12 independent ones" in verdict
    described = "angles  psi-delta, 40 points from 400 to 800 nm, from 65 to 75 degrees, worth 12"
    assert described in " ".join(verdict)
    statistics = block(text, "Fit statistics")
    assert any(line.startswith("rms residual of film") and "0.00141" in line for line in statistics)
    assert any(line.startswith("rms residual of angles") and "0.123 degrees" in line for line in statistics)
    names = [line for line in block(text, "Plan: what was simulated") if line.endswith(":")]
    assert names == ["film:", "angles:"]
    assert max(map(len, text.splitlines())) <= 100


@pytest.mark.parametrize(
    ("source", "told"),
    [("residuals", "estimated from the residuals"), ("model", "the error allowed for a drifting lamp")],
)
def test_it_says_where_the_noise_comes_from(fit, with_part, source, told):
    lines = block(report(with_part(fit, sigma_from=source)), "Fit statistics")
    assert f"noise               sigma 0.002, {told}: none was given" in lines


def effect(name, change, uncertainty=0.5, unit="nm"):
    return SystematicEffect(name, uncertainty, unit, {"thickness": change, "A": 0.0}, 0.0, 0.0)


def with_budget(fit, *rows, **changes):
    """The fit with a thickness of 486.28 ± 3.6 nm, of which 0.9 nm is noise."""
    return replace(with_parameter(fit, **{"stderr_noise": 0.9} | changes), budget=rows)


def test_effects_in_their_own_unit_and_what_they_change(fit):
    rows = effect("wavelength shift", -3.0), effect("scale", 0.2, 0.01, "")
    title, noise, first, second, sums = budget(with_budget(fit, *rows))
    assert title.strip() == "thickness: standard uncertainties, and what each alone would change"
    assert words(noise) == "noise and residuals (type A) 0.9 nm"
    assert words(first) == "wavelength shift 0.5 nm 3 nm"
    assert words(second) == "scale 1 % 0.2 nm"
    # a normal distribution: 1.96 · 3.6
    assert sums.strip() == (
        "together, less what the residuals exclude: 3.6 nm; expanded, 95 %: 7.1 nm (coverage factor 1.96)"
    )


def test_few_degrees_of_freedom_are_said(fit):
    """Without systematic effects: Student's t of 5 degrees of freedom, 2.571 (GUM 2008, table G.2)."""
    lines = budget(with_budget(fit, effect("scale", 0.2), stderr_noise=3.6, degrees_of_freedom=5.0))
    end = "expanded, 95 %: 9.3 nm (coverage factor 2.57, 5 degrees of freedom)"
    assert words(" ".join(lines)).endswith(end)


def test_small_effects_are_counted_and_eight_are_listed(fit):
    """Below a hundredth of the error of 3.6 nm an effect is small."""
    lines = budget(with_budget(fit, effect("scale", 0.04), effect("offset", 0.03), effect("angle", 0.0)))
    assert len(lines) == 5
    assert lines[3].strip() == "... and 2 smaller in the JSON"
    lines = budget(with_budget(fit, *(effect(f"e{i}", 9.0 - i) for i in range(9))))
    assert [line.split()[0] for line in lines[2:10]] == [f"e{i}" for i in range(8)]
    assert lines[10].strip() == "... and 1 smaller in the JSON"


def test_no_budget_of_an_infinite_error_or_without_effects_or_free_parameters(fit):
    for stderr in (math.inf, math.nan):
        assert budget(with_budget(fit, effect("scale", 1.0), stderr=stderr)) == []
    assert budget(with_budget(fit)) == []
    fixed = {name: replace(p, free=False) for name, p in fit.parameters.items()}
    assert budget(replace(with_budget(fit, effect("scale", 1.0)), parameters=fixed)) == []
    assert "Uncertainty budget" not in report(fit)


def test_the_report_has_it_after_the_parameters_within_100_columns(fit):
    text = report(with_budget(fit, effect("mixed interface with the substrate of a long name " * 3, 1.0)))
    assert text.index("[[Parameters]]") < text.index("[[Uncertainty budget]]") < text.index("[[Correlations")
    assert max(map(len, text.splitlines())) <= 100
