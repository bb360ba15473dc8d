"""Results as files: strict JSON, tables that can be read again, and nothing of the user's lost."""

import json
import math
import os
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from pellicle.data.read_spectrum import read_spectrum
from pellicle.data.spectrum import Spectrum
from pellicle.errors import UsageError
from pellicle.fitting.curves import Curve
from pellicle.fitting.result import Estimate, Fit, Rival, Status
from pellicle.forward_model.plan import Plan, Row
from pellicle.materials import material
from pellicle.reporting.fit_tables import fit_csv, nk_csvs
from pellicle.reporting.folders import folder_per_file, write_fit, write_summary
from pellicle.reporting.json_record import failure, one_line, to_json
from tests.data.tables import assert_read

FILES = ["figure.png", "fit.csv", "nk.csv", "report.html", "report.txt", "result.json"]
KEYS = (
    "schema data status verdict parameters rivals chi2_reduced rms effective_points correlation"
    " budget plan warnings versions seconds"
)


@pytest.fixture
def fit(fit, with_part) -> Fit:
    """A fit with infinite and undefined numbers, a limit and one rival."""
    nm = fit.curve.wavelength
    layer = {
        "n": np.linspace(1.4, 1.3, 41),
        "k": np.linspace(0.02, 0.01, 41),
        "n_stderr": np.linspace(0.0, 0.001, 41),
        "k_stderr": np.where(nm < 600, np.inf, 0.001),
    }
    plan = Plan((Row("absorption", True, "k is free", np.float64(0.0)),), "R", "unpolarised")
    return replace(
        with_part(fit, curve=replace(fit.curve, **layer), plan=plan, chi2_reduced=math.nan),
        status=Status.CONVERGED,
        verdict="The data determine thickness: 486.28 ± 0.12 nm.",
        parameters={
            "thickness": Estimate("thickness", 486.28, 0.12, "nm", 10.0, 3000.0, True),
            "k": Estimate("k", 0.0, 0.001, "", 0.0, 1.0, True, True, None, 0.0016),
            "instrument.scale": Estimate("instrument.scale", 4.5, math.inf, "", -math.inf, math.inf, True),
            "B": fit["B"],
        },
        rivals=(Rival({"thickness": 242.87, "k": 0.1}, 8.5),),
        chi2_reduced=math.nan,
        correlation_names=("thickness", "k"),
        correlation=np.array([[1.0, np.nan], [np.nan, 1.0]]),
        warnings=("a warning",),
    )


def strictly(text: str):
    """JSON without the constants that Python would let pass."""

    def refuse(constant):
        raise AssertionError(f"{constant} is no JSON")

    return json.loads(text, parse_constant=refuse)


def test_the_record_of_a_fit_has_the_keys_of_the_schema(fit):
    record = strictly(one_line(to_json(fit)))
    assert list(record) == [*KEYS.split(), "noise"]
    assert record["schema"] == "pellicle.fit/1"
    assert record["data"] == {"path": "/data/film.csv", "sha256": "ab" * 32, "signal": "R", "points": 41}
    assert record["noise"] == {"sigma": 0.002, "source": "given"}
    assert record["status"] == "converged"
    assert record["verdict"] == fit.verdict
    assert record["rivals"] == [{"parameters": {"thickness": 242.87, "k": 0.1}, "delta_chi2": 8.5}]
    assert record["plan"] == [{"effect": "absorption", "on": True, "why": "k is free", "error_bound": 0.0}]
    assert record["warnings"] == ["a warning"]
    assert record["effective_points"] == 12.0
    assert list(record["versions"]) == ["pellicle", "python", "jax", "optimistix", "numpy"]
    assert record["versions"]["numpy"] == np.__version__


def test_parameters_keep_limits_only_where_there_are_any(fit):
    parameters = to_json(fit)["parameters"]
    errors = {"stderr": 0.12, "stderr_noise": 0.12, "expanded": 1.959964 * 0.12, "coverage_factor": 1.959964}
    about = {"degrees_of_freedom": None, "unit": "nm", "lower": 10.0, "upper": 3000.0, "free": True}
    assert parameters["thickness"] == pytest.approx({"value": 486.28} | errors | about)
    assert parameters["k"]["upper_limit"] == 0.0016
    assert "lower_limit" not in parameters["k"]
    assert parameters["B"]["free"] is False


def test_what_is_infinite_or_undefined_is_null(fit, refuses):
    record = strictly(one_line(to_json(fit)))
    scale = record["parameters"]["instrument.scale"]
    assert (scale["stderr"], scale["lower"], scale["upper"]) == (None, None, None)
    assert record["chi2_reduced"] is None
    assert record["correlation"] == {"names": ["thickness", "k"], "matrix": [[1.0, None], [None, 1.0]]}
    refuses(ValueError, "JSON", one_line, {"stderr": math.inf})
    line = one_line(to_json(replace(fit, verdict="± two\nlines")))
    assert (line.isascii(), "\n" in line) == (True, False)


