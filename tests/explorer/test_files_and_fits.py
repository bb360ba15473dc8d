"""Data files and fits of the explorer's session."""

import base64
import dataclasses
import threading

import numpy as np
import pytest

import pellicle as pl
from pellicle.cli.explore import LightFlags, SceneFlags, _session
from pellicle.explorer import dropped_files
from pellicle.explorer import session as session_module
from pellicle.explorer.session import Session
from pellicle.fitting.result import Estimate
from pellicle.identification.hypothesis import Hypothesis, Identification, Outcome, SupposedLayer
from pellicle.scene.free import Free

NM = np.linspace(400.0, 800.0, 128)


@pytest.fixture
def session(tmp_path):
    (tmp_path / "recipe").mkdir()
    film = pl.Scene(pl.Layer("SiO2", pl.Free(10.0, 1000.0)), "Si")
    return Session(film, tmp_path / "recipe", wavelength=NM)


def csv(header, *columns):
    return "\n".join([header, *(",".join(f"{x:.8g}" for x in row) for row in zip(*columns, strict=True))])


GOOD = csv("wavelength_nm,R", NM, np.full(128, 0.2))


def test_data_are_drawn_as_they_are(session):
    answer = session.answer("data", {"name": "film.csv", "text": GOOD})
    [curve] = answer["curves"]
    assert curve["label"] == "R"
    assert np.allclose(curve["x"], NM)
    assert curve["y"] == [0.2] * 128
    assert answer["notes"][0] == "film.csv: R, 128 points from 400 to 800 nm"
    again = session.answer("data", {"name": "film.csv", "base64": base64.b64encode(GOOD.encode()).decode()})
    assert again["curves"] == answer["curves"]
    assert session.answer("scene", {})["data"]["curves"] == answer["curves"]


def test_light_and_range_of_the_data_replace_those_of_the_scene(session):
    text = csv("wavelength_nm,angle_deg,psi_deg,delta_deg", NM + 100, 0 * NM + 70, 0 * NM + 30, 0 * NM + 90)
    answer = session.answer("data", {"name": "e.csv", "text": text})
    assert answer["scene_changed"]
    assert [curve["label"] for curve in answer["curves"]] == ["Ψ", "Δ"]
    about = session.answer("scene", {})
    assert about["signals"] == ["Ψ", "Δ"]
    assert {each["name"]: each["value"] for each in about["controls"]}["angle"] == 70.0
    assert session.shown.view.wavelength[0] == 500.0


def test_new_data_replace_the_light_of_those_before_and_removing_them_restores_it(session):
    ellipsometry = csv("wavelength_nm,angle_deg,psi_deg,delta_deg", NM, 0 * NM + 70, 0 * NM + 30, 0 * NM + 90)
    began = session.answer("scene", {})
    session.answer("data", {"name": "e.csv", "text": ellipsometry})
    answer = session.answer("data", {"name": "film.csv", "text": GOOD})
    assert answer["states_angle"]  # the slider leaves the angle of the data before
    about = session.answer("scene", {})
    assert about["signals"] == ["R"]
    assert {each["name"]: each["value"] for each in about["controls"]}["angle"] == 0.0
    for request in ("remove", "reset"):
        session.answer("data", {"name": "e.csv", "text": ellipsometry})
        assert session.answer(request, {})["curves"] == []
        assert session.answer("scene", {}) == began


def test_a_file_is_read_by_the_texts_of_fields_that_its_message_names(session, tmp_path):
    percent = csv("wavelength_nm,R", NM, np.linspace(20.0, 40.0, 128))
    answer = session.answer("data", {"name": "film.csv", "text": percent})
    assert "signal_unit" in answer["fields"]
    assert "signal unit percent" in answer["error"]
    texts = {"signal_unit": "percent", "range": "450-700", "columns": "", "noise": "0.4"}
    answer = session.answer("data", {"reading": texts})  # of the same file
    [curve] = answer["curves"]
    assert (min(curve["x"]) >= 450, max(curve["x"]) <= 700) == (True, True)
    assert np.allclose(curve["y"], np.interp(curve["x"], NM, np.linspace(0.2, 0.4, 128)), atol=1e-6)
    assert session.shown.spectra[0].sigma == pytest.approx(0.004)
    assert answer["reading"] == {"signal_unit": "percent", "range": "450:700", "noise": "0.4"}
    toml = session.answer("recipe", {})["toml"]
    assert 'signal_unit = "percent"' in toml
    assert "range = [450, 700]" in toml
    wrong = session.answer("data", {"reading": {"wavelength_unit": "inch"}})
    assert wrong["error"].startswith("wavelength unit must be one of")
    assert session.answer("scene", {})["data"]["reading"] == answer["reading"]  # the data before stay


