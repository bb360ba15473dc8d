"""Several angles of incidence in the explorer's session, and signals at one wavelength against the angle."""

import numpy as np
import pytest
import tmm

import pellicle as pl
from pellicle.cli.reading import measured_scene
from pellicle.explorer import session as session_module
from pellicle.explorer.session import Session

NM = np.linspace(420.0, 800.0, 20)
ANGLES = (65.0, 70.0, 75.0)


def scene(signal="psi-delta", angle=ANGLES, wavelength=None, **about):
    light = pl.Light(wavelength, np.array(angle) if np.ndim(angle) else angle, signal)
    return pl.Scene(pl.Layer(1.7, 120.0, **about), 3.9 + 0.02j, light=light)


@pytest.fixture(scope="module")
def session():
    return Session(scene(), wavelength=NM)


@pytest.fixture(scope="module")
def laser():
    return Session(scene(angle=(50.0, 60.0, 70.0)), wavelength=[633.0])


def view(session, want, angles=None, **values):
    return session.answer("view", {"values": values, "want": want, "wait": True, "angles": angles})


def seen(nm, thickness, angle):
    """Ψ and Δ in degrees by the tmm package, whose Δ is that of −r_p/r_s, conjugated."""
    found = tmm.ellips([1, 1.7, 3.9 + 0.02j], [np.inf, thickness, np.inf], np.deg2rad(angle), nm)
    return np.rad2deg(found["psi"]), (180 - np.rad2deg(found["Delta"])) % 360


def agrees(curves, angles, thickness):
    every = {curve["label"]: curve["y"] for curve in curves}
    assert list(every) == [f"{signal} {angle:g}°" for signal in "ΨΔ" for angle in angles]
    for angle in angles:
        psi, delta = np.transpose([seen(nm, thickness, angle) for nm in NM])
        assert np.allclose(every[f"Ψ {angle:g}°"], psi, rtol=0, atol=1e-4)
        assert np.allclose(every[f"Δ {angle:g}°"], delta, rtol=0, atol=1e-4)


def test_each_angle_has_a_curve_and_a_colour(session):
    answer = view(session, ["curves", "colour", "plan"], thickness=250.0)
    agrees(answer["curves"], ANGLES, 250.0)
    assert [curve["setting"] for curve in answer["curves"]] == ["65°", "70°", "75°"] * 2
    assert {row["effect"]: row["reason"] for row in answer["plan"]}["oblique"] == "incidence at 65 to 75°"
    assert len(set(answer["colour"]["each"])) == 3
    # the colour at 70 degrees is that of a scene with this angle
    alone = view(session, ["colour"], [70.0], thickness=250.0)["colour"]
    assert alone["hex"] == answer["colour"]["each"][1]


def test_a_list_of_angles_has_no_slider_and_one_angle_has(session):
    about = session.answer("scene", {})
    assert about["angles"] == list(ANGLES)
    assert "angle" not in {each["name"] for each in about["controls"]}
    alone = session.answer("scene", {"angles": [72]})
    assert alone["angles"] == []
    assert {each["name"]: each["value"] for each in alone["controls"]}["angle"] == 72.0
    assert session.answer("scene", {})["angles"] == list(ANGLES)


def test_other_angles_use_the_same_program(session):
    view(session, ["curves"], thickness=250.0)
    values = {"values": {"thickness": 180.0}, "want": ["curves"]}
    answer = session.answer("view", values | {"angles": [80, 55, 60]})
    assert answer["compiling"] == []
    agrees(answer["curves"], (55.0, 60.0, 80.0), 180.0)


@pytest.mark.parametrize("angles", [[], [90], [-1], ["65"], [True], [float("nan")], list(range(13)), 65])
def test_wrong_angles_are_refused(session, angles):
    for request in ("view", "scene", "recipe"):
        assert "1 to 12 numbers from 0 to 89" in session.answer(request, {"angles": angles})["error"]


def test_a_cone_is_compiled_for_the_steepest_angle(session):
    at = {"instrument.numerical_aperture": 0.1}
    structure = dict(session.shown.view.structure(session.shown.view.defaults() | at).active)
    assert structure["angle"] == 75.0
    answer = view(session, ["curves"], [70.0, 88.0], **at)
    assert "beyond 89 degrees: the angle of incidence is 88" in answer["warnings"][0]


