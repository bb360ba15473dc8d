"""What a tolerance leaves out: within the bound it states, never with a gradient, and for less work."""

from dataclasses import replace
from functools import cache

import jax
import numpy as np
import pytest

import pellicle as pl
from pellicle.effects.differences import design, gradients, largest_difference, signals
from pellicle.effects.film_plan import alternatives, full_plan, savings
from pellicle.effects.removal import REMOVABLE, FilmRemoval
from pellicle.forward_model.film_signal import build, tabulated
from pellicle.scene.free import free_leaves, insert, start_values

WAVELENGTH = np.linspace(450.0, 850.0, 7)
FREE = pl.Free(100.0, 400.0)


def scene(layer=1.46, substrate=3.9 + 0.02j, thickness=FREE, instrument=None, **light):
    layers = layer if isinstance(layer, list) else [pl.Layer(layer, thickness)]
    light = {"wavelength": WAVELENGTH} | light
    return pl.Scene(layers, substrate, light=pl.Light(**light), instrument=instrument or pl.Instrument())


GOLD = pl.Layer(0.2 + 3.4j, 500.0, name="gold")
OVER_GOLD = scene([pl.Layer(1.46, FREE), GOLD])
FAINT = scene(
    [pl.Layer(1.46 + 1e-7j, FREE, roughness=0.05)],
    pl.dispersion.Cauchy(1.5, 0.1),
    angle=0.3,
    instrument=pl.Instrument(bandwidth=0.2),
)
ABSORBING_PLATE = scene(substrate=pl.Substrate(1.5 + 1e-3j, "air"))
THICK = scene(thickness=pl.Free(3000, 3300), angle=3.0)
MICROSCOPE = scene(instrument=pl.Instrument(numerical_aperture=0.01))
LEFT_OUT = {
    "faint": (FAINT, {"absorption", "oblique", "roughness", "coherence", "dispersion", "precision"}),
    "absorbing plate": (ABSORBING_PLATE, {"back-face", "precision"}),
    "thick": (THICK, {"polarisation", "precision"}),
    "microscope": (MICROSCOPE, {"angle-spread", "precision"}),
    "over gold": (OVER_GOLD, {"opaque", "precision"}),
}
NAMES = ["over gold", *(pytest.param(x, marks=pytest.mark.slow) for x in LEFT_OUT if x != "over gold")]
TOLERANCE = 1e-3


@cache
def plan_of(name):
    return pl.plan(LEFT_OUT[name][0], TOLERANCE)


@pytest.mark.parametrize("name", NAMES)
def test_what_changes_little_is_left_out(name):
    """With its error told, and less to compute."""
    plan, (thing, effects) = plan_of(name), LEFT_OUT[name]
    assert {left_out.effect for left_out in plan.left_out} == effects
    for effect in effects:
        assert 0 <= plan.row(effect).error_bound <= TOLERANCE
        assert "left out" in plan.row(effect).why
    assert 0 < plan.error_bound <= TOLERANCE
    assert operations(plan, thing) < operations(full_plan(thing), thing)


def operations(plan, thing):
    """Operations of one simulation, as XLA counts them."""
    with jax.enable_x64(True):
        numbers = insert(tabulated(thing), start_values(thing))
        return jax.jit(build(plan.static_key)).lower(numbers).cost_analysis()["flops"]


@pytest.mark.slow
def test_savings_are_measured():
    """Each alternative has an error; one that saves little may seem to save less than nothing."""
    thing = scene(thickness=pl.Free(3000, 3300), instrument=pl.Instrument(bandwidth=20.0))
    found = savings(thing, pl.plan(thing))
    assert set(found.effects) >= {"coherence", "precision"}
    assert found.effects["coherence"].error > 0.01
    assert min(found.exact, found.planned, found.effects["coherence"].seconds) > 0