def test_points_beyond_the_materials_are_left_out_and_their_range_is_stated(session):
    wide = csv("wavelength_nm,R", NM + 300, np.full(128, 0.2))
    session.answer("data", {"name": "film.csv", "text": wide})
    rows = [{"material": None}, {"was": 0, "material": "CdS", "thickness": None}, {"material": None}]
    answer = session.answer("layers", {"rows": rows})  # known up to 1033 nm
    [[low, high]] = answer["cut"]
    assert (round(low), high) == (1031, 1100.0)
    assert any("known from" in note for note in answer["notes"])
    [curve] = session.answer("view", {"want": ["curves"], "wait": True})["curves"]
    assert max(curve["x"]) == pytest.approx(low)


BAD = {
    "words": "this is no spectrum\nat all",
    "empty": "",
    "negative": csv("wavelength_nm,R", NM, -NM),
    "percent": csv("wavelength_nm,R", NM, 0 * NM + 40),
    "missing": "wavelength_nm,R\n500,0.2\n510,\n520,0.3\n",
    "constants": csv("wavelength_nm,n,k", NM, NM / 400, 0 * NM),
    "html": "<html><body>not found</body></html>",
}


@pytest.mark.parametrize("kind", BAD)
def test_bad_text_is_refused_in_one_sentence(session, kind):
    answer = session.answer("data", {"name": f"{kind}.csv", "text": BAD[kind]})
    assert answer.keys() <= {"error", "fields"}
    assert answer["error"].startswith(f"{kind}.csv: ")
    assert "\n" not in answer["error"]
    assert "/tmp" not in answer["error"]
    assert "data" not in session.answer("scene", {})


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ({"name": "a.csv", "base64": base64.b64encode(bytes(range(256)) * 9).decode()}, "a.csv: "),
        ({"name": "a.csv", "base64": "###"}, "is not base64"),
        ({"name": "a.csv"}, "needs its text"),
        ({"name": 3, "text": GOOD}, "needs a name"),
        ({"name": "a.csv", "text": 7}, "needs its text"),
        ({"name": "a.csv", "text": "\ud800"}, "is not Unicode"),
        ({"file": 3}, "only files in the folder"),
    ],
)
def test_bad_bodies_are_refused(session, body, said):
    assert said in session.answer("data", body)["error"]


def test_names_lead_to_no_other_folder(session, tmp_path):
    for name in ("../../evil.csv", "/etc/evil.csv", "..\\evil.csv", "..", ".", "", "a/../..", "evil\0.csv"):
        answer = session.answer("data", {"name": name, "text": GOOD})
        assert "/" not in answer["name"]
        assert ".." not in answer["name"]
    assert not [path for path in tmp_path.rglob("*") if path.is_file()]


def test_only_files_of_the_folder_are_read(session, tmp_path, write):
    secret = write(GOOD, "secret.csv")
    folder = tmp_path / "recipe"
    (folder / "own.csv").write_text(GOOD)
    (folder / "link.csv").symlink_to(secret)
    assert session.answer("data", {"file": "own.csv"})["name"] == "own.csv"
    for name in ("../secret.csv", str(secret), "link.csv", "./../secret.csv", "x\0", "~/secret.csv", "."):
        answer = session.answer("data", {"file": name})
        assert answer.keys() <= {"error", "fields"}, name
    without = Session(pl.Scene(pl.Layer("SiO2", 100.0), "Si"))
    assert "only files in the folder" in without.answer("data", {"file": "own.csv"})["error"]


def test_large_files_are_refused(session, monkeypatch, tmp_path):
    monkeypatch.setattr(dropped_files, "LARGEST_FILE", 100)
    assert "more than" in session.answer("data", {"name": "a.csv", "text": GOOD})["error"]
    (tmp_path / "recipe" / "own.csv").write_text(GOOD)
    assert "more than" in session.answer("data", {"file": "own.csv"})["error"]