def test_recipe_and_program_have_every_angle(session, tmp_path, capsys):
    values = {"thickness": 250.0}
    answer = session.answer("recipe", {"values": values, "angles": [60, 75]})
    (tmp_path / "film.toml").write_text(answer["toml"])
    again, nm = measured_scene(pl.read_recipe(tmp_path / "film.toml"))
    drawn = {curve["label"]: curve["y"] for curve in view(session, ["curves"], [60, 75], **values)["curves"]}
    both = pl.simulate(again, nm)
    names: dict = {}
    exec(answer["python"], names)
    for spectrum in (both, names["spectrum"]):
        for angle in (60, 75):
            rows = spectrum.angle == angle
            assert np.allclose(spectrum.wavelength[rows], NM)
            assert np.allclose(spectrum.values[rows], drawn[f"Ψ {angle}°"], rtol=0, atol=1e-4)
            assert np.allclose(spectrum.delta[rows], drawn[f"Δ {angle}°"], rtol=0, atol=1e-4)
    assert "Si" not in capsys.readouterr().out


def test_one_wavelength_is_drawn_against_the_angle(laser):
    about = laser.answer("scene", {})
    assert about["axis"]["label"] == "angle of incidence (°)"
    assert (about["at_one_wavelength"], about["angles"]) == (633.0, [])
    assert "angle" not in {each["name"] for each in about["controls"]}
    psi, delta = view(laser, ["curves"], thickness=250.0)["curves"]
    assert (psi["label"], psi["x"][0], psi["x"][-1]) == ("Ψ", 50.0, 70.0)
    for i in (0, 77, -1):
        assert np.allclose([psi["y"][i], delta["y"][i]], seen(633.0, 250.0, psi["x"][i]), rtol=0, atol=1e-4)
    assert "abscissa is the angle" in laser.answer("view", {"angles": [60]})["error"]


def test_one_wavelength_at_one_angle_keeps_it_in_the_recipe(tmp_path):
    at = Session(scene(angle=70.0, wavelength=[633.0]))
    assert at.answer("scene", {})["axis"]["label"] == "angle of incidence (°)"
    answer = at.answer("recipe", {})
    (tmp_path / "film.toml").write_text(answer["toml"])
    again, nm = measured_scene(pl.read_recipe(tmp_path / "film.toml"))
    assert (again.light.angle, nm.tolist()) == (70.0, [633.0])
    assert "pl.Light(angle=70.0, signal='psi-delta')" in answer["python"]
    assert "np.array([633.0])" in answer["python"]


def csv(spectrum):
    rows = np.transpose([spectrum.wavelength, spectrum.angle, spectrum.values, spectrum.delta])
    lines = [",".join(f"{x:.8g}" for x in row) for row in rows]
    return "\n".join(["wavelength_nm,angle_deg,psi_deg,delta_deg", *lines])


def measured(angles, nm):
    pairs = np.array([(x, angle) for angle in angles for x in nm])
    psi, delta = np.transpose([seen(x, 180.0, angle) for x, angle in pairs])
    return pl.Spectrum(pairs[:, 0], psi, "psi-delta", delta=delta, angle=pairs[:, 1])


def test_data_at_several_angles_replace_the_light_and_are_fitted_together(monkeypatch):
    session = Session(pl.Scene(pl.Layer(1.7, pl.Free(10.0, 400.0)), 3.9 + 0.02j))
    data = measured((60.0, 72.0), NM)
    answer = session.answer("data", {"name": "film.csv", "text": csv(data)})
    assert answer["scene_changed"]
    assert answer["states_angle"]
    assert answer["notes"][0] == "film.csv: psi-delta, 40 points from 420 to 800 nm, at 60, 72°"
    labels = [curve["label"] for curve in answer["curves"]]
    assert sorted(labels) == ["Δ 60°", "Δ 72°", "Ψ 60°", "Ψ 72°"]
    for curve in answer["curves"]:
        rows = data.angle == float(curve["setting"].rstrip("°"))
        assert curve["x"] == NM.tolist()
        truth = data.values if curve["signal"] == "Ψ" else data.delta
        assert np.allclose(curve["y"], truth[rows], atol=1e-4)
    assert session.answer("scene", {})["angles"] == [60.0, 72.0]
    given = []
    monkeypatch.setattr(session_module, "fit_film", lambda data, scene, progress: given.append((data, scene)))
    several = {"values": {"thickness": 100.0}, "angles": [60.0, 65.0]}
    assert session.answer("fit", several) == {"stopped": True}
    assert session.answer("fit", {"values": {"angle": 30.0}, "angles": [60.0]}) == {"stopped": True}
    for fitted, scene_of_fit in given:
        assert np.unique(fitted.angle).tolist() == [60.0, 72.0]
        assert scene_of_fit.light.angle == 0.0  # that of the data is taken
    recipe = session.answer("recipe", {})["toml"]
    assert "film.csv" in recipe
    assert "angle" not in recipe