def test_a_file_that_cannot_be_read_has_the_same_keys_and_an_error(fit):
    record = strictly(one_line(failure("bad.csv", ValueError("bad.csv: is empty"))))
    assert set(record) == {*KEYS.split(), "error"}
    assert record["status"] == Status.FAILED
    assert record["error"] == "bad.csv: is empty"
    assert record["data"] == {"path": "bad.csv", "sha256": None, "signal": None, "points": 0}
    assert record["parameters"] == {}
    assert failure("bad.csv", "no", "cd" * 32)["data"]["sha256"] == "cd" * 32
    assert [d["path"] for d in failure(["a.csv", "b.csv"], "no such file")["data"]] == ["a.csv", "b.csv"]


def test_a_second_fit_replaces_the_first_and_leaves_the_rest(fit, tmp_path):
    write_fit(tmp_path, fit)
    (tmp_path / "diary.txt").write_text("mine")
    write_fit(tmp_path, replace(fit, rms=0.5))
    assert sorted(os.listdir(tmp_path)) == sorted([*FILES, "diary.txt"])
    assert (tmp_path / "diary.txt").read_text() == "mine"
    assert strictly((tmp_path / "result.json").read_text())["rms"] == 0.5


def test_tables_of_another_scene_do_not_stay_beside_a_fit(fit, tmp_path):
    write_fit(tmp_path, fit)
    table = (tmp_path / "nk.csv").read_text("utf-8")
    (tmp_path / "nk_ordinary.csv").write_text(table.replace("layer", "layer (ordinary)", 1), "utf-8")
    (tmp_path / "profile.csv").write_text("# profiles at 650 nm against depth\n", "utf-8")
    (tmp_path / "nk_gold.csv").write_text("wavelength_nm,n,k\n", "utf-8")  # the user's
    write_fit(tmp_path, fit)
    assert sorted(os.listdir(tmp_path)) == sorted([*FILES, "nk_gold.csv"])


@pytest.mark.parametrize("name", ["diary.txt", "figure.png", "fit.csv", "summary.csv"])
def test_a_folder_of_the_users_stays_as_it_is(fit, tmp_path, name, refuses):
    (tmp_path / name).write_text("mine")
    for write in (
        lambda: write_fit(tmp_path, fit),
        lambda: write_summary(tmp_path / "summary.csv", [to_json(fit)]),
        lambda: folder_per_file(tmp_path, ["a.csv", "b.csv"]),
    ):
        refuses(UsageError, "did not write", write)
    assert os.listdir(tmp_path) == [name]
    assert (tmp_path / name).read_text() == "mine"


def test_fit_csv_says_what_it_is_and_is_read_again(fit, write):
    path = write(fit_csv(fit), "fit.csv")
    comments = [line for line in path.read_text().splitlines() if line.startswith("#")]
    assert any("/data/film.csv, sha256 " + "ab" * 32 in line for line in comments)
    assert any("pellicle 0." in line for line in comments)
    frame = pd.read_csv(path, comment="#")
    assert list(frame) == ["wavelength_nm", "data", "model", "residual", "sigma"]
    np.testing.assert_allclose(frame["data"] - frame["model"], frame["residual"], atol=1e-9)
    [told] = [line for line in comments if "--columns" in line]
    again = read_spectrum(path, columns=told.split("--columns ")[1])
    expected = {"wavelength": fit.curve.wavelength, "values": fit.curve.data, "sigma": fit.curve.sigma}
    assert_read(again, 1e-9, **expected)


def test_uncalibrated_data_at_angles_are_read_again_as_such(fit, with_part, write):
    curve = replace(fit.curve, data=50 * fit.curve.data)
    angled = replace(fit.spectrum, values=curve.data, angle=np.full(41, 30.0), calibrated=False)
    text = fit_csv(with_part(fit, data=angled, curve=curve))
    columns = "wavelength,intensity,_,_,sigma,angle"
    assert columns in text
    again = read_spectrum(write(text, "fit.csv"), columns=columns, signal="R")
    assert not again.calibrated
    np.testing.assert_array_equal(again.angle, 30.0)


def test_nk_csv_of_several_angles_holds_each_wavelength_once(fit, with_part):
    twice = {name: np.repeat(getattr(fit.curve, name), 2) for name in vars(fit.curve) if name != "principal"}
    assert nk_csvs(with_part(fit, curve=Curve(**twice))) == nk_csvs(fit)


@pytest.mark.parametrize("everywhere", [[], ["n_stderr"], ["k_stderr"], ["n_stderr", "k_stderr"]])
def test_nk_csv_is_a_material_whatever_errors_are_infinite(fit, with_part, write, everywhere):
    unseen = replace(fit.curve, **{name: np.full(41, np.inf) for name in everywhere})
    path = write(nk_csvs(with_part(fit, curve=unseen))["nk.csv"], "nk.csv")
    index = np.asarray(material(str(path))(fit.curve.wavelength))
    np.testing.assert_allclose(index, fit.curve.n + 1j * fit.curve.k, rtol=1e-9)
    frame = pd.read_csv(path, comment="#")
    assert list(frame) == ["wavelength_nm", "n", "k", "n_stderr", "k_stderr"]
    assert frame["k_stderr"].isna().sum() == (41 if "k_stderr" in everywhere else 20)  # below 600 nm


