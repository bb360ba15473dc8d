"""Answers of the explorer's session: views against independent computations, and refusals."""

import base64
import io
import time

import equinox as eqx
import numpy as np
import pytest
import tmm
from PIL import Image

import pellicle as pl
from pellicle.colour import lab, sensor
from pellicle.explorer.session import Session
from pellicle.reporting.renderings import display, exposure
from pellicle.simulation.environment import studio
from pellicle.simulation.film_sphere import ball, stack

NM = np.linspace(380.0, 780.0, 41)


@pytest.fixture(scope="module")
def session():
    return Session(pl.Scene(pl.Layer(1.7, 120.0), 3.9 + 0.02j), wavelength=NM, title="film")


def view(session, want, **values):
    return session.answer("view", {"values": values, "want": want, "wait": True, "serial": 7})


def reflectance(nm, thickness, n, angle=0.0):
    """The mean of s and p by the tmm package, of a film on 3.9 + 0.02i."""
    at = np.deg2rad(angle)
    both = [tmm.coh_tmm(p, [1, n, 3.9 + 0.02j], [np.inf, thickness, np.inf], at, nm)["R"] for p in "sp"]
    return np.mean(both)


@pytest.mark.parametrize(
    ("values", "film"),
    [
        ({"thickness": 250.0, "n": 1.6}, (250.0, 1.6)),
        ({"thickness": 250.0, "k": 0.2}, (250.0, 1.7 + 0.2j)),
        ({"thickness": 90.0, "angle": 65.0}, (90.0, 1.7, 65.0)),
        ({"thickness": 90.0, "angle": 65.0, "k": 0.1}, (90.0, 1.7 + 0.1j, 65.0)),
    ],
)
def test_curve_is_that_of_the_values(session, values, film):
    answer = view(session, ["curves", "plan"], **values)
    [curve] = answer["curves"]
    assert answer["serial"] == 7
    assert (curve["label"], curve["x"]) == ("R", NM.tolist())
    assert np.allclose(curve["y"], [reflectance(nm, *film) for nm in NM], rtol=0, atol=2e-7)  # 7 digits
    plan = {row["effect"]: row["choice"] for row in answer["plan"]}
    switches = tuple("on" if values.get(name) else "off" for name in ("angle", "k"))
    assert (plan["oblique"], plan["absorption"]) == switches


def test_colour_is_the_integral_over_the_spectrum(session):
    eye = sensor()
    spectrum = np.array([reflectance(nm, 250.0, 1.7) for nm in eye.wavelength])
    expected = np.asarray(lab(spectrum @ eye.weights, eye.white))
    colour = view(session, ["colour"], thickness=250.0)["colour"]
    assert np.allclose(colour["lab"], expected, rtol=0, atol=0.05)
    assert "reflected light" in colour["text"]


def test_sphere_is_that_of_the_ball(session):
    body = {"values": {"thickness": 250.0}, "want": ["sphere"], "size": 40, "wait": True}
    answer = session.answer("view", body)
    head, content = answer["sphere"].split(",")
    assert head == "data:image/png;base64"
    shown = np.asarray(Image.open(io.BytesIO(base64.b64decode(content)))) / 255
    film = pl.Scene(pl.Layer(1.7, 250.0), 3.9 + 0.02j)
    rendering = ball(stack(film), 250.0, studio(), 40).reflected
    expected = display(rendering, exposure(rendering, percentile=97.0), 0.06)
    assert shown.shape == (40, 40, 3)
    assert np.max(np.abs(shown - expected)) < 1.5 / 255


def test_a_new_effect_compiles_in_the_background(session):
    body = {"values": {"roughness": 2.0}, "want": ["curves"], "serial": 1}
    first = session.answer("view", body)
    assert first["compiling"] == ["curves"]
    assert "curves" not in first
    for _ in range(600):
        answer = session.answer("view", body)
        if not answer["compiling"]:
            break
        time.sleep(0.05)
    assert len(answer["curves"][0]["y"]) == len(NM)


