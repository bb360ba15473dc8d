"""`pellicle plan` and `pellicle cost`: tables, folders, records, one sentence for what cannot be asked."""

import csv
import json

import pytest

from tests.film_recipes import film_recipe

FAINT = film_recipe(
    'signal = "R"\nwavelengths = { start = 400, stop = 790, step = 65 }',
    'material = "1.46+1e-7j"\nthickness = { lower = 10, upper = 800 }',
)


@pytest.fixture
def faint(write):
    return write(FAINT, "film.toml")


@pytest.mark.slow
def test_a_plan_as_table_and_record(pellicle, faint):
    (record,) = pellicle("plan", faint, "--tolerance", 1e-3, "--json").objects
    assert (record["schema"], record["tolerance"]) == ("pellicle.plan/1", 1e-3)
    rows = {row["effect"]: row for row in record["effects"]}
    assert sum(row["error_bound"] for row in rows.values()) == pytest.approx(record["error_bound"])
    assert 0 < record["error_bound"] <= 1e-3
    for gone in ("absorption", "precision"):
        assert not rows[gone]["on"]
        assert "left out" in rows[gone]["why"]
        assert abs(rows[gone]["cost"]) < 1  # seconds: it is measured, and may be below the noise
        assert 0 < rows[gone]["error_without"] < 1e-3
    assert (rows["back-face"]["cost"], rows["back-face"]["error_without"]) == (0.0, None)
    table = pellicle("plan", faint, "--tolerance", 1e-3).out.splitlines()
    assert [line.split()[0] for line in table[1 : 1 + len(rows)]] == list(rows)
    assert "the tolerance is 0.001" in table[len(rows) + 2]


@pytest.mark.slow
def test_each_sample_has_its_plan(pellicle, write, tmp_path):
    """One table for those of the same effects."""
    names = "abc"
    for name in names:
        (tmp_path / f"{name}.csv").write_text("nm,R\n400,0.3\n500,0.31\n600,0.32\n")
    own = {"a": "angle = 0", "b": "angle = 0", "c": "angle = 50"}
    tables = [f'[[sample]]\nname = "{x}"\nfiles = ["{x}.csv"]\n{own[x]}\n' for x in names]
    recipe = write(
        FAINT.replace("wavelengths = { start = 400, stop = 790, step = 65 }\n", "") + "".join(tables)
    )
    heads = [line for line in pellicle("plan", recipe, code=0).out.splitlines() if line.endswith(":")]
    assert [[word in head for word in ("a (", "b (", "c (")] for head in heads] == [
        [True, True, False],
        [False, False, True],
    ]
    (record,) = pellicle("plan", recipe, "--json", code=0).objects
    assert record["effects"] == record["samples"][0]["effects"]
    on = [next(row["on"] for row in x["effects"] if row["effect"] == "oblique") for x in record["samples"]]
    assert on == [False, False, True]


def test_tolerances_that_are_none(pellicle, faint):
    for tolerance in (0, -1e-3, "nan"):
        pellicle("plan", faint, "--tolerance", tolerance).refused(2, "--tolerance must be above zero")
    ran = pellicle("simulate", faint, "--out", faint.with_suffix(".csv"), "--tolerance", -1)
    ran.refused(2, "--tolerance must not be negative")


RECIPE = film_recipe(
    'signal = "R"\nnoise = 0.002\nwavelengths = { start = 400, stop = 790, step = 30 }',
    'name = "oxide"\nmaterial = 1.46\nthickness = { value = 321.5, lower = 10, upper = 800 }',
)


@pytest.fixture
def recipe(write):
    return write(RECIPE, "film.toml")


@pytest.mark.slow  # compiles every method
def test_table_folder_and_record_say_the_same(pellicle, recipe, tmp_path):
    out = tmp_path / "cost"
    (record,) = pellicle("cost", recipe, "--datasets", 0, "--json", "--out", out, code=0).objects
    assert record == json.loads((out / "result.json").read_text())
    assert record["schema"] == "pellicle.cost/1"
    assert (record["reference"], record["tolerance"], record["unit"]) == ("float64", 0.002, "R")
    names = [rung["name"] for rung in record["rungs"]]
    assert record["recommended"] in names
    assert {"float64", "float32", "1 order", "incoherent"} <= set(names)
    for rung in record["rungs"]:
        assert rung["seconds"] > 0
        assert isinstance(rung["pareto"], bool)
    assert record["left_out"]["normal incidence"] == "the light is at normal incidence"
    rows = list(csv.DictReader((out / "cost.csv").read_text().splitlines()))
    assert [row["name"] for row in rows] == names
    assert float(rows[0]["error"]) == record["rungs"][0]["error"]
    report = (out / "report.txt").read_text()
    assert f"→ {record['recommended']} is the fastest within an error of 0.002 in R" in report
    words = " ".join(report.split())  # a line may end within a name
    assert all(name in words for name in [*names, *record["left_out"]])
    assert (out / "cost.png").read_bytes().startswith(b"\x89PNG")
    assert max(map(len, report.splitlines())) < 130


def test_what_cannot_be_asked(pellicle, recipe, tmp_path):
    for flags, said in (
        (("--tolerance", 0), "--tolerance must be above zero"),
        (("--datasets", -1), "--datasets must not be negative"),
        (("--reference", "tmm"), "--reference must be float64 or mpmath"),
        (("--out", tmp_path), "did not write"),
    ):
        pellicle("cost", recipe, *flags).refused(2, said)
    recipe.write_text(RECIPE + "\n[instrument]\nbandwidth = 3.0\n")
    pellicle("cost", recipe, "--reference", "mpmath").refused(2, "this light has a bandwidth")
    recipe.write_text(RECIPE.replace('"3.9+0.02j"', "1.46").replace("[scene]", "[scene]\nambient = 1.46"))
    pellicle("cost", recipe).refused(2, "nothing to compute")


@pytest.mark.slow
def test_wavelengths_of_the_first_file(pellicle, recipe, tmp_path, monkeypatch):
    """Where the recipe gives none; and 50 digits are told from 16."""
    rows = "".join(f"{nm},0.2\n" for nm in (450, 500, 560, 640, 700))
    (tmp_path / "film.csv").write_text("wavelength_nm,R\n" + rows)
    lines = RECIPE.replace("wavelengths = { start = 400, stop = 790, step = 30 }", 'files = ["film.csv"]')
    recipe.write_text(lines.replace("{ value = 321.5, lower = 10, upper = 800 }", "321.5"))
    ran = pellicle("cost", recipe, "--reference", "mpmath", "--json")
    (record,) = ran.objects
    assert (record["wavelengths"], record["draws"]) == (5, 1)
    assert "those of" in ran.err
    assert record["no_fits"] == "nothing is free to fit"
    errors = {rung["name"]: rung["error"] for rung in record["rungs"]}
    assert 0 < errors["float64"] < 1e-14
    assert 1e-9 < errors["float32"] < 1e-6
