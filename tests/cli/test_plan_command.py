"""`pellicle plan`: a table and a record that say the same, and one sentence for what cannot be asked."""

import pytest

from tests.film_recipes import film_recipe

RECIPE = film_recipe(
    'signal = "R"\nangle = 0.2\nwavelengths = { start = 400, stop = 790, step = 65 }',
    'material = "1.46+1e-7j"\nthickness = { lower = 10, upper = 800 }',
)


@pytest.fixture
def recipe(write):
    return write(RECIPE, "film.toml")


def test_table_and_record_say_the_same(pellicle, recipe):
    (record,) = pellicle("plan", recipe, "--tolerance", 1e-3, "--json").objects
    assert (record["schema"], record["tolerance"]) == ("pellicle.plan/1", 1e-3)
    rows = {row["effect"]: row for row in record["effects"]}
    assert sum(row["error_bound"] for row in rows.values()) == pytest.approx(record["error_bound"])
    assert 0 < record["error_bound"] <= 1e-3
    for gone in ("absorption", "oblique", "precision"):
        assert not rows[gone]["on"]
        assert "left out" in rows[gone]["why"]
        assert abs(rows[gone]["cost"]) < 1  # seconds: it is measured, and may be below the noise
        assert 0 < rows[gone]["error_without"] < 1e-3
    assert (rows["back-face"]["cost"], rows["back-face"]["error_without"]) == (0.0, None)
    table = pellicle("plan", recipe, "--tolerance", 1e-3).out.splitlines()
    assert [line.split()[0] for line in table[1 : 1 + len(rows)]] == list(rows)
    assert "the tolerance is 0.001" in table[len(rows) + 2]


def test_what_cannot_be_asked(pellicle, recipe):
    for tolerance in (0, -1e-3, "nan"):
        pellicle("plan", recipe, "--tolerance", tolerance).refused(2, "--tolerance must be above zero")
    pellicle("simulate", recipe, "--out", recipe.with_suffix(".csv"), "--tolerance", -1).refused(
        2, "--tolerance must not be negative"
    )
