"""Groups of repeated layers: against tmm and against the layers written out; recipes both ways."""

from pathlib import Path

import jax
import numpy as np
import pytest

import pellicle as pl
from pellicle.effects.film_plan import exact
from pellicle.errors import UsageError
from pellicle.fitting.film.parameters import parameters
from pellicle.forward_model.film_signal import build, tabulated
from pellicle.recipes.python_text import python_text
from pellicle.recipes.write import recipe_text
from pellicle.scene.film import with_wavelength
from pellicle.scene.free import insert
from pellicle.scene.groups import written_out

from .. import by_tmm

NM = np.linspace(450.0, 750.0, 13)
HIGH, LOW, CAP, FOOT, GLASS = 2.3 + 0.002j, 1.46, 1.38, 1.6 + 0.1j, 1.52
ANGLE = 50.0


def mirror(repeat: int, drift: float | pl.Free | None = None, signal: str = "R", **more) -> pl.Scene:
    pair = [pl.Layer(HIGH, 60.0, "high", drift=drift, **more), pl.Layer(LOW, 94.0)]
    layers = [pl.Layer(CAP, 100.0), pl.Group(pair, repeat), pl.Layer(FOOT, 30.0)]
    return pl.Scene(layers, GLASS, light=pl.Light(NM, ANGLE, signal))


def values(scene: pl.Scene) -> np.ndarray:
    return np.asarray(pl.simulate(scene, NM).values)


@pytest.mark.parametrize(("repeat", "drift", "signal"), [(1, None, "R"), (13, None, "T"), (100, 0.05, "R")])
def test_group_equals_all_layers_by_tmm(repeat, drift, signal):
    change = (drift or 0.0) * (np.linspace(-0.5, 0.5, repeat) if repeat > 1 else np.zeros(1))
    depths = [100.0, *(d for x in change for d in (60.0 * (1 + x), 94.0)), 30.0]
    indices = [1.0, CAP, *[HIGH, LOW] * repeat, FOOT, GLASS]
    expected = by_tmm.films("sp", NM, indices, depths, ANGLE, signal)
    np.testing.assert_allclose(values(mirror(repeat, drift, signal)), expected, rtol=1e-11)


@pytest.mark.parametrize("more", [{"roughness": 2.0}, {"thickness_spread": 0.5}])
def test_face_is_rough_in_every_repeat_and_thickness_uneven_in_all_together(more):
    group = mirror(3, **more)
    if "roughness" in more:
        apart = pl.Scene(list(written_out(group.layers)), GLASS, light=group.light)
        np.testing.assert_allclose(values(group), values(apart), rtol=1e-12)
        return
    nodes, weights = np.polynomial.hermite_e.hermegauss(15)
    expected = 0.0
    for node, weight in zip(nodes, weights / weights.sum(), strict=True):
        depths = [100.0, *[60.0 + 0.5 * node, 94.0] * 3, 30.0]
        one = by_tmm.films("sp", NM, [1.0, CAP, *[HIGH, LOW] * 3, FOOT, GLASS], depths, ANGLE)
        expected = expected + weight * one
    np.testing.assert_allclose(values(group), expected, atol=1e-8)


@pytest.mark.parametrize("drifts", [True, False])
def test_slopes_are_those_of_finite_differences_by_tmm(drifts):
    repeat, at = 13, np.array([60.0, 94.0, 0.04])

    def by_other_code(x):
        change = x[2] * np.linspace(-0.5, 0.5, repeat)
        depths = [d for j in change for d in (x[0] * (1 + j), x[1])]
        return by_tmm.films("sp", NM, [1.0, *[HIGH, LOW] * repeat, GLASS], depths, ANGLE)

    drift = pl.Free(-0.1, 0.1, start=at[2]) if drifts else None
    at = at if drifts else at * [1, 1, 0]
    pair = [pl.Layer(HIGH, pl.Free(50, 70, start=60.0), drift=drift), pl.Layer(LOW, pl.Free(90, 100))]
    scene = pl.Scene(pl.Group(pair, repeat), GLASS, light=pl.Light(NM, ANGLE))
    # in the order of the free numbers of the scene: thickness and drift of the first layer, then the second
    order = [0, 2, 1] if drifts else [0, 1]
    with jax.enable_x64(True):
        fixed, simulate = tabulated(scene), build(exact(scene).static_key)
        slope = jax.jit(jax.jacfwd(lambda v: simulate(insert(fixed, v))))([float(at[i]) for i in order])
    for i, got in zip(order, slope, strict=True):
        step = np.eye(3)[i] * (1e-6 if i == 2 else 1e-4)
        expected = (by_other_code(at + step) - by_other_code(at - step)) / (2 * step[i])
        np.testing.assert_allclose(got, expected, atol=2e-6 * np.max(np.abs(expected)))


