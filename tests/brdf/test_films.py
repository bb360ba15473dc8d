"""Microfacets and Blinn-Phong under a film, against tmm and quadrature; the models by name."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from pellicle.brdf import film_colour, lobes
from pellicle.brdf.albedo import directional_albedo
from pellicle.brdf.directions import cosine_to_half, direction
from pellicle.brdf.models import MODELS, PRESETS, RGB, model

from ..by_tmm import films
from ..differences import derivative, with_slopes

RNG = np.random.default_rng(2)
N = 60
I = direction(RNG.uniform(0, 88, N), RNG.uniform(-180, 180, N))
O = direction(RNG.uniform(0, 88, N), RNG.uniform(-180, 180, N))
STEEL = PRESETS["tempered steel"][1]
SENSOR = {"wavelengths": np.array(RGB)}
FACETS = jax.jit(lambda s, i, o: model("microfacet-film")(s, i, o))
exact = jax.jit(film_colour.exact)


def test_film_colour_equals_tmm_at_the_facet():
    colour = exact({**STEEL, **SENSOR, "k": 0.1}, I, O)
    for row in range(0, N, 10):
        angle = np.rad2deg(np.arccos(float(cosine_to_half(I[row], O[row]))))
        expected = films("sp", RGB, [1, 2.9 + 0.1j, 2.7 + 2.8j], [40.0], angle)
        np.testing.assert_allclose(colour[row], expected, rtol=1e-9)


@pytest.mark.parametrize("thickest", [100, 1500])
def test_nodes_agree_with_the_exact_film(thickest):
    """Within the 1e-4 that `node_count` promises, for random films and bases within their bounds."""
    chebyshev = jax.jit(film_colour.chebyshev(thickest))
    for _ in range(60):
        film = {
            "thickness": RNG.uniform(0.5, 1) * thickest,
            "n": RNG.uniform(1.1, 3),
            "k": RNG.choice([0.0, RNG.uniform(0, 1)]),
            "base_n": RNG.uniform(1.05, 4),
            "base_k": RNG.choice([0.0, RNG.uniform(0, 6)]),
            **SENSOR,
        }
        np.testing.assert_allclose(chebyshev(film, I, O), exact(film, I, O), atol=1e-4)


def test_thinner_films_take_fewer_nodes():
    assert [film_colour.node_count(d) for d in (0, 500, 1500)] == [24, 56, 112]
    steel = model("microfacet-film")
    assert steel.for_thickness_up_to(100).evaluate is not steel.evaluate
    assert model("granier-heidrich").for_thickness_up_to(100) is model("granier-heidrich")


def test_weights_integrate_over_a_sensor():
    """Two wavelengths of equal weight give the mean of their reflectances."""
    wavelengths = {"wavelengths": np.array([500.0, 600.0])}
    each = exact({**STEEL, **wavelengths}, I, O)
    weighted = exact({**STEEL, **wavelengths, "weights": np.full((2, 3), 0.5)}, I, O)
    np.testing.assert_allclose(weighted, np.repeat(each.mean(-1)[:, None], 3, 1), rtol=1e-12)


def test_microfacets_multiply_lobe_and_colour():
    s = {**STEEL, "specular": 2.0, "diffuse": 0.3}
    expected = 2 * lobes.microfacets(I, O, 0.2)[:, None] * exact({**s, **SENSOR}, I, O) + 0.3
    np.testing.assert_allclose(FACETS(s, I, O), expected, rtol=1e-6)


def test_microfacets_reflect_at_most_as_much_as_the_film():
    """On a perfect metal, which reflects everything, only light between facets is lost."""
    mirror = {**STEEL, "base_n": 0.001, "base_k": 50.0, "roughness": 0.05}
    albedo = np.asarray(jax.jit(lambda s: directional_albedo(FACETS, s, 30.0, rings=128, spokes=256))(mirror))
    assert np.all((albedo > 0.985) & (albedo < 1.001))


SHADER = {"ambient_n": 1.0, "n": 1.5, "base_n": 2.0, "thickness": 250.0, "wavelengths": np.array([550.0])}


@pytest.mark.slow
def test_the_published_shader_counts_the_phase_twice():
    """0.0942 as published, 0.0239 by tmm."""
    up = jnp.array(0.0)
    assert float(film_colour.published_shader(SHADER, up)[0]) == pytest.approx(0.0942, abs=5e-5)
    [truth] = films("s", 550.0, [1, 1.5, 2], [250.0])
    assert truth == pytest.approx(0.0239, abs=5e-5)
    assert float(film_colour.reflectance(SHADER, up)[0]) == pytest.approx(truth, rel=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("angle", [0.0, 0.9])
def test_phase_average_is_the_mean_over_a_period(angle):
    cosine = np.sqrt(1 - np.sin(angle) ** 2 / 1.5**2)
    heights = np.arange(200) / 200 * 550 / (2 * 1.5 * cosine)
    angles = jnp.full(200, angle)
    mean = film_colour.reflectance({**SHADER, "thickness": heights}, angles).mean()
    average = film_colour.phase_average(SHADER, jnp.array(angle))
    assert float(average[0]) == pytest.approx(float(mean), rel=1e-12)


@pytest.mark.slow
def test_a_film_without_interference_is_the_mean_over_its_phase():
    period = 550 / 2 / np.sqrt(2.2**2 - np.sin(0.6) ** 2)
    film = {**STEEL, "n": 2.2, "wavelengths": np.array([550.0])}
    heights = np.arange(64) / 64 * period
    waves = film_colour.reflectance({**film, "thickness": heights}, jnp.full(64, 0.6)).mean()
    flat = film_colour.without_interference(film, jnp.array(0.6))
    assert float(flat[0]) == pytest.approx(float(waves), rel=1e-12)


def test_an_opaque_film_reflects_like_one_face():
    deep = {**STEEL, "n": 2.2, "k": 0.2, "thickness": 1e5, "wavelengths": np.array([550.0])}
    [truth] = films("sp", 550.0, [1, 2.2 + 0.2j, 1], [1e5], np.rad2deg(0.6))
    result = film_colour.without_interference(deep, jnp.array(0.6))
    assert float(result[0]) == pytest.approx(truth, rel=1e-9)


def test_total_reflection_is_total():
    glass = {**SHADER, "ambient_n": 1.5, "n": 1.3, "base_n": 1.0}
    for reflectance in (film_colour.reflectance, film_colour.published_shader, film_colour.phase_average):
        assert float(reflectance(glass, jnp.array(1.2))[0]) == pytest.approx(1, rel=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("name", MODELS)
def test_every_model_has_the_slopes_of_finite_differences(name):
    """In every parameter, near the defaults; finite at grazing light and 0 below the horizon; float32 in
    gives float32 out."""
    m = model(name)
    i = direction(np.array([2.0, 30.0, 50.0, 90.0, 100.0]), 0.0)
    o = direction(np.array([25.0, 30.0, 40.0, 90.0, 10.0]), np.array([90.0, 180.0, 170.0, 180.0, 180.0]))
    at = {p.key: np.asarray(p.value) + 1e-3 * (p.upper - p.lower) for p in m.parameters}
    both = with_slopes(lambda p: m(p, i, o))
    slope = both(at)[0]

    def value(p):
        return both(p)[1]

    assert value(at).shape == (5, 3)
    assert np.all(value(at)[4] == 0)
    assert np.all(value(at) >= 0)
    assert set(slope) == {p.key for p in m.parameters}
    for p in m.parameters:
        assert p.lower <= np.min(p.value) <= np.max(p.value) <= p.upper
        found = np.asarray(slope[p.key])
        assert np.all(np.isfinite(found)), p.key
        step = 1e-6 * (p.upper - p.lower)
        expected = derivative(lambda x, key=p.key: value({**at, key: x}), at[p.key], step)[:3]
        found = found.reshape(5, 3, -1).sum(axis=-1)[:3]
        np.testing.assert_allclose(
            found, expected, rtol=1e-4, atol=1e-6 * np.max(np.abs(expected)), err_msg=p.key
        )
    narrow = {key: np.asarray(x, np.float32) for key, x in m.defaults().items()}
    directions = (v.astype(np.float32) for v in (i, o))
    assert jax.eval_shape(lambda *a: m(*a), narrow, *directions).dtype == np.float32


@pytest.mark.parametrize("name", PRESETS)
def test_presets_are_complete(name):
    which, parameters = PRESETS[name]
    assert set(parameters) == {p.key for p in model(which).parameters}


def test_an_unknown_name_suggests_the_nearest(refuses):
    refuses(ValueError, "did you mean 'microfacet-film'", model, "microfacet-fil")
