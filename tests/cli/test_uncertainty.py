"""`--uncertainty`, and the uncertainties of a recipe, in a fit's errors."""

import math

import pytest

RECIPE = """
[scene]
uncertainty = "none"
substrate = "3.9+0.02j"
[[scene.layer]]
material = {index}
thickness = {{ lower = 10, upper = 800 }}
"""


@pytest.fixture
def thickness(pellicle, spectrum_file):
    """Fits a spectrum with these flags, and returns the thickness and the names of the budget."""
    file = spectrum_file()

    def thickness(*flags):
        (found,) = pellicle("fit", file, *flags, "--json").objects
        assert found["status"] == "converged"
        return found["parameters"]["thickness"], [row["effect"] for row in found["budget"]]

    return thickness


def test_usual_uncertainties_are_those_without_the_flag(thickness, scene):
    plain, rows = thickness(*scene)
    assert (plain, rows) == thickness(*scene, "--uncertainty", "usual")
    assert {"wavelength shift", "index of the layer", "index of the substrate", "scale"} <= set(rows)


def test_none_leaves_the_noise(thickness, scene):
    plain, _ = thickness(*scene)
    bare, rows = thickness(*scene, "--uncertainty", "none")
    assert rows == []
    assert bare["stderr"] == pytest.approx(bare["stderr_noise"], rel=1e-3)
    assert (bare["value"], bare["stderr_noise"]) == (plain["value"], plain["stderr_noise"])


@pytest.mark.slow
def test_an_index_of_a_recipe_counts_as_one_that_is_fitted(thickness, write):
    """With a prior as wide; the value stays that of the given index, and its error includes the distance."""
    recipe = write(RECIPE.format(index="1.46\nindex_uncertainty = 0.01"), "film.toml")
    found, rows = thickness("--recipe", recipe, "--noise", "0.002")
    assert rows == ["index of the layer"]
    n = "{ lower = 1.3, upper = 1.6, value = 1.46, prior = { mean = 1.46, sd = 0.0146 } }"
    recipe.write_text(RECIPE.format(index=f'{{ model = "constant", n = {n} }}'))
    fitted, rows = thickness("--recipe", recipe, "--noise", "0.002")
    assert rows == []
    together = math.hypot(fitted["stderr"], fitted["value"] - found["value"])
    assert found["stderr_noise"] < 0.5 * found["stderr"]
    assert found["stderr"] == pytest.approx(together, rel=0.02)


def test_another_word_is_refused(pellicle, spectrum_file, scene):
    pellicle("fit", spectrum_file(), *scene, "--uncertainty", "some").refused(
        2, "--uncertainty must be usual or none", "'some'"
    )
