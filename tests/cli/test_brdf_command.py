"""`pellicle fit` of BRDF samples: the recipe of a surface, its errors in words, JSON, report and files."""

from pathlib import Path

import numpy as np
import pytest

from pellicle.api import fits as verbs
from pellicle.data.read_brdf import read_brdf_samples
from pellicle.effects.surface_plan import exact
from pellicle.fitting.curves import BrdfCurve
from pellicle.fitting.result import Baseline, Estimate, LayerTest, Part, Rival, Status
from pellicle.scene.surface import surface_view
from tests.made_fits import made_fit

RECIPE = """
[data]
signal = "brdf"
files = ["paint.csv"]
noise = 0.01
residual = "log"
[scene.surface]
model = "microfacet-film"
wavelengths = [633, 532, 450]
thickness = { lower = 10, upper = 700 }
n = 1.5
base = "3.9+0.02j"
roughness = { lower = 0.01, upper = 1 }
diffuse = 0
"""
ROWS = "theta_i,phi_i,theta_o,phi_o,R,G,B\n" + "".join(f"30,0,{t},180,0.{t},0.2,0.3\n" for t in range(10, 40))


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "paint.toml").write_text(RECIPE)
    (tmp_path / "paint.csv").write_text(ROWS)
    return tmp_path


@pytest.fixture
def fits(monkeypatch):
    """Arguments of each fit, in place of the fits themselves."""
    calls = []

    def fit(samples, surface, **options):
        calls.append({"samples": samples, "surface": surface, **options})
        several = isinstance(samples, list)
        parts = []
        for each in samples if several else [samples]:
            curve, plan = BrdfCurve(0 * each.values, each.values), exact(surface_view(surface, each))
            parts.append(Part(Path(each.path).stem if several else "", each, curve, plan, 1.0, 1.1, 80.0))
        thickness = Estimate("thickness", 300.0, np.inf, "nm", 10.0, 700.0, True)
        return made_fit(
            *parts,
            parameters=(thickness, Estimate("n", 1.5, 0.0, "", 1.5, 1.5, False)),
            status=Status.NOT_IDENTIFIABLE,
            verdict="No evidence of a layer.",
            rivals=(Rival({"thickness": 120.0}, 9.0),),
            warnings=("a warning",),
            scene=surface,
            layer_test=LayerTest(False, 1.9, (Baseline("two lobes", 2.0),), options["residual"] or "linear"),
        )

    monkeypatch.setattr(verbs, "fit", fit)
    return calls


def test_a_recipe_says_what_is_fitted_and_how(folder, fits, pellicle):
    flags = ("--json", "--verbose", "--out", folder / "out")
    ran = pellicle("fit", "--recipe", folder / "paint.toml", *flags, code=4)
    assert "surface: microfacet-film, by 30 samples of R, G, B\n" in ran.err
    assert "free: thickness between 10 and 700\n" in ran.err
    (found,) = ran.objects
    assert found["schema"] == "pellicle.fit/1"
    assert found["data"]["signal"] == "brdf"
    assert found["data"]["points"] == 90
    assert found["parameters"]["thickness"]["stderr"] is None
    assert found["verdict"].startswith("No evidence of a layer")
    assert found["baselines"] == [{"name": "two lobes", "held_out": 2.0}]
    assert (found["held_out"], found["layered"]) == (1.9, False)
    assert {row["effect"] for row in found["plan"]} >= {"spectral-sampling", "roughness", "diffuse"}
    assert fits[-1]["residual"] == "log"
    assert np.all(fits[-1]["samples"].sigma == 0.01)
    fixed = fits[-1]["surface"].fixed_numbers()
    assert fixed["base_n"].tolist() == [3.9] * 3
    assert fixed["base_k"].tolist() == [0.02] * 3
    assert [leaf.name for leaf in fits[-1]["surface"].free_numbers()] == ["thickness", "roughness"]
    report = (folder / "out" / "report.txt").read_text()
    assert "two lobes" in report
    assert "not determined" in report
    assert max(map(len, report.splitlines())) <= 100
    table = (folder / "out" / "fit.csv").read_text().splitlines()
    assert table[3].endswith("R,G,B,model_R,model_G,model_B")
    assert len(table) == 34
    assert (folder / "out" / "figure.png").read_bytes().startswith(b"\x89PNG")