@pytest.mark.parametrize("drift", [None, 0.05])
def test_program_does_not_grow_with_the_number_of_repeats(drift):
    def lines(repeat):
        scene = mirror(repeat, drift)
        program = jax.jit(build(exact(scene).static_key)).lower(with_wavelength(tabulated(scene), NM))
        return program.as_text().count("\n")

    assert lines(1000) <= 1.02 * lines(10)


RECIPE = """
[scene]
substrate = 1.52

[[scene.layer]]
name = "cap"
material = 1.38
thickness = 100

[[scene.layer]]
material = "1.6+0.1j"
thickness = 30

[[scene.group]]
repeat = 12
after = "cap"

[[scene.group.layer]]
name = "high"
material = 2.3
thickness = { lower = 50, upper = 70 }
drift = { lower = -0.1, upper = 0.1 }

[[scene.group.layer]]
material = 1.46
thickness = 94

[[scene.group]]
repeat = 3

[[scene.group.layer]]
material = 2.3
thickness = 60

[[scene.group.layer]]
material = 1.46
thickness = 90
"""


def test_recipe_has_groups_among_layers(tmp_path):
    path = tmp_path / "mirror.toml"
    path.write_text(RECIPE)
    scene = pl.read_recipe(path).scene()
    found = [(x.material.n, x.repeats) for x in scene.layers]
    assert found == [(1.38, 1), (2.3, 12), (1.46, 12), (1.6, 1), (2.3, 3), (1.46, 3)]
    again = tmp_path / "again.toml"
    again.write_text(recipe_text(scene, tmp_path))
    assert pl.read_recipe(again).scene().layers == scene.layers
    assert eval(python_text(scene), {"pl": pl}).layers == scene.layers
    names = [p.name for p in parameters(scene)]
    assert names == ["high.thickness", "high.drift"]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (('after = "cap"', 'after = "cab"'), "no layer is named 'cab'"),
        (('after = "cap"', "after = 3"), "there are 2"),
        (("repeat = 12", "repeat = 0"), "repeat must be 1 to"),
        (("drift = { lower = -0.1, upper = 0.1 }", "drift = 2"), "between -2 and 2"),
        (('material = "1.6+0.1j"\n', "material = 1.6\ndrift = 0.1\n"), "layer in a group"),
        (("material = 1.46\nthickness = 94", "plate_mm = 1\nmaterial = 1.46"), "no plates"),
    ],
)
def test_recipe_refuses_wrong_groups(tmp_path, change, words):
    path = tmp_path / "mirror.toml"
    path.write_text(RECIPE.replace(*change))
    with pytest.raises(ValueError, match=words):
        pl.read_recipe(path).scene()


def test_example_of_the_docs():
    path = Path(__file__).parents[2] / "docs" / "examples" / "bragg_mirror.toml"
    layers = pl.read_recipe(path).scene().layers
    assert [(x.name, x.repeats) for x in layers] == [("cap", 1), ("high", 20), ("low", 20), ("foot", 1)]


def test_group_of_one_layer_and_scene_without_layers_are_refused(tmp_path):
    with pytest.raises(UsageError, match="two or more"):
        pl.Group([pl.Layer(1.5, 10.0)], 3)
    path = tmp_path / "bare.toml"
    path.write_text("[scene]\nsubstrate = 1.52\n")
    with pytest.raises(ValueError, match=r"scene\.layer is missing"):
        pl.read_recipe(path)


@pytest.mark.slow
def test_depth_profile_lists_every_repeat():
    profile = pl.depth_profile(mirror(3, 0.05), at=[600.0], wavelength=[600.0])
    apart = pl.Scene(list(written_out(mirror(3, 0.05).layers)), GLASS, light=pl.Light(angle=ANGLE))
    assert len(profile.media) == len(apart.layers) == 8
    np.testing.assert_allclose(profile.R + profile.T + profile.absorptance.sum(0), 1.0, atol=1e-9)
    faces = [x[1] for x in profile.sections[0].layers]
    np.testing.assert_allclose(np.diff(faces)[:-1], [x.thickness for x in apart.layers[:-2]])
