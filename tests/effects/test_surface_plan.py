"""What a surface calls for, and what a tolerance leaves out: within its bound, with no gradient lost."""

import jax
import numpy as np
import pytest

from pellicle.brdf.models import MODELS
from pellicle.colour import sensor
from pellicle.effects import surface_plan
from pellicle.effects.differences import gradients
from pellicle.effects.removal import SAFETY
from pellicle.effects.surface_plan import FLOOR, REMOVABLE, exact
from pellicle.errors import UsageError
from pellicle.forward_model.surface_signal import build
from pellicle.scene.free import Free, insert, start_values
from pellicle.scene.surface import Surface, surface_view
from pellicle.simulation.brdf import Directions, default_directions

LOOKED = default_directions(96)
TOLERANCE = 1e-3

FILM = {"thickness": Free(40.0, 300.0), "n": 1.5}
FAINT = {"k": 1e-6, "base_n": 1.9, "base_k": 0, "diffuse": 1e-7}
FACETS = Surface("microfacet-film", FILM | FAINT)
LOBES = Surface("granier-heidrich-reciprocal", FILM | {"deviation": 1e-4, "azimuth": 30.0, "diffuse": 0.3})
GONE = {
    "facets": (FACETS, {"absorption", "diffuse", "precision"}),
    "lobes": (LOBES, {"deviation", "precision"}),
}


def rows(surface, looked=LOOKED):
    return {row.effect: row for row in exact(surface_view(surface, looked)).rows}


def test_effects_are_judged_from_bounds_and_not_from_values():
    found = rows(Surface("granier-heidrich", {"deviation": Free(0.0, 5.0, start=0.0), "diffuse": 0.0}))
    assert {name: row.on for name, row in found.items()} == {
        **{"spectral-sampling": True, "bands": False, "roughness": True, "deviation": True},
        **{"diffuse": False, "coherence": True, "precision": True},
    }
    film = rows(Surface("microfacet-film", {"k": Free(0.0, 1.0, start=0.0)}))
    assert film["absorption"].why == "the film's extinction is free"
    assert film["tunnelling"].on is False
    assert film["polarisation"].on
    assert not rows(Surface("microfacet-film", {}))["absorption"].on
    assert rows(Surface("microfacet-film", {"n": Free(0.9, 2.0)}))["tunnelling"].on
    assert not rows(Surface("granier-heidrich-diffuse", {}))["roughness"].on
    assert not rows(Surface("granier-heidrich-diffuse", {}, (550.0,)))["spectral-sampling"].on


def test_bands_are_integrals_and_their_angles_nodes():
    eye, film = sensor("1931", "D65"), {"thickness": Free(100.0, 500.0), "n": 1.5, "diffuse": 0.0}
    plan = exact(surface_view(Surface("microfacet-film", film, sensor=eye), LOOKED))
    assert plan.on("bands")
    assert 0 < plan.row("bands").count < len(eye.wavelength) / 2
    assert 0 < plan.row("oblique").count < len(LOOKED.theta_i)
    assert rows(Surface("microfacet-film", film))["oblique"].count == 0
    bent = Surface("microfacet-film", {**film, "n": Free(0.9, 1.5)}, sensor=eye)
    assert rows(bent)["oblique"].count == 0  # a polynomial is no good at the edge of total reflection


def test_light_that_returns_has_no_angle():
    theta, phi = np.linspace(0, 70, 8), np.zeros(8)
    found = rows(Surface("microfacet-film", {}), Directions(theta, phi, theta, phi))
    assert [found[name].on for name in ("oblique", "polarisation", "tunnelling")] == [False] * 3


COMPOSED = [
    *((name, {}) for name in MODELS),
    ("microfacet-film", {"k": 0.1}),
    ("blinn-phong-film", {"ambient_n": 1.6, "n": 1.3, "base_n": 1.2}),  # totally reflected, and tunnelling
]


