"""`pellicle simulate`: a file that says what it is, and whose fit finds the truth."""

import numpy as np
import pytest

import pellicle as pl
from tests.film_recipes import film_recipe

RECIPE = film_recipe(
    'signal = "R"\nnoise = 0.002\nwavelengths = { start = 400, stop = 796, step = 4 }',
    'name = "oxide"\nmaterial = 1.46\nthickness = { value = 321.5, lower = 10, upper = 800 }',
)


@pytest.fixture
def recipe(write):
    return write(RECIPE, "film.toml")


def numbers(path):
    return np.loadtxt(path, delimiter=",", skiprows=5)


def test_the_file_says_what_it_is_and_its_fit_finds_the_truth(pellicle, recipe, tmp_path):
    out = tmp_path / "film.csv"
    ran = pellicle("simulate", recipe, "--out", out, "--seed", 7)
    assert (ran.code, ran.out) == (0, "")
    text = out.read_text()
    head = [line for line in text.splitlines() if line.startswith("#")]
    assert "SYNTHETIC" in head[0]
    assert "recipe film.toml, seed 7, noise 0.002" in head[1]
    assert "thickness = 321.5 nm" in head[3]
    assert numbers(out).shape == (100, 3)
    (found,) = pellicle("fit", out, "--recipe", recipe, "--json").objects
    thickness = found["parameters"]["thickness"]
    assert found["status"] == "converged"
    assert abs(thickness["value"] - 321.5) < 4 * thickness["stderr_noise"] < 2


def test_default_wavelengths_are_said(pellicle, recipe, tmp_path):
    recipe.write_text(RECIPE.replace("wavelengths = { start = 400, stop = 796, step = 4 }\n", ""))
    ran = pellicle("simulate", recipe, "--out", tmp_path / "film.csv")
    assert "380 to 780 nm every 2 nm" in ran.err
    assert len(numbers(tmp_path / "film.csv")) == 201


@pytest.mark.parametrize(
    ("grid", "said"),
    [("[500, 400]", "rising"), ("{ start = 700, stop = 400, step = 2 }", "wavelengths"), ("[]", "rising")],
)
def test_bad_wavelengths(pellicle, recipe, tmp_path, grid, said):
    recipe.write_text(RECIPE.replace("{ start = 400, stop = 796, step = 4 }", grid))
    pellicle("simulate", recipe, "--out", tmp_path / "film.csv").refused(3, said)
    assert not (tmp_path / "film.csv").exists()


def test_a_depolarisation_is_a_column(pellicle, recipe, tmp_path):
    """Where the scene depolarises, and read back with its noise."""
    uneven = RECIPE.replace('signal = "R"\nnoise = 0.002', 'signal = "psi-delta"\nangle = 65')
    recipe.write_text(uneven + "thickness_spread = 10.0\n")
    out = tmp_path / "film.csv"
    flags = ("--noise", 0.05, "--depolarisation-noise", 0.002)
    assert pellicle("simulate", recipe, "--out", out, *flags).code == 0
    header = "wavelength_nm,angle_deg,psi_deg,delta_deg,depolarisation,sigma,sigma_depolarisation"
    assert out.read_text().splitlines()[4] == header
    read = pl.read_spectrum(out)
    np.testing.assert_array_equal(read.depolarisation_sigma, 0.002)
    exact = pl.simulate(pl.read_recipe(recipe).scene(), read.wavelength).depolarisation
    assert exact.max() > 0.02
    assert np.std(read.depolarisation - exact) == pytest.approx(0.002, rel=0.3)
    recipe.write_text(RECIPE)
    flags = ("--out", tmp_path / "R.csv", "--depolarisation-noise", 0.002)
    pellicle("simulate", recipe, *flags).refused(2, "is for a film with the signal psi-delta")


@pytest.mark.slow
def test_depth_profile(pellicle, recipe, tmp_path):
    """Figure, tables and JSON of where the light goes; the film is transparent, and the substrate takes T."""
    text = RECIPE.replace("noise = 0.002\n", "")
    recipe.write_text(text.replace("material = 1.46", 'material = "1.46+0.1j"'))
    out = tmp_path / "depth"
    ran = pellicle("simulate", recipe, "--depth", "450,600", "--out", out, "--json")
    (found,) = ran.objects
    assert ran.code == 0
    assert found["schema"] == "pellicle.depth/1"
    assert found["at_nm"] == [450, 600]
    assert sum(row[0] for row in found["shares"].values()) == pytest.approx(1, abs=1e-12)
    names = {path.name for path in out.iterdir()}
    assert names == {"result.json", "absorptance.csv", "depth.csv", "depth.png"}
    table = np.loadtxt(out / "absorptance.csv", delimiter=",", skiprows=5)
    np.testing.assert_allclose(np.sum(table[:, 1:], axis=1), 1, atol=1e-9)
    exact = pl.field(450.0, 321.5, 1.46 + 0.1j, 3.9 + 0.02j, np.array(found["sections"][0]["depth_nm"]))
    np.testing.assert_allclose(found["sections"][0]["intensity"][0], exact.intensity, rtol=1e-9)
    section = found["sections"][0]
    np.testing.assert_allclose(section["absorbed_per_nm"][0], exact.absorbed, rtol=1e-9, atol=1e-15)


