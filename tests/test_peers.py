"""Comparison with other packages: reference values, errors and table. None of the packages is needed."""

import json
import math
import runpy
import sys
from pathlib import Path

import numpy as np
import pytest

HERE = Path(__file__).parents[1] / "benchmarks" / "peers"
NAMES = ("cases", "truth", "table", "packages", "birefringent", "graded", "adapters.pellicle_any")


@pytest.fixture(scope="module")
def peers(modules_of):
    """Modules of the script, which belong to no package."""
    with modules_of(HERE, *NAMES) as modules:
        yield modules


def test_reference_values_agree_with_pellicle(peers):
    """Two programs and two formulas; at a critical substrate the square root amplifies rounding."""
    cases, ours, table = peers["cases"], peers["adapters.pellicle_any"], peers["table"]
    for name, case in cases.CASES.items():
        smooth = name not in cases.WITHOUT_SLOPE
        truth = peers["truth"].truth(case, slopes=smooth)
        assert table.error(ours.values(case, np.float64), truth["values"], "values") < (
            1e-12 if smooth else 5e-7
        ), name
        if smooth:
            assert table.error(ours.slopes(case, np.float64), truth["slopes"], "slopes") < 1e-9, name


@pytest.mark.parametrize("name", ["films", "birefringent", "graded"])
def test_tables_are_inserted_into_the_page(peers, name):
    script = runpy.run_path(str(HERE / "__main__.py"), run_name="peers")
    page, (begin, end) = script["PAGE"].read_text("utf-8"), (script[x].format(name) for x in ("BEGIN", "END"))
    again = script["inserted"](page, "new tables", name)
    before, _, rest = page.partition(begin)
    assert again == before + begin + "\n\nnew tables\n\n" + rest[rest.index(end) :]


def test_every_package_has_an_adapter(peers):
    packages, others = peers["packages"], peers["birefringent"].PACKAGES
    adapters = {path.stem for path in (HERE / "adapters").glob("*.py")}
    assert {p.adapter for p in (*packages.OURS, *packages.PEERS, *others)} <= adapters
    assert all(p.install for p in packages.PEERS)


def test_errors_and_cells(peers):
    table = peers["table"]
    truth = {"values": {"Rs": [0.5], "Rp": [0.25]}}
    assert table.error({"Rp": [0.25], "Rs": [0.4]}, truth["values"], "values") == pytest.approx(0.1)
    assert table.error({"Rs": [1.0]}, {"Rs": [0.5]}, "slopes") == pytest.approx(0.5 / 0.501)
    assert math.isnan(table.error({"Rs": [math.nan]}, truth["values"], "values"))

    def cell(answer):
        return table.cell(answer, truth, "values")

    assert cell({"values": {"Rs": [0.5]}}) == "0"
    assert cell({"values": {"Rs": [0.5 + 1e-4]}, "warnings": ["beware"]}) == "1e-04†"
    assert cell({"values": {"Rs": [0.51]}}) == "**1e-02**"
    assert cell({"values": {"Rs": [math.nan]}}) == "**nan**"
    assert cell({"values": "hang"}) == "**hang**"
    assert cell({"values": "ValueError: no such thing"}) == "**refuses**"
    assert cell({}) == ""


def test_table_shows_cases_with_errors_and_names_the_rest(peers):
    truths = {"easy": {"values": {"Rs": [0.5]}}, "hard": {"values": {"Rs": [0.5]}}}
    good = {name: {"values": {"Rs": [0.5]}} for name in truths}
    bad = good | {"hard": {"values": "crash"}}
    text = peers["table"].table(["good", "bad"], [good, bad], truths, "values", False)
    assert text.splitlines() == [
        "|  | good | bad |",
        "| --- | --- | --- |",
        "| hard | 0 | **crash** |",
        "| **wrong of 2** | 0 | 1 |",
        "",
        "All are correct in: easy.",
    ]


def test_graded_films_in_homogeneous_slices(peers, monkeypatch):
    """Of second order in their thickness; tmm is among the tools of the tests."""
    graded = peers["graded"]
    monkeypatch.setattr(graded, "SLICES", (8, 16))
    table = json.loads(graded.TABLE.read_text("utf-8"))
    name = "linear on silicon"
    rows = {name: table["rows"][name]}
    monkeypatch.setattr(graded, "truths", lambda: {name: np.array(rows[name]["values"][:4], dtype=float)})
    package = next(x for x in graded.PACKAGES if x.adapter == "tmm")
    coarse, fine = graded.theirs(rows, table["nm"], package, Path(sys.executable))
    assert np.log2(coarse.errors / fine.errors) == pytest.approx(2, abs=0.3)
    assert min(coarse.microseconds, fine.microseconds) > 0


def test_errors_at_equal_time(peers):
    graded = peers["graded"]
    each = [
        (graded.OURS, 4, 1.0, 1e-4),
        (graded.OURS, 8, 2.0, 1e-6),
        ("tmm", 8, 1.5, 1e-2),
        ("tmm", 4, 0.5, 0.1),
    ]
    rows = [graded.Row(*numbers, np.array([error])) for *numbers, error in each]
    beside = [line.split(" | ")[-1].strip(" |") for line in graded.tabulated(rows).splitlines()[2:]]
    assert beside == ["", "", "1e-04", "slower"]