def test_a_fit_is_stopped_and_others_wait(session, monkeypatch):
    session.answer("data", {"name": "film.csv", "text": GOOD})
    began, go_on, seen = threading.Event(), threading.Event(), []

    def slow(data, scene, progress):
        seen.append(scene)
        progress("scan", 3, 10)
        began.set()
        assert go_on.wait(20)
        progress("scan", 4, 10)

    monkeypatch.setattr(session_module, "fit_film", slow)
    answers = []
    body = {"values": {"thickness": 300.0, "roughness": 2.0}, "free": ["thickness", "instrument.bandwidth"]}
    thread = threading.Thread(target=lambda: answers.append(session.answer("fit", body)))
    thread.start()
    assert began.wait(20)
    assert session.answer("fit_status", {})["text"] == "scan 3/10"
    assert "a fit is running" in session.answer("fit", {})["error"]
    assert session.answer("view", {"want": ["plan"]})["plan"]
    session.answer("fit_stop", {})
    go_on.set()
    thread.join()
    assert answers == [{"stopped": True}]
    assert not session.answer("fit_status", {})["running"]
    [scene] = seen
    layer, width = scene.layers[0], scene.instrument.bandwidth
    assert (layer.thickness.lower, layer.thickness.upper, layer.thickness.start) == (10.0, 1000.0, 300.0)
    assert layer.roughness == 2.0
    assert isinstance(width, Free)
    assert width.lower == 0.0
    answer = session.answer("recipe", body)  # which repeats this fit
    (session.folder / "film.toml").write_text(answer["toml"])
    again = pl.read_recipe(session.folder / "film.toml").scene()
    assert (again.layers[0].thickness, again.instrument.bandwidth) == (layer.thickness, width)
    assert answer["commands"]["toml"] == "Run it: pellicle fit --recipe recipe.toml, saved beside film.csv"


@pytest.mark.slow
def test_the_program_of_the_explorer_fits_as_it_does(session, monkeypatch, capsys):
    """With every option of reading and of the fit, and with the free numbers of the page."""
    film = pl.simulate(pl.Scene(pl.Layer("SiO2", 300.0), "Si"), NM, noise=0.002, seed=1)
    (session.folder / "film.csv").write_text(csv("wavelength_nm,R_percent", NM, 100 * film.values))
    reading = {"range": "450:750", "noise": "0.4 %", "signal_unit": "percent"}
    session.answer("data", {"file": "film.csv", "reading": reading})
    session.shown.reading = {**session.shown.reading, "loss": "huber", "tolerance": 1e-3}
    body = {"values": {"thickness": 320.0, "roughness": 1.0}, "free": ["thickness"]}
    found = session.answer("fit", body)
    answer = session.answer("recipe", body)
    assert answer["commands"]["python"] == "Run it: python film.py, saved beside recipe.toml"
    (session.folder / "recipe.toml").write_text(answer["toml"])
    monkeypatch.chdir(session.folder)
    names: dict = {}
    exec(answer["python"], names)
    assert names["options"] == {"loss": "huber", "tolerance": 1e-3}
    assert names["fit"]["thickness"].value == found["values"]["thickness"]
    assert "thickness" in capsys.readouterr().out


def test_a_film_is_identified_and_shown(session):
    """The scene has an oxide, and the data are of titania."""
    assert session.answer("identify", {})["error"].startswith("there are no data to identify")
    titania = pl.simulate(pl.Scene(pl.Layer("TiO2", 80.0), "Si"), NM, noise=0.002, seed=1)
    session.answer("data", {"name": "t.csv", "text": csv("wavelength_nm,R", NM, titania.values)})
    assert session.answer("hypothesis", {"number": 0})["error"].startswith("no hypothesis 0")
    found = session.answer("identify", {})
    assert found["status"] in found["summary"]
    numbers = {x["name"]: i for i, x in enumerate(found["hypotheses"])}
    answer = session.answer("hypothesis", {"number": numbers["TiO2"]})
    assert answer["scene_changed"]
    about = session.answer("scene", {})
    [thickness] = [x["value"] for x in about["controls"] if x["name"] == "thickness"]
    assert abs(thickness - 80) < 3
    assert about["data"]["curves"] == answer["curves"]
    [curve] = session.answer("view", {"want": ["curves"], "wait": True})["curves"]
    assert np.abs(np.interp(NM, curve["x"], curve["y"]) - titania.values).max() < 0.02
    session.answer("data", {"name": "film.csv", "text": GOOD})
    assert "error" in session.answer("hypothesis", {"number": 0})  # of other data


