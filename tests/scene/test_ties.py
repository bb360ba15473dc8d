"""Tied numbers: expressions, their range and unit, binding by name, and values in a scene."""

import math

import jax
import numpy as np
import pytest

import pellicle as pl
from pellicle.effects.differences import design
from pellicle.errors import UsageError
from pellicle.recipes.write import recipe_text
from pellicle.scene import expressions
from pellicle.scene.free import free_leaves, insert, start_values


def stack(foot, core=None) -> pl.Scene:
    core = pl.Free(50.0, 100.0) if core is None else core
    return pl.Scene(
        [pl.Layer(1.4, pl.Free(2.0, 10.0), "top"), pl.Layer(1.33, core, "core"), pl.Layer(1.4, foot, "foot")],
        "air",
    )


CASES = {
    "2 * a + 1.5": lambda a, b: 2 * a + 1.5,
    "-(a - b) / 3": lambda a, b: -(a - b) / 3,
    "a ** 2 - a * b": lambda a, b: a * a - a * b,
    "b ** -1": lambda a, b: 1 / b,
    "b ** 0.5 * 1e1": lambda a, b: 10 * math.sqrt(b),
    "'a' / 'b'": lambda a, b: a / b,
}


@pytest.mark.parametrize("text", CASES)
def test_value_range_and_derivative(text):
    tree, bounds = expressions.parsed(text), {"a": (-2.0, 3.0), "b": (0.5, 4.0)}
    rng = np.random.default_rng(0)
    points = np.stack([rng.uniform(*bounds[x], 200) for x in "ab"], axis=1)
    points = np.vstack([points, [(x, y) for x in bounds["a"] for y in bounds["b"]]])
    values = [expressions.value(tree, {"a": a, "b": b}.__getitem__) for a, b in points]
    np.testing.assert_allclose(values, [CASES[text](a, b) for a, b in points], rtol=1e-14, atol=1e-14)
    lower, upper = expressions.interval(tree, bounds.__getitem__)
    assert lower <= min(values) + 1e-12
    assert max(values) - 1e-12 <= upper
    with jax.enable_x64(True):
        slope = jax.grad(lambda a: expressions.value(tree, {"a": a, "b": 1.3}.__getitem__) + 0.0)(-0.7)
    step = 1e-6
    difference = (CASES[text](-0.7 + step, 1.3) - CASES[text](-0.7 - step, 1.3)) / (2 * step)
    assert float(slope) == pytest.approx(difference, abs=1e-8)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("top.thicknes", "did you mean 'top.thickness'"),
        ("2 nm", "neither a number nor an expression"),
        ("2 * nm", "have no unit, leave out nm"),
        ("exp(1)", "'exp(1)' cannot stand"),
        ("__import__('os').name", "cannot stand"),
        ("top.n", "foot.thickness in nm"),
        ("top.thickness + top.n", "adds `top.thickness` (nm) and `top.n` (without unit)"),
        ("top.thickness ** top.thickness", "an exponent has no unit"),
        ("foot.thickness + 1", "foot.thickness → foot.thickness"),
        ("60 - core.thickness", "goes from -40 to 10"),
        ("top.thickness / (core.n - 1.33)", "divides by what may be 0"),
        ("top.thickness ** 400 / top.thickness ** 399", "too large"),
        ("top.thickness * 1e400", "foot.thickness is tied to 'top.thickness * 1e400', which is not finite"),
        ("1" * 2000, "at most 1000 characters"),
    ],
)
def test_refused_in_one_sentence(text, said):
    with pytest.raises(UsageError) as caught:
        stack(pl.Tied(text))
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_circle_of_two():
    with pytest.raises(UsageError, match=r"core\.thickness → foot\.thickness → core\.thickness"):
        stack(pl.Tied("core.thickness"), pl.Tied("foot.thickness"))


def test_chain_follows_the_free_numbers():
    scene = stack(pl.Tied("2 * core.thickness + top.thickness"), pl.Tied("3 * top.thickness"))
    assert len(free_leaves(scene)) == 1
    assert [x.thickness for x in insert(scene, [4.0]).layers] == [4.0, 12.0, 28.0]
    foot = scene.layers[2].thickness
    assert (foot.lower, foot.upper, foot.start) == (14.0, 70.0, 42.0)


def test_fixed_numbers_and_media_may_be_named():
    material = pl.dispersion.Constant(pl.Tied("1.1 * substrate.n"))
    scene = pl.Scene(pl.Layer(material, pl.Tied("100 + 50")), 1.5)
    assert insert(scene, []).layers[0].material.n == pytest.approx(1.65)
    assert insert(scene, []).layers[0].thickness == 150.0


def test_a_part_of_a_scene_has_the_tied_number_within_its_bounds():
    """The media of a plan are looked at alone, without what they are tied to."""
    scene = pl.Scene(
        [
            pl.Layer(pl.Free(1.4, 1.6), 100.0, "a"),
            pl.Layer(pl.dispersion.Constant(pl.Tied("a.n / 2 + 1")), 80.0, "b"),
        ],
        1.5,
    )
    medium = scene.layers[1].material
    assert [(x.lower, x.upper) for _, x in free_leaves(medium)] == [(1.7, 1.8)]
    assert insert(medium, [1.75]).n == 1.75
    assert design(scene).shape[1] == 1


def test_simulation_is_that_of_the_numbers():
    wavelength = np.arange(450.0, 650.0, 20.0)
    tied = pl.simulate(stack(pl.Tied("2 * top.thickness + 1.5")), wavelength)
    plain = pl.simulate(stack(13.5), wavelength)
    np.testing.assert_array_equal(tied.values, plain.values)


def test_written_and_read_again(tmp_path):
    scene = stack(pl.Tied("top.thickness + 1"))
    text = recipe_text(scene, tmp_path)
    assert 'thickness = "top.thickness + 1"' in text
    (tmp_path / "r.toml").write_text(text)
    again = pl.read_recipe(tmp_path / "r.toml").scene()
    assert again.layers[2].thickness == scene.layers[2].thickness
    np.testing.assert_array_equal(start_values(again), start_values(scene))