def test_a_path_cannot_break_out_of_its_comment(fit, with_part, tmp_path):
    odd = with_part(fit, data=replace(fit.spectrum, path="a\n1,2\r3.csv"))
    assert "# from a 1,2 3.csv, sha256" in fit_csv(odd)


def test_the_summary_has_a_row_per_file_and_the_union_of_free_parameters(fit, tmp_path):
    parameters = {"thickness": fit["thickness"], "n": Estimate("n", 1.5, 0.01, "", 1.3, 1.7, True)}
    other = replace(fit, parameters=parameters, chi2_reduced=1.5)
    folder_per_file(tmp_path, ["a.csv", "b.csv", "c.csv"])
    records = [to_json(fit), failure("c, d.csv", "no such file"), to_json(other)]
    write_summary(tmp_path / "summary.csv", records)
    text = (tmp_path / "summary.csv").read_bytes().decode()
    assert text.startswith("\ufeffpath,")  # by its first character Excel knows the encoding
    frame = pd.read_csv(tmp_path / "summary.csv")
    names = ("thickness", "k", "instrument.scale", "n")
    ends = ("", "_stderr", "_stderr_noise", "_95", "_unit")
    columns = [f"{name}{end}" for name in names for end in ends]
    assert list(frame) == ["path", "status", "verdict", *columns, "rms", "chi2_reduced", "sha256", "error"]
    assert list(frame["status"]) == ["converged", "failed", "converged"]
    assert frame["path"][1] == "c, d.csv"
    assert frame["error"][1] == "no such file"
    np.testing.assert_array_equal(frame["n"], [np.nan, np.nan, 1.5])
    np.testing.assert_array_equal(frame["thickness_stderr"], [0.12, np.nan, 0.12])
    assert frame["instrument.scale_stderr"].isna().all()  # infinite
    write_summary(tmp_path / "summary.csv", [to_json(fit)])
    assert len(pd.read_csv(tmp_path / "summary.csv")) == 1


def test_folders_of_several_files(tmp_path):
    paths = ["x/a.csv", "y/A.txt", "a-2.csv", "b.csv", "summary.csv.csv", "z/a.csv"]
    root = tmp_path / "out"
    folders = folder_per_file(root, paths)
    assert [folder.name for folder in folders] == ["a", "A-2", "a-2-2", "b", "summary.csv-2", "a-3"]
    assert all(folder.parent == root for folder in folders)
    index = strictly((root / "result.json").read_text())
    assert index["schema"] == "pellicle.fits/1"
    assert index["files"][1] == {"path": "y/A.txt", "folder": "A-2"}
    assert folder_per_file(root, paths) == folders  # and again, in a folder that is ours


def test_one_file_has_the_folder_to_itself(tmp_path):
    assert folder_per_file(tmp_path / "out", ["a.csv"]) == [tmp_path / "out"]
    assert not (tmp_path / "out").exists()


@pytest.fixture
def joint(fit) -> Fit:
    """A joint fit: the spectrum, and Ψ and Δ at four points of it, without a common unit."""
    [one] = fit.parts
    few = {name: array[:4] for name, array in vars(one.curve).items() if array is not None}
    curve = Curve(**few | {"delta_data": np.full(4, 359.0), "delta_model": np.full(4, 1.0)})
    spectrum = Spectrum(few["wavelength"], few["data"], "psi-delta", path="b,c.csv", delta=np.full(4, 359.0))
    other = replace(one, name="b,c", data=spectrum, curve=curve, rms=0.1)
    return replace(fit, parts=(replace(one, name="film"), other), rms=None)


def test_json_of_a_joint_fit_lists_its_data(joint):
    record = strictly(one_line(to_json(joint)))
    assert [(d["name"], d["path"], d["signal"], d["points"], d["rms"]) for d in record["data"]] == [
        ("film", "/data/film.csv", "R", 41, 0.00141),
        ("b,c", "b,c.csv", "psi-delta", 4, 0.1),
    ]
    assert record["rms"] is None
    assert [row["name"] for row in record["plan"]] == ["film", "b,c"]
    alone = to_json(replace(joint, parts=joint.parts[:1]))
    assert [d["name"] for d in alone["data"]] == ["film"]


def test_tables_of_a_joint_fit(joint, fit, tmp_path):
    write_fit(tmp_path, joint)
    assert sorted(os.listdir(tmp_path)) == sorted(FILES)
    frame = pd.read_csv(tmp_path / "fit.csv", comment="#")
    sizes = frame.groupby(["file", "signal"]).size().to_dict()
    assert sizes == {("film", "R"): 41, ("b,c", "psi"): 4, ("b,c", "delta"): 4}
    np.testing.assert_allclose(frame["data"][:41], fit.curve.data, rtol=1e-9)
    assert set(frame["residual"][frame["signal"] == "delta"]) == {-2.0}
    without = [line for line in nk_csvs(joint)["nk.csv"].splitlines() if not line.startswith("#")]
    assert without == [line for line in nk_csvs(fit)["nk.csv"].splitlines() if not line.startswith("#")]
