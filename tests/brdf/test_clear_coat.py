"""A film's lobe under a clear coat, against the equations in NumPy; its energy, and its limits."""

import jax
import numpy as np
import pytest
import tmm

from pellicle.brdf.albedo import directional_albedo
from pellicle.brdf.directions import direction
from pellicle.brdf.models import model
from tests.directions import unit

COATED = model("clear-coat-film")
EVALUATE = jax.jit(lambda numbers, i, o: COATED(numbers, i, o))
NUMBERS = {
    "thickness": 180.0,
    "n": 2.3,
    "k": 0.02,
    "base_n": 2.7,
    "base_k": 2.8,
    "roughness": 0.3,
    "specular": 0.9,
    "coat_n": 1.5,
    "coat_roughness": 0.06,
    "coat": 0.8,
    "diffuse": 0.03,
}
RGB = (645.0, 525.0, 445.0)


def facets(i, o, alpha):
    """D G₂/(4 cos θ_i cos θ_o) of GGX and Smith (Heitz 2014, eqs. 9, 72 and 99)."""
    h = (i + o) / np.linalg.norm(i + o)
    tilt = np.arccos(min(h[2], 1.0))
    density = 1 / (np.pi * alpha**2 * np.cos(tilt) ** 4 * (1 + np.tan(tilt) ** 2 / alpha**2) ** 2)
    wall = [(np.sqrt(1 + alpha**2 * (1 / v[2] ** 2 - 1)) - 1) / 2 for v in (i, o)]
    return density / (1 + sum(wall)) / (4 * i[2] * o[2])


def face(angle, n):
    return tmm.interface_R("s", 1, n, angle, np.arcsin(np.sin(angle) / n)) / 2 + (
        tmm.interface_R("p", 1, n, angle, np.arcsin(np.sin(angle) / n)) / 2
    )


def by_hand(at_i, at_o, p):
    i, o = unit(*at_i), unit(*at_o)
    n = p["coat_n"]
    below = [np.array([v[0] / n, v[1] / n, np.sqrt(1 - (1 - v[2] ** 2) / n**2)]) for v in (i, o)]
    passed = np.prod([1 - face(np.deg2rad(at[0]), n) for at in (at_i, at_o)]) / n**2
    inner = np.arccos(np.linalg.norm(sum(below)) / 2)
    media = [n, p["n"] + 1j * p["k"], p["base_n"] + 1j * p["base_k"]]
    film = [tmm.unpolarized_RT(media, [np.inf, p["thickness"], np.inf], inner, x)["R"] for x in RGB]
    lobe = p["specular"] * passed * facets(*below, p["roughness"]) * np.array(film)
    outer = np.arccos(np.linalg.norm(i + o) / 2)
    return lobe + p["coat"] * face(outer, n) * facets(i, o, p["coat_roughness"]) + p["diffuse"]


@pytest.mark.parametrize(
    ("i", "o"), [((30, 0), (30, 180)), ((50, 20), (35, 190)), ((5, 0), (75, 90)), ((60, 0), (40, 10))]
)
def test_both_lobes_agree_with_the_equations(i, o):
    found = EVALUATE(NUMBERS, direction(*map(float, i)), direction(*map(float, o)))
    np.testing.assert_allclose(found, by_hand(i, o, NUMBERS), rtol=1e-6)


def test_light_and_eye_may_be_exchanged():
    i, o = direction(50.0, 20.0), direction(35.0, 190.0)
    np.testing.assert_allclose(EVALUATE(NUMBERS, i, o), EVALUATE(NUMBERS, o, i), rtol=1e-9)


def test_a_perfect_metal_under_a_coat_returns_what_the_face_lets_pass_twice():
    """All light that enters meets a mirror of narrow facets: F + (1 − F)².

    The tails of the facets' slopes send some to the critical angle, 1 % at 45 degrees where α is 0.02.
    """
    numbers = {**NUMBERS, "base_n": 0.001, "base_k": 50.0, "thickness": 0.0, "k": 0.0, "diffuse": 0.0}
    numbers |= {"roughness": 0.004, "coat_roughness": 0.004, "specular": 1.0, "coat": 1.0}
    albedo = jax.jit(lambda theta: directional_albedo(COATED, numbers, theta)[1])
    for theta in (0.0, 45.0):
        reflected = face(np.deg2rad(theta), 1.5)
        assert float(albedo(theta)) == pytest.approx(reflected + (1 - reflected) ** 2, abs=4e-3)
