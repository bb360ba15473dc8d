"""Kept fits are complete, their README quotes their results, and they are reproducible."""

import hashlib
import json
import re
import runpy
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[1]
FITS = ROOT / "fits"


@pytest.fixture(scope="module")
def script(load_script):
    return load_script("scripts/rerun_fits.py")


def rows_of_readme(folder: Path) -> dict[str, str]:
    """Return the rows of a README's table of studies by the name of the study."""
    text = (folder / "README.md").read_text("utf-8")
    return dict(re.findall(r"^\| \[([^\]]+)\]\([^)]*report.txt\)(.*)\|$", text, re.MULTILINE))


@pytest.mark.parametrize(("folder", "samples"), [(FITS, set()), (FITS / "brdf", {"samples.csv"})])
def test_studies_are_complete_and_quoted_in_the_readme(folder, samples):
    rows = rows_of_readme(folder)
    assert rows.keys() == {path.name for path in folder.iterdir() if (path / "recipe.toml").exists()}
    for name, row in rows.items():
        study = folder / name
        files = {path.name for path in study.iterdir()}
        assert files == {"recipe.toml", "result.json", "report.txt", "figure.png", *samples}
        result = json.loads((study / "result.json").read_text("utf-8"))
        assert result["status"] == "converged" or result["status"] in row
        data = result["data"]
        assert hashlib.sha256((study / data["path"]).read_bytes()).hexdigest() == data["sha256"]
        found = re.findall(r"(?:thickness:?|at most) ([\d.]+(?: ± \S+)? nm)", result["verdict"])
        text = (study / "report.txt").read_text("utf-8")
        assert found
        assert all(best in row and best in text for best in found)


def test_kept_samples_follow_from_their_recipes(tmp_path):
    """Up to rounding, which differs between compilers."""
    script = runpy.run_path(str(ROOT / "scripts" / "make_brdf_samples.py"))
    script["main"](tmp_path)
    for kept in FITS.glob("brdf/*/samples.csv"):
        again = tmp_path / kept.parent.name / "samples.csv"
        numbers, truth = (np.loadtxt(path, delimiter=",", comments="#", skiprows=7) for path in (again, kept))
        np.testing.assert_allclose(numbers, truth, rtol=1e-9, atol=1e-9)


def test_changes_are_reported(script):
    kept = {"status": "converged", "parameters": {"d": {"value": 3.0, "stderr": 5.0, "stderr_noise": 0.5}}}
    near = {"status": "converged", "parameters": {"d": {"value": 3.04, "stderr": 5.0, "stderr_noise": 0.5}}}
    far = {"status": "ambiguous", "parameters": {"d": {"value": 3.06, "stderr": 5.0, "stderr_noise": 0.5}}}
    assert list(script.differences(kept, near)) == []
    moved = ["status ambiguous, was converged", "d 3.06, was 3 ± 0.5 by noise alone"]
    assert list(script.differences(kept, far)) == moved
    wider = {"status": "converged", "parameters": {"d": {"value": 3.0, "stderr": 5.6, "stderr_noise": 0.5}}}
    assert list(script.differences(kept, wider)) == ["d has a standard error of 5.6, had 5"]
    lost = {"status": "converged", "parameters": {"d": {"value": 3.0, "stderr": None}, "n": {}}}
    assert list(script.differences(kept, lost)) == ["d has a standard error of None, had 5.0", "n is new"]


STUDIES = [recipe.parent.relative_to(FITS).as_posix() for recipe in sorted(FITS.glob("**/recipe.toml"))]


@pytest.mark.slow  # two minutes
@pytest.mark.parametrize("study", STUDIES)
def test_every_study_is_reproduced(script, monkeypatch, study):
    monkeypatch.setenv("PELLICLE_CACHE", "off")
    assert script.rerun(FITS / study) == []
