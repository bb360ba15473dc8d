"""Light reflected more than once between facets: white furnaces, reciprocity, colours by tmm."""

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

FACETS = model("microfacet-film")
WHITE = {"thickness": 0.0, "n": 1.5, "base_n": 1e-4, "base_k": 100.0, "specular": 1.0, "wavelengths": [550.0]}


@pytest.fixture(scope="module")
def albedo():
    """Albedo of rough facets that reflect everything, by roughness, angle and share of the further light."""

    def function(alpha, theta, share):
        return directional_albedo(FACETS, {**WHITE, "roughness": alpha, "multiple_scattering": share}, theta)[
            0
        ]

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
        media = [1, 2.9, 2.7 + 2.8j], [np.inf, 40.0, np.inf]
        each = [tmm.unpolarized_RT(*media, np.arccos(c), nm)["R"] for c in cosine]
        mean = np.sum(weight * cosine * each)
        expected = mean**2 * (1 - lost) / (1 - mean * lost)
        assert float(found[channel] / white[channel]) == pytest.approx(expected, rel=0.02)


def test_light_and_eye_may_be_exchanged():
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
