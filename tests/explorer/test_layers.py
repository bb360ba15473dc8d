"""Materials and layers that are changed, added and removed in the explorer's session."""

import base64

import numpy as np
import pytest

import pellicle as pl
from pellicle.explorer.session import Session

NM = np.linspace(400.0, 800.0, 128)
AIR, SI = {"material": None}, {"material": None}
ITSELF = {"was": 0, "material": None, "thickness": None}


@pytest.fixture
def session(tmp_path):
    film = pl.Scene(pl.Layer("SiO2", pl.Free(10.0, 1000.0)), "Si")
    return Session(film, tmp_path, wavelength=NM)


def sent(name, text):
    return {"name": name, "base64": base64.b64encode(text.encode()).decode()}


def film(session, tmp_path):
    """The film of the page's recipe, read again."""
    (tmp_path / "film.toml").write_text(session.answer("recipe", {})["toml"])
    return pl.read_recipe(tmp_path / "film.toml").scene()


def test_a_layer_is_added_and_others_keep_the_values_of_their_sliders(session, tmp_path):
    oxide = {**ITSELF, "thickness": "200:400"}
    rows = [AIR, {"was": None, "material": "TiO2", "thickness": "20:90"}, oxide, {"material": "1.5"}]
    answer = session.answer("layers", {"rows": rows, "values": {"thickness": 321.0, "roughness": 2.0}})
    assert answer["scene_changed"]
    about = session.answer("scene", {})
    values = {each["name"]: each["value"] for each in about["controls"]}
    assert (values["layer1.thickness"], values["layer2.thickness"], values["layer2.roughness"]) == (
        55,
        321,
        2,
    )
    texts = [(row["material"], row.get("thickness")) for row in about["layers"]]
    assert texts == [("air", None), ("TiO2", "20:90"), ("SiO2", "200:400"), ("1.5", None)]
    scene = film(session, tmp_path)
    oxide = pl.Layer("SiO2", pl.Free(200, 400, start=321.0), roughness=2.0)
    wanted = pl.Scene([pl.Layer("TiO2", pl.Free(20, 90)), oxide], 1.5)
    [curve] = session.answer("view", {"want": ["curves"], "wait": True})["curves"]
    assert np.allclose(curve["y"], pl.simulate(wanted, NM).values, atol=2e-7)
    assert (scene.layers[1].thickness, scene.layers[1].roughness) == (oxide.thickness, 2.0)
    assert "TiO2" in session.answer("recipe", {})["python"]


def test_layers_are_moved_removed_and_reset(session):
    before = session.answer("scene", {})["layers"]
    new = {"was": None, "material": "cauchy(1.45, 3500)", "thickness": "80"}
    session.answer("layers", {"rows": [AIR, ITSELF, new, SI]})
    turned = [AIR, {**ITSELF, "was": 1}, ITSELF, SI]
    session.answer("layers", {"rows": turned})
    texts = [row["material"] for row in session.answer("scene", {})["layers"]]
    assert texts == ["air", "cauchy(1.45, 3500, 0)", "SiO2", "Si"]
    session.answer("layers", {"rows": [AIR, ITSELF, SI]})
    assert len(session.answer("scene", {})["layers"]) == 3
    assert session.answer("scene", {})["edited"]
    session.answer("reset", {})
    assert session.answer("scene", {})["layers"] == before
    assert not session.answer("scene", {})["edited"]


@pytest.mark.parametrize(
    ("row", "said"),
    [
        ({**ITSELF, "material": "SiO3"}, "unknown material 'SiO3'"),
        ({**ITSELF, "material": "1.5-0.1j"}, "with n and k finite, not negative"),
        ({**ITSELF, "material": "0"}, "must be n + ik, with n and k finite, not negative and not both 0"),
        ({**ITSELF, "material": " "}, "name a material"),
        ({**ITSELF, "material": "cauchy(1.45, 0.0035)"}, "B"),
        ({**ITSELF, "thickness": "30:10"}, "reversed"),
        ({**ITSELF, "thickness": "-4"}, "must not be negative"),
        ({**ITSELF, "material": "../secret.csv"}, "only files in the folder"),
        ({"was": None, "material": "SiO2"}, "needs a material and a thickness"),
    ],
)
def test_a_wrong_text_has_one_sentence_beside_its_field(session, row, said):
    answer = session.answer("layers", {"rows": [AIR, row, SI]})
    assert [bool(text) for text in answer["wrong"]] == [False, True, False]
    assert said in answer["wrong"][1]
    assert "`" not in answer["wrong"][1]
    assert not session.answer("scene", {})["edited"]


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        (None, "an ambient, up to"),
        ([AIR, SI], "at least one layer"),
        ([AIR, {**ITSELF, "was": 3}, SI], "no layer 3"),
        ([{"material": "Au"}, ITSELF, SI], "ambient must not absorb"),
    ],
)
def test_an_impossible_film_is_refused(session, rows, said):
    assert said in session.answer("layers", {"rows": rows})["error"]


def test_a_repeated_group_is_not_torn_apart(tmp_path):
    pair = pl.Group([pl.Layer("TiO2", 60.0), pl.Layer("SiO2", 90.0)], 4)
    mirror = Session(pl.Scene([pl.Layer("MgF2", 50.0), pair], "BK7"), tmp_path, wavelength=NM)
    other = [{**ITSELF, "was": i} for i in (1, 0, 2)]
    assert "repeated group" in mirror.answer("layers", {"rows": [AIR, *other, SI]})["error"]
    whole = [{**ITSELF, "was": i} for i in (1, 2, 0)]
    assert "error" not in mirror.answer("layers", {"rows": [AIR, *whole, SI]})


def test_a_dropped_file_of_n_and_k_is_a_material(session, tmp_path):
    table = "wavelength_nm,n,k\n300,1.8,0.02\n900,1.6,0.01\n"
    assert session.answer("material", sent("paint.csv", table)) == {"word": "paint.csv"}
    rows = [AIR, {**ITSELF, "material": "paint.csv", "thickness": "150"}, SI]
    session.answer("layers", {"rows": rows})
    [curve] = session.answer("view", {"want": ["curves"], "wait": True})["curves"]
    answer = session.answer("recipe", {})
    assert 'material = "paint.csv"' in answer["toml"]
    assert "'paint.csv'" in answer["python"]
    (tmp_path / "paint.csv").write_text(table)  # the file beside the recipe
    again = pl.simulate(film(session, tmp_path), NM).values
    assert np.allclose(curve["y"], again, atol=2e-7)
    bad = session.answer("material", sent("letter.csv", "no numbers\nat all\n"))
    assert bad["error"].startswith("letter.csv")