def test_a_film_is_identified_from_all_points_and_shown_with_its_folded_delta(monkeypatch):
    """PMMA, which the scene has, is known from 420 nm on; the film that is found has no such limit."""
    nm, light = np.linspace(390, 800, 40), pl.Light(angle=65.0, signal="psi-delta")
    true = pl.simulate(pl.Scene(pl.Layer("SiO2", 100.0), "Si", light=light), nm)
    data = dataclasses.replace(true, delta=180 - np.abs(180 - true.delta), folded=False, path="film.csv")
    session = Session(pl.Scene(pl.Layer("PMMA", pl.Free(50, 200)), "Si", light=light), spectra=[data])

    def found(spectra, scene, values):
        assert [len(x) for x in spectra] == [40]
        thickness = Estimate("thickness", 100.0, 1.0, "nm", 50.0, 200.0, free=True, stderr_noise=0.1)
        layer = SupposedLayer("SiO2", ("SiO2",), (1.45, 1.47), (0.0, 0.0), (thickness,))
        best = Hypothesis("SiO2", (layer,), 0.0, 1.0, True, scene)
        folded = dataclasses.replace(data, folded=True)
        return Identification(Outcome.IDENTIFIED, (best,), (), (), "", (folded,), (np.ones(2),))

    monkeypatch.setattr(session_module, "identification", found)
    assert session.answer("identify", {})["status"] == "identified"
    assert "error" not in session.answer("hypothesis", {"number": 0})
    assert session.shown.reading["folded"]
    assert [x.folded for x in session.shown.spectra] == [True]


def test_files_of_a_recipe_are_shown_in_turn_with_their_own_angles(tmp_path, write):
    """As the command opens a recipe of two reflectances, of which the second is at 60 degrees."""
    for name, level in (("a.csv", 0.2), ("b.csv", 0.3)):
        write(csv("wavelength_nm,R", NM, np.full(128, level)), name)
    recipe = (
        '[[data.file]]\npath = "a.csv"\n[[data.file]]\npath = "b.csv"\nangle = 60\n'
        '[scene]\nsubstrate = "Si"\n[[scene.layer]]\nmaterial = "SiO2"\nthickness = 100\n'
    )
    session = _session(str(write(recipe, "two.toml")), SceneFlags(), LightFlags())

    def state():
        about = session.answer("scene", {})
        angle = next(each["value"] for each in about["controls"] if each["name"] == "angle")
        return about["files"], about["number"], angle, about["data"]["curves"][0]["y"][0]

    files = ["a.csv", "b.csv"]
    assert state() == (files, 0, 0.0, 0.2)
    rows = [{"material": None}, {"was": 0, "material": "TiO2", "thickness": None}, {"material": None}]
    session.answer("layers", {"rows": rows})
    assert session.answer("tab", {"number": 1})["states_angle"]
    assert state() == (files, 1, 60.0, 0.3)
    assert session.answer("scene", {})["layers"][1]["material"] == "TiO2"
    assert "no file 2" in session.answer("tab", {"number": 2})["error"]
    session.answer("reset", {})
    assert state() == (files, 0, 0.0, 0.2)
    assert session.answer("scene", {})["layers"][1]["material"] == "SiO2"


def test_counts_of_a_recipe_stay_counts_when_a_field_is_changed(tmp_path, write):
    """The reference has no field: without it, the page could not read the file again."""
    for name, level in (("film.csv", 9000.0), ("reference.csv", 20000.0)):
        write(csv("wavelength_nm,counts", NM, np.full(128, level)), name)
    recipe = (
        '[data]\nfiles = ["film.csv"]\nsignal = "R"\nreference = "reference.csv"\nreference_material = "Si"\n'
        '[scene]\nsubstrate = "Si"\n[[scene.layer]]\nmaterial = "SiO2"\nthickness = 100\n'
    )
    session = _session(str(write(recipe, "counts.toml")), SceneFlags(), LightFlags())
    [before] = session.shown.spectra
    middle = float(NM[64])
    answer = session.answer("data", {"reading": {"signal": "R", "range": f"{NM[0]:g}:{middle:g}"}})
    assert "error" not in answer
    [after] = session.shown.spectra
    assert after.wavelength.max() == pytest.approx(middle, abs=1e-4)
    assert np.array_equal(after.values, before.values[: len(after)])
    assert 'reference = "reference.csv"' in session.answer("recipe", {})["toml"]
