"""Measured spectra that are kept beside the repository: thicknesses that others have found too."""

import json
import sys

import numpy as np
import pytest

import pellicle as pl
from pellicle.cli import main
from pellicle.data.read_counts import read_counts, reflectance_from_counts

CAUCHY = pl.dispersion.Cauchy(pl.Free(1.2, 3.0), pl.Free(0.0, 1e5))


@pytest.fixture
def fitted(shared_data, monkeypatch, capsys):
    """`pellicle fit` on files of the shared folder: the exit code and one object for each file."""
    monkeypatch.setenv("PELLICLE_CACHE", "off")

    def run(*names: str, flags: str):
        files = [str(shared_data / name) for name in names]
        monkeypatch.setattr(sys, "argv", ["pellicle", "fit", *files, *flags.split(), "--json"])
        code = main()
        return code, [json.loads(line) for line in capsys.readouterr().out.splitlines()]

    return run


def test_quartz_on_silicon(fitted):
    code, (found,) = fitted(
        "regresspro_filmetrics_F20/quartz_reflectance.csv",
        flags="--layer SiO2 --substrate Si --thickness 10:3000",
    )
    assert code == 0
    assert found["status"] == "converged"
    assert abs(found["parameters"]["thickness"]["value"] - 751.7) < 2
    assert found["rms"] < 0.004


def test_fluorinated_oxide_with_its_index_free(fitted):
    """Its index is low, as fluorine makes it: 1.407 at 633 nm."""
    code, (found,) = fitted(
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
def test_soap_films(fitted, name, layer, truth):
    code, (found,) = fitted(f"soap_films/{name}.csv", flags=f"{layer} {SOAP}")
    assert (code, found["status"]) == (0, "converged")
    assert abs(found["parameters"]["thickness"]["value"] / truth - 1) < 0.02


@pytest.mark.slow  # one of several real soap films
def test_thin_soap_films_are_not_decided_by_one_spectrum(fitted):
    """Order zero: nobody gives a reliable thickness for these."""
    code, found = fitted("soap_films/000006544.csv", "soap_films/000018918.csv", flags=f"{WATER} {SOAP}")
    assert code == 4
    assert [f["status"] in ("ambiguous", "not-identifiable") for f in found] == [True, True]


@pytest.mark.slow  # tests/data/test_read_counts.py: the same counts, not fitted
@pytest.mark.parametrize("pair", ["SL1", "SL2"])
def test_raw_counts_of_porous_silicon(shared_data, fitted, pair):
    """Counts divided by those of bare silicon: a reflectance, and a fit that runs and judges itself."""
    folder = shared_data / "thinfilmstools_oxides"
    sample = read_counts(folder / f"{pair}sample_raw.csv", range=(500, 900))
    silicon = np.abs(pl.material("Si")(sample.wavelength) - 1) ** 2
    silicon = silicon / np.abs(pl.material("Si")(sample.wavelength) + 1) ** 2
    reference = read_counts(folder / f"{pair}reference_raw.csv")
    reflectance = reflectance_from_counts(sample, reference, np.asarray(silicon))
    assert reflectance.values.min() > -0.01  # where few counts are left, noise
    assert reflectance.values.max() < 1
    _, (found,) = fitted(
        f"thinfilmstools_oxides/{pair}sample_raw.csv",
        flags=f"--reference {folder / f'{pair}reference_raw.csv'} --reference-material Si"
        " --layer cauchy --substrate Si --range 500:900",
    )
    assert found["data"]["signal"] == "R"
    assert found["data"]["points"] == len(reflectance)
    assert found["status"] == "misfit"  # a porous layer of one index does not explain these
    assert 0 < found["rms"] < 0.1
