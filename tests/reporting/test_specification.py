"""Limits of parameters: their texts, verdicts by the 95 % error, and a fit of a batch in one line."""

import math

import pytest

from pellicle.errors import UsageError
from pellicle.reporting.specification import lines, one_line, parse_limits, verdicts


def record(value, expanded, status="converged", free=True):
    number = {"value": value, "expanded": expanded, "unit": "nm", "free": free}
    return {"status": status, "parameters": {"thickness": number}, "data": {"path": "a.csv"}}


def test_texts():
    found = parse_limits(["thickness=175:185", "k = :0.01", "n=1.4:", "top.thickness=1:2um"])
    assert found == {
        "thickness": (175, 185),
        "k": (-math.inf, 0.01),
        "n": (1.4, math.inf),
        "top.thickness": (1000, 2000),
    }


@pytest.mark.parametrize("text", ["thickness", "thickness=", "=1:2", "thickness=5", "thickness=9:1", "k=:x"])
def test_wrong_texts(text, refuses):
    refuses(UsageError, "--spec", parse_limits, [text])


@pytest.mark.parametrize(
    ("value", "expanded", "status", "verdict"),
    [
        (180, 4, "converged", "pass"),
        (180, 5, "converged", "pass"),  # the whole interval, its ends included
        (180, 5.1, "converged", "undecided"),
        (184, 2, "converged", "undecided"),
        (186, 2, "converged", "undecided"),
        (188, 2, "converged", "fail"),
        (170, 4, "converged", "fail"),
        (180, 1, "ambiguous", "undecided"),
        (200, 1, "misfit", "undecided"),
        (180, None, "converged", "undecided"),
    ],
)
def test_the_error_counts_against_both_claims(value, expanded, status, verdict):
    found = verdicts(record(value, expanded, status), {"thickness": (175, 185)})
    assert found == {"thickness": verdict}


def test_a_name_that_the_fit_lacks_is_named(refuses):
    refuses(UsageError, "did you mean 'thickness'", verdicts, record(1, 1), {"thicknes": (0, 1)})


def test_lines():
    limits = {"thickness": (175.0, math.inf)}
    assert lines(record(180, 0.412), limits, {"thickness": "pass"}) == [
        "thickness: PASS (at least 175 nm; fitted 180.00 ± 0.41 nm (95 %))"
    ]
    whole = record(15002.93, 1700) | {"spec": {"thickness": "fail"}}
    assert one_line(whole) == "a.csv: converged; thickness 15003 ± 1700 nm (95 %); thickness FAIL"
    whole["parameters"]["instrument.scale"] = {"value": 3.5, "expanded": 2.3, "unit": "", "free": True}
    assert one_line(whole) == "a.csv: converged; thickness 15003 ± 1700 nm (95 %); thickness FAIL"
    del whole["parameters"]["thickness"]
    assert "instrument.scale 3.5 ± 2.3" in one_line(whole)