def test_flags_go_before_the_recipe_and_a_bad_file_does_not_stop_the_others(folder, fits, pellicle):
    files = (folder / "absent.csv", folder / "paint.csv")
    flags = ("--noise", 0.5, "--recipe", folder / "paint.toml", "--json")
    ran = pellicle("fit", *files, *flags, code=4)
    assert [each["status"] for each in ran.objects] == ["failed", "not-identifiable"]
    assert "no such file" in ran.err
    assert np.all(fits[-1]["samples"].sigma == 0.5)


def test_noise_as_a_share_of_the_signal(folder, fits, pellicle):
    pellicle("fit", "--recipe", folder / "paint.toml", "--noise", "2 %")
    samples = fits[-1]["samples"]
    np.testing.assert_allclose(samples.sigma, 0.02 * samples.values)
    recipe = RECIPE.replace("noise = 0.01", 'noise = ["2 %", "1 %", 0.01]')
    (folder / "paint.toml").write_text(recipe)
    pellicle("fit", "--recipe", folder / "paint.toml")
    np.testing.assert_allclose(fits[-1]["samples"].sigma[:, 1:], [[0.002, 0.01]] * 30)
    (folder / "paint.toml").write_text(recipe.replace('"1 %"', '"one"'))
    ran = pellicle("fit", "--recipe", folder / "paint.toml")
    assert ran.code != 0
    assert "a share of the signal, as in '2 %', not 'one'" in " ".join(ran.err.split())


def test_simulated_noise_as_a_share_of_the_signal(folder, pellicle):
    out = folder / "simulated.csv"
    pellicle("simulate", folder / "paint.toml", "--out", out, "--noise", "2 %", code=0)
    written = read_brdf_samples(out)
    sigma = np.asarray(written.sigma)
    z = (written.values - sigma / 0.02) / sigma
    assert 0.9 < np.std(z) < 1.1
    assert "noise 2 %" in out.read_text()


@pytest.mark.parametrize(
    ("old", "new", "code", "words"),
    [
        ("roughness =", "roughnes =", 3, "did you mean 'roughness'"),
        ("microfacet-film", "microfacet", 3, "did you mean 'microfacet-film'"),
        ("n = 1.5", 'n = "glass"', 3, "n: a number, a list of one for each channel"),
        ("n = 1.5", "n = 1.5\nbase_n = 2", 3, "base and base_n exclude each other"),
    ],
)
def test_a_bad_recipe_is_told_in_one_sentence(folder, pellicle, old, new, code, words):
    (folder / "paint.toml").write_text(RECIPE.replace(old, new))
    pellicle("fit", "--recipe", folder / "paint.toml").refused(code, words)


def test_nothing_free_is_a_bad_recipe(folder, pellicle):
    fixed = RECIPE.replace("{ lower = 10, upper = 700 }", "50").replace("{ lower = 0.01, upper = 1 }", "0.2")
    (folder / "paint.toml").write_text(fixed)
    pellicle("fit", "--recipe", folder / "paint.toml").refused(3, "paint.toml: nothing is free")


def test_flags_that_a_surface_has_no_use_for(folder, pellicle):
    recipe = ("--recipe", folder / "paint.toml")
    for flags, words in (
        (("--angle", 30), "--angle cannot be used on a BRDF"),
        (("--layer", "SiO2"), "--layer and --recipe"),
        (("--range", "400:700", "--folded"), "--range, --folded cannot be used on a BRDF"),
        (("--signal", "R"), "describes a surface, whose signal is brdf, not R"),
    ):
        pellicle("fit", *recipe, *flags).refused(2, words)
    pellicle("fit", folder / "paint.csv", "--signal", "brdf").refused(2, "needs a --recipe")


def test_files_of_one_surface_are_fitted_together(folder, fits, pellicle):
    """With the loss and the tolerance of fits of spectra, and a table, a figure and a record of all files."""
    (folder / "again.csv").write_text(ROWS)
    files = (folder / "paint.csv", folder / "again.csv")
    flags = ("--joint", "--loss", "huber", "--tolerance", 0.01, "--json", "--out", folder / "out")
    [record] = pellicle("fit", *files, "--recipe", folder / "paint.toml", *flags, code=4).objects
    assert [data["name"] for data in record["data"]] == ["paint", "again"]
    assert (fits[-1]["loss"], fits[-1]["tolerance"]) == ("huber", 0.01)
    table = (folder / "out" / "fit.csv").read_text().splitlines()
    assert table[4].startswith("file,theta_i,")
    assert [line.split(",")[0] for line in table[5:]] == ["paint"] * 30 + ["again"] * 30
    assert (folder / "out" / "figure.png").read_bytes().startswith(b"\x89PNG")
    assert "rms residual of again" in (folder / "out" / "report.txt").read_text()