def test_scene_describes_its_sliders(session):
    about = session.answer("scene", {})
    found = {each["name"]: each for each in about["controls"]}
    assert (about["title"], about["kind"], about["signals"]) == ("film", "spectrum", ["R"])
    assert list(found)[:3] == ["thickness", "n", "k"]
    assert {"substrate.n", "substrate.k", "angle", "roughness", "thickness_spread"} < set(found)
    assert {"instrument.bandwidth", "instrument.numerical_aperture"} < set(found)
    assert (found["thickness"]["value"], found["thickness"]["unit"]) == (120.0, "nm")
    assert found["substrate.k"]["value"] == 0.02
    assert found["roughness"]["value"] == found["roughness"]["lower"] == 0.0
    for each in found.values():
        assert each["lower"] <= each["value"] <= each["upper"]
        assert 0 < each["step"] <= (each["upper"] - each["lower"]) / 500


@pytest.mark.parametrize(
    ("request_", "body", "said"),
    [
        ("view", {"values": {"thicknes": 1.0}}, "no control 'thicknes'"),
        ("view", {"values": {"thickness": 5000.0}}, "thickness must be 0 to 1000 nm, got 5000"),
        ("view", {"values": {"thickness": float("nan")}}, "must be a number"),
        ("view", {"values": {"thickness": "1"}}, "must be a number"),
        ("view", {"values": [1]}, "numbers by name"),
        ("view", {"want": ["everything"]}, "want must be a list"),
        ("view", {"size": 10**9}, "size must be"),
        ("view", [], "JSON object"),
        ("fit", {}, "no data to fit"),
        ("recipe", {"values": {"x": 1}}, "no control 'x'"),
        ("../view", {}, "no request"),
        ("__class__", {}, "no request"),
    ],
)
def test_wrong_requests_are_answered_by_one_sentence(session, request_, body, said):
    answer = session.answer(request_, body)
    assert said in answer["error"]
    assert "\n" not in answer["error"]
    assert "`" not in answer["error"]


def test_a_cone_beyond_grazing_incidence_is_a_warning(session):
    values = {"angle": 80.0, "instrument.numerical_aperture": 0.5}
    answer = session.answer("view", {"values": values, "want": ["curves"]})
    assert "curves" not in answer
    assert "beyond 89 degrees" in answer["warnings"][0]


def test_a_colour_without_data_is_a_warning():
    film = pl.Scene(pl.Layer("Si/Chandler-Horowitz", 2000.0), 1.5)
    infrared = Session(film, wavelength=[7000.0, 8000.0, 9000.0])
    answer = infrared.answer("view", {"want": ["curves", "colour"], "wait": True})
    assert len(answer["curves"][0]["y"]) == 3
    assert "colour" not in answer
    assert "Chandler-Horowitz" in answer["warnings"][0]


def test_recipe_and_program_give_the_scene_of_the_sliders(tmp_path, monkeypatch, capsys):
    scene = pl.Scene(pl.Layer(1.7, pl.Free(50.0, 900.0)), "Si")
    session = Session(scene, tmp_path)
    values = {"thickness": 321.0, "n": 1.65, "roughness": 2.0, "angle": 30.0}
    answer = session.answer("recipe", {"values": values})
    (tmp_path / "film.toml").write_text(answer["toml"])
    read = pl.read_recipe(tmp_path / "film.toml").scene()
    layer = read.layers[0]
    assert (layer.thickness.lower, layer.thickness.upper, layer.thickness.start) == (50.0, 900.0, 321.0)
    assert layer.material == pl.dispersion.Constant(1.65)
    assert (layer.roughness, read.light.angle, read.instrument.bandwidth) == (2.0, 30.0, None)
    ran, nm = [], np.array([0.2, 0.3])
    # compiling the rough film takes seconds, and other tests simulate
    monkeypatch.setattr(pl, "simulate", lambda *given: ran.append(given) or pl.Spectrum(nm, nm, "R"))
    exec(answer["python"], {})
    [(again, at)] = ran
    assert eqx.tree_equal(again, read)
    assert at.tolist() == list(range(380, 781))
    assert "0.2" in capsys.readouterr().out