@pytest.mark.parametrize(("name", "numbers"), COMPOSED)
def test_what_is_composed_is_the_model(name, numbers):
    """Whatever its effects: the exact plan is the BRDF as its own module computes it."""
    surface = Surface(name, numbers)
    numbers, looked = surface.start_numbers(), surface_view(surface, LOOKED)
    with jax.enable_x64(True):
        expected = jax.jit(surface.brdf.evaluate)(numbers, looked.i, looked.o)
        found = jax.jit(build(exact(looked)))(looked)
    np.testing.assert_allclose(found, expected, rtol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("name", GONE)
def test_what_changes_little_is_left_out_within_the_bound(name):
    """At thicknesses that the plan did not look at; for less work, and with every gradient."""
    surface, effects = GONE[name]
    seen = surface_view(surface, LOOKED)
    plan = surface_plan.plan(seen, TOLERANCE)
    assert {left_out.effect for left_out in plan.left_out} == effects
    assert 0 < plan.error_bound <= TOLERANCE
    points = np.random.default_rng(5).uniform(40.0, 300.0, (64, 1))
    with jax.enable_x64(True):
        ways = [jax.jit(build(each)) for each in (exact(seen), plan.static_key)]
        true, found = (
            np.stack([np.asarray(way(insert(seen, [np.float64(d)]))) for d in points[:, 0]]) for way in ways
        )
        slopes = gradients(plan, seen, points[:16], build)
        numbers = insert(seen, start_values(seen))
        whole, planned = (way.lower(numbers).cost_analysis()["flops"] for way in ways)
    off = np.abs(found - true) / np.maximum(true, FLOOR)
    assert plan.error_bound / SAFETY / 100 < off.max() <= plan.error_bound
    assert np.all(np.any(slopes != 0, axis=(0, 1)))
    assert planned < whole


FREE = {key: Free(0.0, 1e-9, start=0.0) for key in ("k", "base_k", "diffuse")}


@pytest.mark.parametrize("effect", REMOVABLE)
def test_an_effect_whose_number_is_free_stays(effect):
    """However little it changes: its gradient is what a fit needs."""
    thin = {"thickness": Free(0.0, 1e-6, start=0.0), "specular": Free(0.9, 1.1, start=1.0)}
    tilt = {"deviation": Free(0.0, 1e-9, start=0.0), "n": Free(1.4, 1.5)}
    lobes = effect in ("deviation", "spectral-sampling")
    surface = Surface("granier-heidrich" if lobes else "microfacet-film", thin | (tilt if lobes else FREE))
    kept = surface_plan.alternatives(effect, surface_view(surface, LOOKED))
    assert bool(kept) == (effect in ("oblique", "polarisation", "precision"))


def test_what_is_absent_leaves_no_trace():
    """Fewer primitives, one effect after the other."""

    def primitives(**numbers):
        seen = surface_view(Surface("granier-heidrich-full", numbers), LOOKED)
        return len(jax.make_jaxpr(build(exact(seen)))(seen).eqns)

    surfaces = [{"deviation": x, "diffuse": y} for x, y in ((3.0, 0.1), (0.0, 0.1), (0.0, 0.0))]
    counts = [primitives(**numbers) for numbers in (*surfaces, {"specular": 0.0, "diffuse": 0.1})]
    assert counts == sorted(counts, reverse=True)
    assert len(set(counts)) == 4


def test_a_lobe_that_is_too_weak_goes_with_its_layer():
    """What is left is the diffuse part, in every channel."""
    seen = surface_view(Surface("microfacet-film", {"specular": 1e-9, "diffuse": 0.2}), LOOKED)
    (plan,) = surface_plan.alternatives("roughness", seen)
    assert [row.effect for row in plan.rows if row.on] == ["diffuse", "precision"]
    with jax.enable_x64(True):
        found = jax.jit(build(plan.static_key))(seen)
    np.testing.assert_array_equal(found, np.full((96, 3), 0.2))


def test_nothing_to_compute():
    with pytest.raises(UsageError, match="nothing to compute"):
        surface_view(Surface("granier-heidrich", {"specular": 0.0, "diffuse": 0.0}), LOOKED)
