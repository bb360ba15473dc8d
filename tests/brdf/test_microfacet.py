"""Microfacets under a clear coat, and light reflected more than once: equations, energy, limits."""

import jax
import numpy as np
import pytest
import tmm

import pellicle as pl
from pellicle.brdf.albedo import directional_albedo
from pellicle.brdf.directions import direction
from pellicle.brdf.models import model
from pellicle.effects.surface_plan import exact
from pellicle.scene.surface import Surface, surface_view
from pellicle.simulation.brdf import default_directions

from ..by_tmm import films
from ..directions import unit

COATED = model("clear-coat-film")
EVALUATE = jax.jit(lambda numbers, i, o: COATED(numbers, i, o))
NUMBERS = {"thickness": 180.0, "n": 2.3, "k": 0.02, "base_n": 2.7, "base_k": 2.8, "diffuse": 0.03}
NUMBERS |= {"roughness": 0.3, "specular": 0.9, "coat_n": 1.5, "coat_roughness": 0.06, "coat": 0.8}
RGB = (645.0, 525.0, 445.0)


def facets(i, o, alpha):
    """D G₂/(4 cos θ_i cos θ_o) of GGX and Smith (Heitz 2014, eqs. 9, 72 and 99)."""
    h = (i + o) / np.linalg.norm(i + o)
    tilt = np.arccos(min(h[2], 1.0))
    density = 1 / (np.pi * alpha**2 * np.cos(tilt) ** 4 * (1 + np.tan(tilt) ** 2 / alpha**2) ** 2)
    wall = [(np.sqrt(1 + alpha**2 * (1 / v[2] ** 2 - 1)) - 1) / 2 for v in (i, o)]
    return density / (1 + sum(wall)) / (4 * i[2] * o[2])


def face(angle, n):
    return np.mean([tmm.interface_R(x, 1, n, angle, np.arcsin(np.sin(angle) / n)) for x in "sp"])


def by_hand(at_i, at_o, p):
    i, o = unit(*at_i), unit(*at_o)
    n = p["coat_n"]
    below = [np.array([v[0] / n, v[1] / n, np.sqrt(1 - (1 - v[2] ** 2) / n**2)]) for v in (i, o)]
    passed = np.prod([1 - face(np.deg2rad(at[0]), n) for at in (at_i, at_o)]) / n**2
    inner = np.arccos(np.linalg.norm(sum(below)) / 2)
    media = [n, p["n"] + 1j * p["k"], p["base_n"] + 1j * p["base_k"]]
    film = films("sp", RGB, media, [p["thickness"]], np.rad2deg(inner))
    lobe = p["specular"] * passed * facets(*below, p["roughness"]) * film
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


FACETS = model("microfacet-film")
WHITE = {"thickness": 0.0, "n": 1.5, "base_n": 1e-4, "base_k": 100.0, "specular": 1.0, "wavelengths": [550.0]}


@pytest.fixture(scope="module")
def albedo():
    """Albedo of rough facets that reflect everything, by roughness, angle and share of the further light."""

    def function(alpha, theta, share):
        rough = {**WHITE, "roughness": alpha, "multiple_scattering": share}
        return directional_albedo(FACETS, rough, theta)[0]

    with jax.enable_x64(True):
        yield jax.jit(function)


@pytest.mark.parametrize("alpha", [0.05, 0.1, 0.2, 0.35, 0.5, 0.7, 1.0])
def test_a_white_surface_returns_all_light(albedo, alpha):
    """With one reflection it loses 0.3 to 69 %."""
    for theta in (0.0, 40.0, 60.0, 80.0):
        assert float(albedo(alpha, theta, 1.0)) == pytest.approx(1, abs=2e-3), theta
    assert float(albedo(alpha, 0.0, 0.0)) < 0.998


def test_nearly_smooth_facets_gain_nothing(albedo):
    assert float(albedo(0.003, 30.0, 1.0)) == pytest.approx(float(albedo(0.003, 30.0, 0.0)), abs=1e-3)


def test_the_further_light_has_the_colour_of_all_reflections():
    """F̄² Ē/(1 − F̄(1 − Ē)), with F̄ by tmm over the hemisphere, in proportion to that of a white surface."""
    steel = {"thickness": 40.0, "n": 2.9, "base_n": 2.7, "base_k": 2.8, "specular": 1.0, "roughness": 0.6}
    i, o = direction(25.0, 0.0), direction(55.0, 130.0)

    @jax.jit
    def further(numbers):
        both, once = (FACETS({**numbers, "multiple_scattering": k}, i, o) for k in (1.0, 0.0))
        return both - once

    with jax.enable_x64(True):
        found = further({**steel, "wavelengths": np.array([645.0, 445.0])})
        white = further({**WHITE, "roughness": 0.6, "wavelengths": np.array([645.0, 445.0])})
    node, weight = np.polynomial.legendre.leggauss(12)
    cosine = 0.5 * (node + 1)
    lost = 1 - 0.6307  # Ē at α = 0.6, by an average over visible normals (Heitz, JCGT 2018)
    for channel, nm in enumerate((645.0, 445.0)):
        each = films("sp", nm, [1, 2.9, 2.7 + 2.8j], [40.0], np.rad2deg(np.arccos(cosine)))
        mean = np.sum(weight * cosine * each)
        expected = mean**2 * (1 - lost) / (1 - mean * lost)
        assert float(found[channel] / white[channel]) == pytest.approx(expected, rel=0.02)


def test_reciprocity_of_all_reflections():
    rough = {**FACETS.defaults(), "roughness": 0.8, "multiple_scattering": 1.0}
    i, o = direction(25.0, 0.0), direction(70.0, 130.0)
    brdf = jax.jit(lambda i, o: FACETS(rough, i, o))
    np.testing.assert_allclose(brdf(i, o), brdf(o, i), rtol=1e-5)


def test_a_surface_asks_for_it_and_a_plan_says_what_it_changes(tmp_path):
    rough, at = {"roughness": 0.6, "thickness": 100.0}, default_directions(64)
    off = exact(surface_view(Surface("microfacet-film", rough), at)).row("multiple-scattering")
    assert not off.on
    assert "not asked for" in off.why
    (tmp_path / "rough.toml").write_text(
        '[scene.surface]\nmodel = "clear-coat-film"\nroughness = 0.6\nmultiple_scattering = true\n'
    )
    coated = pl.read_recipe(tmp_path / "rough.toml").scene()
    assert exact(surface_view(coated, at)).on("multiple-scattering")
    every = pl.simulate(Surface("microfacet-film", {**rough, "multiple_scattering": 1}), directions=at).values
    assert np.all(every > pl.simulate(Surface("microfacet-film", rough), directions=at).values)
