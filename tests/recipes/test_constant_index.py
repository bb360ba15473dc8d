"""A constant index with free or fixed n and k, wherever a recipe takes a medium."""

import pytest

from pellicle.dispersion.empirical import Constant
from pellicle.fitting.film.parameters import parameters
from pellicle.scene.free import Free

LAYER = '[[scene.layer]]\nmaterial = "SiO2"\nthickness = { lower = 10, upper = 3000 }\n'
BASE = f'[scene]\nsubstrate = "Si"\n{LAYER}'
N, K = "{ lower = 1.5, upper = 2.5 }", "{ lower = 0, upper = 0.5 }"
CONSTANT = f'{{ model = "constant", n = {N}, k = {K} }}'

CLEAR = f'model = "constant", n = {N}'
LINEAR = 'mix = "linear", inclusion = 1.0, fraction = 0.1'


def film(material: str) -> str:
    return BASE.replace('"SiO2"', material)


def test_a_constant_index_of_a_layer(scene):
    """n fixed and k free, or both free; missing keys are n = 1.5 and no absorption."""
    found = lambda text: scene(text).layers[0].material  # noqa: E731
    assert found(film(f'{{ model = "constant", n = 1.8, k = {K} }}')) == Constant(1.8, Free(0, 0.5))
    assert found(film(CONSTANT)) == Constant(Free(1.5, 2.5), Free(0, 0.5))
    assert found(film('{ model = "constant" }')) == Constant(1.5)
    freed = Constant(Free(1.7, 1.9, start=1.9), Free(0, 1, start=0.25, limits=(0, 20)))
    assert found(film(CONSTANT) + 'free = ["n=1.7:1.9", "k"]\n') == freed


@pytest.mark.parametrize(
    ("text", "free"),
    [
        (BASE.replace('"Si"', CONSTANT), ["thickness", "substrate.n", "substrate.k"]),
        (BASE.replace('"Si"', f"{{ material = 1.5, back = {CONSTANT} }}"), ["thickness", "back.n", "back.k"]),
        (BASE.replace("[scene]", f"[scene]\nambient = {{ {CLEAR} }}"), ["thickness", "ambient.n"]),
        (film(f"{{ host = {CONSTANT}, {LINEAR} }}"), ["host.n", "host.k", "thickness"]),
    ],
    ids=["substrate", "back", "ambient", "mixture"],
)
def test_a_constant_index_elsewhere(scene, text, free):
    assert [p.name for p in parameters(scene(text))] == free


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (film(f'{{ model = "constant", k = {K.replace("0,", "-1,")} }}'), "k must not be negative, got -1"),
        (film('{ model = "constant", n = -1.5 }'), "n must not be negative, got -1.5"),
        (film('{ model = "constant", m = 1.5 }'), "constant has no parameter 'm'"),
        (BASE.replace("[scene]", f"[scene]\nambient = {CONSTANT}"), "the ambient must not absorb"),
    ],
)
def test_constant_indices_refused(refused, text, message):
    refused(text, message)


def test_more_free_numbers_than_a_fit_takes(refused):
    knots = [400.0 + 5 * i for i in range(50)]
    spline = f'{{ model = "spline", knots = {knots}, n = {N}, k = {K} }}'
    refused(film(spline), "101 parameters are free, more than the 64 that a fit takes")