@pytest.mark.parametrize("name", NAMES)
def test_the_bound_holds_and_no_gradient_is_lost(name):
    """At thicknesses that the plan did not look at."""
    plan, (thing, _) = plan_of(name), LEFT_OUT[name]
    ((_, thickness),) = free_leaves(thing)
    points = np.random.default_rng(2).uniform(thickness.lower, thickness.upper, (160, 1))
    with jax.enable_x64(True):
        whole = tabulated(thing)
        one, other = (signals(p, whole, points, build) for p in (plan, full_plan(thing)))
        slopes = gradients(plan, whole, points[:16], build)
    assert largest_difference(one, other, False) <= plan.error_bound
    assert np.all(np.any(slopes != 0, axis=(0, 1)))


TINY = pl.Free(0, 1e-6, start=0.0)
ALL_FREE = scene(
    [pl.Layer(pl.dispersion.Constant(1.46, TINY), FREE, roughness=TINY)],
    pl.Substrate(pl.dispersion.Cauchy(1.5, TINY), "air", plate_mm=FREE),
    angle=TINY,
    instrument=pl.Instrument(bandwidth=TINY),
)


@pytest.mark.parametrize("effect", [effect for effect in REMOVABLE if effect != "precision"])
def test_an_effect_with_a_free_parameter_is_not_even_tried(effect):
    """However little it changes: its gradient is what a fit needs."""
    cone = pl.Instrument(bandwidth=TINY, angle_spread=TINY)
    thing = replace(ALL_FREE, instrument=cone) if effect == "angle-spread" else ALL_FREE
    assert alternatives(effect, thing) == []


@pytest.mark.slow
def test_an_opaque_layer_that_may_be_thin_stays_transparent():
    thin = scene([pl.Layer(1.46, 100.0), pl.Layer(0.2 + 3.4j, pl.Free(400.0, 900.0))])
    assert not pl.plan(thin, 1e-2).on("opaque")
    row = plan_of("over gold").row("opaque")
    assert row.on
    assert "gold lets nothing through" in row.why


def test_no_tolerance_is_an_exact_plan():
    assert pl.plan(OVER_GOLD).left_out == ()
    assert pl.plan(OVER_GOLD).error_bound == 0.0


def test_what_must_stay_stays():
    assert pl.plan(OVER_GOLD, 1e-2, keep=["precision", "opaque"]).left_out == ()


def test_the_signal_without_dispersion_compiles_nothing(compiled):
    thing = scene("SiO2", "Si")
    with jax.enable_x64(True):
        [flat] = alternatives("dispersion", thing)
        exact, other = (signals(p, tabulated(thing), design(thing), build) for p in (full_plan(thing), flat))
    assert 0 < largest_difference(exact, other, False) < 0.5
    assert not compiled


def test_single_precision_is_single_throughout():
    """But for scalars, whose type bends."""
    thing = scene(1.46 + 0.1j, instrument=pl.Instrument(bandwidth=3.0), angle=20.0)
    plan = replace(full_plan(thing), left_out=(FilmRemoval("precision"),))
    with jax.enable_x64(True):
        whole = tabulated(thing)
        jaxpr = jax.make_jaxpr(lambda t: build(plan)(insert(whole, [t])))(200.0)
    wide = [e for e in jaxpr.eqns for v in e.outvars if v.aval.dtype == np.float64 and v.aval.shape]
    assert wide == []
    assert jaxpr.out_avals[0].dtype == np.float32


@pytest.mark.parametrize("tolerance", [-1e-3, np.nan, np.inf])
def test_a_tolerance_that_is_none_is_refused(tolerance, refuses):
    refuses(ValueError, "the tolerance must be positive", pl.plan, OVER_GOLD, tolerance)


@pytest.mark.slow
def test_ellipsometry_counts_in_degrees():
    thing = scene(1.46 + 1e-4j, signal="psi-delta", angle=70.0)
    plan = pl.plan(thing, 0.5)
    assert {left_out.effect for left_out in plan.left_out} >= {"absorption", "precision"}
    points = design(thing)
    with jax.enable_x64(True):
        whole = tabulated(thing)
        one, other = (signals(p, whole, points, build).reshape(-1, 3) for p in (plan, full_plan(thing)))
    psi = [0.5 * np.rad2deg(np.arctan2(np.hypot(x[:, 1], x[:, 2]), x[:, 0])) for x in (one, other)]
    assert np.max(np.abs(psi[0] - psi[1])) <= 0.5 * plan.error_bound