def test_data_at_one_wavelength_are_drawn_against_their_angles():
    session = Session(pl.Scene(pl.Layer(1.7, pl.Free(10.0, 400.0)), 3.9 + 0.02j))
    angles = np.arange(50.0, 71.0, 1.0)
    answer = session.answer("data", {"name": "laser.csv", "text": csv(measured(angles, [658.0]))})
    assert answer["notes"][0] == "laser.csv: psi-delta, 21 points at 658 nm, at 21 angles from 50 to 70°"
    drawn = {curve["label"]: curve["x"] for curve in answer["curves"]}
    assert drawn == dict.fromkeys("ΨΔ", angles.tolist())
    curves = view(session, ["curves"], thickness=180.0)["curves"]
    for curve, own in zip(curves, answer["curves"], strict=True):
        assert np.allclose(np.interp(angles, curve["x"], curve["y"]), own["y"], rtol=0, atol=1e-3)


def test_of_many_angles_twelve_are_drawn():
    session = Session(pl.Scene(pl.Layer(1.7, 100.0), 3.9 + 0.02j))
    text = csv(measured(np.arange(50.0, 80.0), NM[:6]))
    answer = session.answer("data", {"name": "many.csv", "text": text})
    settings = {curve["setting"] for curve in answer["curves"]}
    assert len(settings) == 12
    assert {"50°", "79°"} < settings
    assert "data at 12 of 30 angles of incidence are drawn; a fit uses all of them" in answer["notes"]


def test_folded_data_fold_the_curve():
    session = Session(pl.Scene(pl.Layer(1.7, 180.0), 3.9 + 0.02j))
    data = measured((60.0, 72.0), NM)
    delta = np.minimum(data.delta, 360 - data.delta)
    about = {"delta": delta, "angle": data.angle, "folded": True}
    folded = pl.Spectrum(data.wavelength, data.values, "psi-delta", **about)
    session.shown.view = session.shown.view.measured([folded])
    for curve in view(session, ["curves"])["curves"]:
        if curve["signal"] == "Δ":
            truth = [seen(nm, 180.0, float(curve["setting"][:2]))[1] for nm in curve["x"][::40]]
            assert np.allclose(curve["y"][::40], np.minimum(truth, 360 - np.array(truth)), atol=1e-3)


def test_of_a_mueller_matrix_the_measured_elements_are_drawn():
    session = Session(pl.Scene(pl.Layer(1.7, 180.0), 3.9 + 0.02j))
    rows = [f"{nm},{angle},0.1,0.2" for angle in (60, 70) for nm in (500, 600, 700)]
    session.answer("data", {"name": "m.csv", "text": "\n".join(["wavelength_nm,angle_deg,m33,m12", *rows])})
    curves = view(session, ["curves"])["curves"]
    assert [curve["label"] for curve in curves] == ["m12 60°", "m12 70°", "m33 60°", "m33 70°"]
    for curve in curves:
        truth = []
        for nm in (500.0, 700.0):
            psi, delta = np.deg2rad(seen(nm, 180.0, float(curve["setting"][:2])))
            element = {"m12": -np.cos(2 * psi), "m33": np.sin(2 * psi) * np.cos(delta)}
            truth.append(element[curve["signal"]])
        assert np.allclose([curve["y"][0], curve["y"][-1]], truth, rtol=0, atol=1e-5)


def test_data_without_an_angle_need_one(session):
    text = "wavelength_nm,psi_deg,delta_deg\n500,30,90\n600,30,90"
    answer = session.answer("data", {"name": "a.csv", "text": text})
    assert "a.csv: states no angle of incidence, and the scene has 65°, 70°, 75°" in answer["error"]


def test_a_free_angle_cannot_stand_for_several(refuses):
    session = Session(pl.Scene(pl.Layer(1.7, 100.0), 3.9, light=pl.Light(angle=pl.Free(60, 70))))
    answer = session.answer("data", {"name": "a.csv", "text": csv(measured((60.0, 65.0), NM))})
    assert "one free angle cannot stand for them" in answer["error"]
    refuses(pl.errors.UsageError, "which is free", Session, session.shown.view.scene, wavelength=[500.0])


def test_angles_of_each_wavelength():
    pairs = np.repeat(ANGLES, len(NM)), np.tile(NM, 3)
    light = pl.Light(pairs[1], pairs[0], "psi-delta")
    session = Session(pl.Scene(pl.Layer(1.7, 100.0), 3.9, light=light))
    assert session.shown.view.angles.tolist() == list(ANGLES)
    assert session.shown.view.wavelength.tolist() == NM.tolist()
    with pytest.raises(pl.errors.UsageError, match="the same angles at each wavelength"):
        Session(scene(angle=np.linspace(60, 70, len(NM)), wavelength=NM))
    with pytest.raises(pl.errors.UsageError, match="up to 12 angles"):
        Session(scene(angle=np.linspace(60, 70, 13)), wavelength=NM)
