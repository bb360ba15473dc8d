"""`pellicle identify`: JSON, recipes that a fit takes, and messages."""

import re
from pathlib import Path

import numpy as np
import pytest

import pellicle as pl


@pytest.fixture(scope="module")
def film(tmp_path_factory):
    nm = np.linspace(420, 880, 120)
    path = tmp_path_factory.mktemp("film") / "unknown.csv"
    oxide = pl.Scene(pl.Layer("SiO2", 300.0), "Si")
    pl.write_spectrum(path, pl.simulate(oxide, nm, noise=0.002, seed=1))
    return path


def test_a_film_is_named_and_written_as_a_recipe(pellicle, film, tmp_path):
    out = tmp_path / "out"
    flags = ("--substrate", "Si", "--among", "SiO2,Si3N4", "--json", "--out", out)
    [found] = pellicle("identify", film, *flags, code=0).objects
    assert (found["schema"], found["status"]) == ("pellicle.identify/1", "identified")
    [best] = found["hypotheses"]
    [layer] = best["layers"]
    value, stderr, by_noise = layer["thickness"]
    assert abs(value - 300) < 3 * stderr
    assert 0 < by_noise < stderr
    assert layer["like"] == ["SiO2"]
    assert best["probability"] == 1
    assert best["parameters"]["thickness"]["value"] == value
    assert found["excluded"][0]["delta_ln_z"] < 0
    recipe = pl.read_recipe(out / "1.toml")
    assert recipe.scene().layers[0].thickness.start == pytest.approx(value)
    assert (out / "report.txt").read_text().startswith("[[Verdict]]\n    identified: A film of index 1.45")
    page = (out / "report.html").read_text(encoding="utf-8")
    assert found["verdict"] in page
    assert '<a href="1.toml">1.toml</a>' in page
    assert all(f"Show {x['name']}</button>" in page for x in [*found["hypotheses"], *found["excluded"]])
    assert (out / "figure.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.slow
def test_files_at_several_angles_are_one_sample(pellicle, tmp_path):
    nm, out = np.linspace(420, 880, 60), tmp_path / "out"
    paths = []
    for angle in (10, 60):
        scene = pl.Scene(pl.Layer("SiO2", 300.0), "Si", light=pl.Light(angle=angle))
        paths.append(tmp_path / f"at_{angle}.csv")
        measured = pl.simulate(scene, nm, noise=0.002, seed=angle)
        rows = zip(nm, measured.values, strict=True)
        paths[-1].write_text("wavelength_nm,R\n" + "".join(f"{x},{y}\n" for x, y in rows))
    flags = ("--substrate", "Si", "--among", "SiO2,Si3N4", "--json", "--out", out)
    [found] = pellicle("identify", *paths, "--angle", "10,60", *flags, code=0).objects
    value, stderr, _ = found["hypotheses"][0]["layers"][0]["thickness"]
    assert abs(value - 300) < 3 * stderr
    assert (out / "1.toml").read_text().count("[[data.file]]") == 2
    assert re.findall(r"angle = (.+)", (out / "1.toml").read_text()) == ["10", "60"]
    stated = ("--angle", "10", "--polarisation", "s", *flags[:-1])
    pellicle("identify", paths[0], *stated, tmp_path / "stated")
    assert pl.read_recipe(tmp_path / "stated" / "1.toml").scene().light.polarisation == "s"
    told = pellicle("identify", *paths, "--angle", "10,50,60", "--substrate", "Si", code=2).err
    assert "--angle has 3 angles for 2 files" in told


def test_what_is_missing_is_said(pellicle, film):
    assert "no substrate" in pellicle("identify", film, code=2).err
    assert "no data" in pellicle("identify", "--substrate", "Si", code=2).err
    for word in ("layers=x", "lamp"):
        answer = pellicle("identify", film, "--substrate", "Si", "--allow", word, code=2)
        assert (
            f"--allow takes a list of layers=1, layers=2, calibration, plate, substrate, not {word}"
            in answer.err
        )
    assert "Sii" in pellicle("identify", film, "--substrate", "Sii", code=2).err
    for flags, message in (
        (("--budget", "-3"), "--budget must be above 0 seconds"),
        (("--family", "metals"), "no family 'metals'"),
        (("--among", "SiO2,Foo"), "unknown material 'Foo'"),
        (("--among", "SiO2,1.46"), "--among takes materials and files of n and k, not 1.46"),
        (("--among", "cauchy"), "films of free index are tried beside these"),
        ((film,), "is named twice"),
    ):
        assert message in pellicle("identify", film, *flags, "--substrate", "Si", code=2).err


@pytest.mark.slow
def test_a_delta_without_its_sign_is_named_and_written_to_the_recipe(pellicle, tmp_path):
    """Of 100 nm by WVASE: nothing but the fit shows that Δ is folded, as 11 points an angle have no kink."""
    path, flags = Path("measurements/wvase/cauchy_100nm.txt"), ("--among", "SiO2", "--allow", "layers=1")
    told = pellicle("identify", path, "--substrate", "Si", *flags, "--out", tmp_path / "out", code=0)
    assert "The sign of Δ seems not to have been measured" in " ".join(told.out.split())
    assert "folded = true" in (tmp_path / "out" / "1.toml").read_text()
    assert abs(pl.read_recipe(tmp_path / "out" / "1.toml").scene().layers[0].thickness.start - 100) < 0.5