@pytest.mark.parametrize(
    ("flags", "said"),
    [
        (["--depth", "green"], "--depth green: expected wavelengths in nm"),
        (["--depth", "-5"], "expected wavelengths"),
        (["--depth", "500", "--noise", 0.01], "leave out --noise"),
    ],
)
def test_bad_depth_flags(pellicle, recipe, tmp_path, flags, said):
    pellicle("simulate", recipe, "--out", tmp_path / "x", *flags).refused(2, said)
    assert "--depth" in pellicle("simulate", recipe, "--out", tmp_path / "x", "--json").err
    assert not (tmp_path / "x").exists()


def test_each_azimuth_of_a_list_has_its_rows(pellicle, tmp_path):
    path, out = tmp_path / "turned.toml", tmp_path / "turned.csv"
    text = RECIPE.replace('signal = "R"', 'signal = "generalised-psi-delta"\nangle = 60\nazimuth = [0, 45]')
    path.write_text(text.replace("noise = 0.002", 'noise = 0.05\nelements = ["asp", "ane"]'))
    assert pellicle("simulate", path, "--out", out).code == 0
    spectrum = pl.read_spectrum(out)
    assert spectrum.ratios == ("ane", "asp")
    assert [(own.azimuth, len(own.rows)) for own in spectrum.settings] == [(0.0, 100), (45.0, 100)]
    assert "psi_asp_deg,delta_asp_deg,psi_ane_deg,delta_ane_deg,sigma" in out.read_text()
    (about,) = pellicle("read", out, "--json").objects
    assert about["azimuths_deg"] == [0.0, 45.0]


def test_each_angle_of_a_list_has_its_rows_at_each_azimuth(pellicle, tmp_path):
    path, out = tmp_path / "angles.toml", tmp_path / "angles.csv"
    quiet = RECIPE.replace("noise = 0.002\n", "")
    path.write_text(quiet.replace('signal = "R"', 'signal = "R"\nangle = [30, 0, 50]\nazimuth = [0, 45]'))
    assert pellicle("simulate", path, "--out", out).code == 0
    spectrum = pl.read_spectrum(out)
    found = [(own.angle, own.azimuth, len(own.rows)) for own in spectrum.settings]
    assert found == [(angle, turn, 100) for angle in (0.0, 30.0, 50.0) for turn in (0.0, 45.0)]
    for own in spectrum.settings:
        alone = pl.Scene(pl.Layer(1.46, 321.5), 3.9 + 0.02j, light=pl.Light(angle=own.angle))
        one = pl.simulate(alone, spectrum.wavelength[own.rows])
        np.testing.assert_allclose(spectrum.values[own.rows], one.values, atol=1e-8)


def test_each_file_of_samples_is_simulated_into_a_folder(pellicle, write, tmp_path):
    """With its own noise and truth, R of a bare layer by Fresnel's formula."""
    samples = (
        RECIPE
        + """
[[sample]]
name = "thin"
files = ["measured/a.txt"]
oxide.thickness = 0
[[sample]]
name = "glass"
files = ["b.csv"]
substrate = 1.52
oxide.thickness = 0
"""
    )
    recipe = write(samples, "samples.toml")
    ran = pellicle("simulate", recipe, "--out", tmp_path / "out", "--seed", 7, code=0)
    assert "a.csv: 100 points" in ran.err
    thin, glass = (np.loadtxt(tmp_path / "out" / f"{x}.csv", delimiter=",", skiprows=5) for x in "ab")
    assert "glass.oxide.thickness = 0 nm" in (tmp_path / "out" / "b.csv").read_text()
    expected = [abs((n - 1) / (n + 1)) ** 2 for n in (3.9 + 0.02j, 1.52)]
    noises = [x[:, 1] - r for x, r in zip((thin, glass), expected, strict=True)]
    assert all(0.001 < np.std(x) < 0.003 for x in noises)
    assert abs(np.corrcoef(*noises)[0, 1]) < 0.5
    pellicle("simulate", recipe, "--out", tmp_path / "out").refused(2, "a.csv")
    pellicle("simulate", recipe, "--out", tmp_path / "a.csv").refused(2, "into a folder")
    recipe.write_text(samples.replace("b.csv", "a.csv"))
    pellicle("simulate", recipe, "--out", tmp_path / "other").refused(3, "two files")
