"""`pellicle plan-measurement`: its table, its record and its refusals."""

import pytest

GRID = "wavelengths = { start = 400, stop = 796, step = 4 }"


def test_rivals_and_one_film(pellicle, scene_recipe):
    material = "1.9"
    a = scene_recipe(GRID, "a.toml")
    b = scene_recipe(GRID, "b.toml", material=material)
    only = "--signals", "R", "--angles", "0"
    [record] = pellicle("plan-measurement", a, b, *only, "--noise", "0.004", "--json", code=0).objects
    assert (record["schema"], record["scenes"]) == ("pellicle.plan-measurement/1", ["a.toml", "b.toml"])
    every = record["measurements"]
    assert len(every) == 3  # as given, of a wider range, and of a film of twice the thickness
    stated = {"signal": "R", "angle": 0.0, "noise": 0.004, "lower": 400.0, "upper": 796.0, "times": 1.0}
    [own] = [x for x in every if stated.items() <= x.items()]
    assert own["delta_ln_z"] > 5
    assert record["would_decide"][0]["delta_ln_z"] == every[0]["delta_ln_z"]
    assert record["verdict"].startswith("would decide: R at 0°")
    text = pellicle("plan-measurement", a, *only, code=0).out
    assert "best: thickness ± " in text
    assert "0.002 of R" in text


def test_angles_of_a_plan_need_none_in_the_recipe(pellicle, scene_recipe):
    a = scene_recipe(f'signal = "psi-delta"\n{GRID}', "a.toml")
    planned = "plan-measurement", a, "--signals", "psi-delta", "--angles"
    [record] = pellicle(*planned, "0,65", "--json", code=0).objects
    assert {m["angle"] for m in record["measurements"]} == {65.0}
    pellicle(*planned, "0").refused(2, "nothing is left to measure: ψ and Δ at 0°")


@pytest.mark.slow  # fits twice
def test_recipes_with_data_are_fitted_first(pellicle, scene_recipe, spectrum_file):
    spectrum_file("film.csv", thickness=280.0)
    a = scene_recipe('files = ["film.csv"]', "a.toml")
    ran = pellicle("plan-measurement", a, "--signals", "R", "--angles", "0", "--json", code=0)
    assert "fitted to" in ran.err
    assert ran.objects[0]["best"]["thickness"]["signal"] == "R"


def test_bad_input_in_one_sentence(pellicle, scene_recipe):
    a = scene_recipe(GRID, "a.toml")
    for words, code, told in (
        ([], 2, "no recipe is given"),
        ([a, a], 2, "given twice"),
        ([a, "--noise", "0"], 2, "--noise must be above zero"),
        ([a, "--angles", "95"], 2, "--angles 95: expected degrees"),
        ([a, "--signals", "X"], 2, "--signals must be among R, T, psi-delta, not 'X'"),
        (["docs/surfaces/oil_film.toml"], 3, "measurements are planned for the spectra of one film"),
        (["none.toml"], 3, "none.toml: cannot be read"),
    ):
        pellicle("plan-measurement", *words).refused(code, told)
