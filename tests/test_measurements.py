"""Measurements, here or beside the repository: made as they say; thicknesses are those that others found."""

import csv
import json
import re
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import least_squares

import pellicle as pl
from pellicle.cli import main
from pellicle.data.read_counts import read_counts, reflectance_from_counts
from pellicle.data.read_spectrum import read_spectrum
from pellicle.recipes.read import read_recipe

from .by_tmm import ncs

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / "measurements"
RECIPES = sorted((FOLDER / "recipes").glob("*.toml"))


@pytest.fixture(scope="module")
def script(load_script):
    return load_script("scripts/make_measurements.py")


def test_there_are_hematite_cadmium_sulfide_and_gold():
    assert {recipe.stem.split("_")[0] for recipe in RECIPES} >= {"hematite", "cds", "gold"}


def test_every_file_is_what_its_recipe_and_seed_give(script, tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("PELLICLE_CACHE", "off")
    (tmp_path / "INDEX.csv").write_text((FOLDER / "INDEX.csv").read_text())
    script.main(tmp_path)
    made, kept = ({path.name: _without_version(path) for path in x.glob("*.csv")} for x in (tmp_path, FOLDER))
    assert made == kept


def _without_version(path):
    return re.sub(r"pellicle \d\S*", "pellicle", path.read_text())


def test_the_index_lists_every_file():
    with (FOLDER / "INDEX.csv").open() as text:
        rows = list(csv.DictReader(text))
    files = {*FOLDER.glob("*.csv"), *FOLDER.glob("ellipsometry/*.dat"), *FOLDER.glob("wvase/*.txt")}
    files.remove(FOLDER / "INDEX.csv")
    assert {row["file"] for row in rows} == {path.relative_to(FOLDER).as_posix() for path in files}
    for row in rows:
        if row["kind"] in ("measured", "computed"):
            assert row["source"].startswith("refellips 0.0.6")
            assert row["licence"] == "BSD-3-Clause"
            continue
        assert row["kind"] == "synthetic"
        assert (FOLDER / row["recipe"]).is_file()
        head = (FOLDER / row["file"]).read_text().split("wavelength_nm")[0]
        assert "SYNTHETIC" in head
        assert f"recipe {Path(row['recipe']).name}, seed {row['seed']}" in head
        assert row["truth"].replace("thickness", "thickness =") in head


def fitted(recipe: Path):
    """The recipe's fit of its own file, and the true thickness."""
    found = read_recipe(recipe)
    (layer,) = tomllib.loads(recipe.read_text())["scene"]["layer"]
    noise = found.tables.data.noise
    (file,) = found.files
    return pl.fit(pl.read_spectrum(file, noise=noise), found.scene()), layer["thickness"]["value"]


@pytest.mark.parametrize(
    "recipe",
    [
        pytest.param(r, marks=[pytest.mark.slow] if "gold" in r.stem else [], id=r.stem)  # compiles alone
        for r in RECIPES
        if r.stem != "gold_on_glass_300nm"
    ],
)
def test_the_fit_finds_the_truth(recipe):
    found, truth = fitted(recipe)
    assert found.status == "converged"
    assert abs(found["thickness"].value - truth) < 4 * found["thickness"].stderr_noise
    assert found["thickness"].stderr < 0.02 * truth
    assert 0.5 < found.chi2_reduced < 1.5


def test_opaque_gold_gets_a_lower_limit_and_no_error():
    found, truth = fitted(FOLDER / "recipes" / "gold_on_glass_300nm.toml")
    thickness = found["thickness"]
    assert found.status == "not-identifiable"
    assert thickness.stderr == float("inf")
    assert 50 < thickness.lower_limit < truth
    assert thickness.upper_limit is None


ELLIPSOMETRY = Path(__file__).parents[1] / "measurements" / "ellipsometry"
OXIDE = 2.0  # nm
WAVELENGTH = 658.0  # nm
BRUSH = pl.dispersion.Cauchy(1.47, 4950.0)


def by_tmm(spectrum: pl.Spectrum) -> float:
    """Thickness (nm) of the brush by the tmm package and SciPy, from the best of many starts."""
    n = [1.0] + [complex(pl.refractive_index(WAVELENGTH, each)) for each in (BRUSH, "SiO2", "Si")]

    psi, delta = 2 * np.deg2rad(spectrum.values), np.deg2rad(spectrum.delta)
    # N, C and S have no wrap-around
    sphere = np.stack([np.cos(psi), np.sin(psi) * np.cos(delta), np.sin(psi) * np.sin(delta)], axis=1)

    def residuals(x: np.ndarray) -> np.ndarray:
        return (ncs(WAVELENGTH, n, [x[0], OXIDE], spectrum.angle) - sphere).ravel()

    fits = [least_squares(residuals, [start], bounds=([0.0], [300.0])) for start in (5.0, 20.0, 60.0, 150.0)]
    return float(min(fits, key=lambda fit: fit.cost).x[0])


@pytest.mark.parametrize("name", ["15-1-1.dat", pytest.param("19-1-1.dat", marks=pytest.mark.slow)])
def test_polymer_brushes_on_oxidised_silicon(name):
    """Real Ψ and Δ at eight angles: the thickness is that of another program, far within its error."""
    spectrum = read_spectrum(ELLIPSOMETRY / name)
    layers = [pl.Layer(BRUSH, pl.Free(0, 300), name="brush"), pl.Layer("SiO2", OXIDE, name="oxide")]
    fit = pl.fit(spectrum, pl.Scene(layers, "Si"))
    assert fit.status is pl.Status.CONVERGED
    depth = fit["brush.thickness"]
    assert abs(depth.value - by_tmm(spectrum)) < 0.05 * depth.stderr


CAUCHY = pl.dispersion.Cauchy(pl.Free(1.2, 3.0), pl.Free(0.0, 1e5))


@pytest.fixture
def fitted_files(shared_data, monkeypatch, capsys):
    """`pellicle fit` on files of the shared folder: the exit code and one object for each file."""
    monkeypatch.setenv("PELLICLE_CACHE", "off")

    def run(*names: str, flags: str):
        files = [str(shared_data / name) for name in names]
        monkeypatch.setattr(sys, "argv", ["pellicle", "fit", *files, *flags.split(), "--json"])
        code = main()
        return code, [json.loads(line) for line in capsys.readouterr().out.splitlines()]

    return run


@pytest.mark.slow
def test_quartz_on_silicon(fitted_files):
    code, (found,) = fitted_files(
        "regresspro_filmetrics_F20/quartz_reflectance.csv",
        flags="--layer SiO2 --substrate Si --thickness 10:3000",
    )
    assert code == 0
    assert found["status"] == "converged"
    assert abs(found["parameters"]["thickness"]["value"] - 751.7) < 2
    assert found["rms"] < 0.004


@pytest.mark.slow
def test_fluorinated_oxide_with_its_index_free(fitted_files):
    """Its index is low, as fluorine makes it: 1.407 at 633 nm."""
    code, (found,) = fitted_files(
        "regresspro_fsg_oxide_on_si/reflectance.csv", flags="--layer cauchy --substrate Si"
    )
    assert (code, found["status"]) == (0, "converged")
    p = {name: record["value"] for name, record in found["parameters"].items()}
    assert abs(p["thickness"] - 630) < 4
    assert abs(p["A"] + p["B"] / 633**2 - 1.407) < 0.01


def plate(shared_data, name: str, back):
    """An oxide on fused silica in transmittance, above where its own absorption begins."""
    spectrum = pl.read_spectrum(shared_data / "thinfilmstools_oxides" / name, range=(300, 1000))
    scene = pl.Scene(pl.Layer(CAUCHY, pl.Free(10, 1000)), pl.Substrate("SiO2", back))
    return pl.fit(spectrum, scene)


@pytest.mark.parametrize(
    ("name", "truth", "tolerance"),
    [
        pytest.param("hafnia_T.csv", 194, 3, marks=pytest.mark.slow),
        pytest.param("scandia_T.csv", 92, 2, marks=pytest.mark.slow),
    ],
)
def test_oxides_on_a_plate_are_better_with_its_back_face(shared_data, name, truth, tolerance):
    found, without = plate(shared_data, name, "air"), plate(shared_data, name, None)
    assert found.status == "converged"
    assert abs(found["thickness"].value - truth) < tolerance
    assert found.rms < 0.25 * without.rms
    # a thickness of the wrong scene is refused, or its error includes the right one
    shift = abs(without["thickness"].value - truth)
    assert without.status == "misfit" or shift < without["thickness"].expanded
    told = f"The back face matters: rms {found.rms:.4f} with it, {without.rms:.4f} without."
    assert told in found.verdict


SOAP = "--substrate air --scale slow --offset slow --range 510:910 --signal R"
WATER = "--layer cauchy(1.324188,3102.06)"


@pytest.mark.parametrize(
    ("name", "layer", "truth"),
    [("003582", "--layer 1.33", 3521), pytest.param("000005253", WATER, 777, marks=pytest.mark.slow)],
)
def test_soap_films(fitted_files, name, layer, truth):
    code, (found,) = fitted_files(f"soap_films/{name}.csv", flags=f"{layer} {SOAP}")
    assert (code, found["status"]) == (0, "converged")
    assert abs(found["parameters"]["thickness"]["value"] / truth - 1) < 0.02


@pytest.mark.slow  # one of several real soap films
def test_thin_soap_films_are_not_decided_by_one_spectrum(fitted_files):
    """Order zero: nobody gives a reliable thickness for these. Of the first another order has 3 %."""
    code, found = fitted_files(
        "soap_films/000006544.csv", "soap_films/000018918.csv", flags=f"{WATER} {SOAP}"
    )
    assert code == 4
    assert found[0]["rivals"][0]["probability"] > 0.01
    assert found[1]["status"] in ("ambiguous", "not-identifiable")


@pytest.mark.slow  # tests/data/test_read_counts.py: the same counts, not fitted_files
@pytest.mark.parametrize("pair", ["SL1", "SL2"])
def test_raw_counts_of_porous_silicon(shared_data, fitted_files, pair):
    """Counts divided by those of bare silicon: a reflectance, and a fit that runs and judges itself."""
    folder = shared_data / "thinfilmstools_oxides"
    sample = read_counts(folder / f"{pair}sample_raw.csv", range=(500, 900))
    silicon = np.abs(pl.material("Si")(sample.wavelength) - 1) ** 2
    silicon = silicon / np.abs(pl.material("Si")(sample.wavelength) + 1) ** 2
    reference = read_counts(folder / f"{pair}reference_raw.csv")
    reflectance = reflectance_from_counts(sample, reference, np.asarray(silicon))
    assert reflectance.values.min() > -0.01  # where few counts are left, noise
    assert reflectance.values.max() < 1
    _, (found,) = fitted_files(
        f"thinfilmstools_oxides/{pair}sample_raw.csv",
        flags=f"--reference {folder / f'{pair}reference_raw.csv'} --reference-material Si"
        " --layer cauchy --substrate Si --range 500:900",
    )
    assert found["data"]["signal"] == "R"
    assert found["data"]["points"] == len(reflectance)
    assert found["status"] == "misfit"  # a porous layer of one index does not explain these
    assert 0 < found["rms"] < 0.1
