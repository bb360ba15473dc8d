"""Plans: each effect on and off with its reason, judged from bounds and never from values."""

from dataclasses import replace

import jax
import numpy as np
import pytest

import pellicle as pl
from pellicle.dispersion import Cauchy, Constant, Shifted
from pellicle.effects.averaging import MOST_ORDERS, ORDERS_ERROR
from pellicle.effects.film_plan import EFFECTS
from pellicle.effects.gradient import gradient, signals
from pellicle.forward_model.film_signal import build
from pellicle.scene.free import free_leaves, insert

from ..films import scene

NAMES = [judge.__name__.replace("_", "-") for judge in EFFECTS]
FREE_K = pl.Free(0, 1, start=0.0)
FREE_ANGLE = pl.Free(0, 60, start=0.0)


BANDWIDTH = pl.Instrument(bandwidth=5.0)
UNEVEN = pl.Instrument(thickness_spread=3)
SHIFTED = pl.Instrument(angle_shift=FREE_ANGLE)
CONE = pl.Instrument(numerical_aperture=0.3)
BLURRED = scene(signal="psi-delta", angle=60.0, instrument=BANDWIDTH)
THICK = scene(thickness=2.5e5)
PLATES = pl.Scene([pl.Plate(1.5), pl.Layer(1.46, 9.0)], pl.Substrate(1.5, "air"))
GRADED = pl.Graded(1.46, 2.0, pl.profile.Linear(0.0, pl.Free(0.5, 1.0)))
TABLE = [
    ("absorption", False, "no layer has any extinction", scene()),
    ("absorption", True, "extinction is free, or not zero", scene(1.46 + 0.1j)),
    ("anisotropy", False, "no medium is birefringent", scene()),
    ("anisotropy", True, "s and p stay apart", scene(pl.Anisotropic(1.5, 1.6))),
    ("anisotropy", True, "s and p mix", scene(pl.Anisotropic(1.5, 1.6, axis=(pl.Free(0, 90), 0)))),
    ("stack", False, "one layer", scene()),
    ("stack", True, "2 coherent layers", pl.Scene([pl.Layer(1.46, 10.0), pl.Layer(2.0, 20.0)], 1.5)),
    ("absorption", True, "extinction is free, or not zero", scene(Constant(1.46, FREE_K))),
    ("absorption", True, "extinction is free, or not zero", scene(Shifted(Constant(1.46), k=FREE_K))),
    ("gradient", False, "no layer is graded", scene()),
    ("gradient", True, "slices of sixth order", scene(GRADED)),
    ("gradient", True, "Re ε passes 0", scene(pl.Graded(1.46, 0.5 + 3j, mix="linear"), angle=60.0)),
    ("stack", True, "a graded layer", scene(GRADED)),
    ("orders", False, "averaged over nodes instead", scene(GRADED, instrument=BANDWIDTH)),
    ("tunnelling", True, "in the layer is possible", scene(GRADED, ambient=1.52, angle=75.0)),
    ("tunnelling", False, "no real index can fall below", scene(angle=60.0)),
    ("tunnelling", True, "in the layer is possible", scene(1.33, ambient=1.52, angle=65.0)),
    ("tunnelling", True, "in the substrate is possible", scene(2.1, 1.0, ambient=1.52, angle=65.0)),
    ("tunnelling", True, "layer and substrate", scene(1.2, 1.0, ambient=1.52, angle=65.0)),
    ("tunnelling", False, "no real index", scene(1.33 + 0.1j, ambient=1.52, angle=65.0)),
    ("tunnelling", True, "in the layer", scene(angle=FREE_ANGLE)),
    ("tunnelling", True, "in the layer", scene(angle=60.0, wavelength=None)),
    ("oblique", False, "normal incidence, and the angle is not free", scene()),
    ("oblique", True, "incidence at 30°", scene(angle=30)),
    ("oblique", True, "incidence at 10 to 50°", scene(angle=np.linspace(10, 50, 9))),
    ("oblique", True, "the angle of incidence is free", scene(angle=FREE_ANGLE)),
    ("oblique", True, "the angle of incidence is shifted", scene(instrument=pl.Instrument(angle_shift=1.0))),
    ("tunnelling", False, "no real index", scene(1.33, ambient=1.52, angle=55.0)),
    ("tunnelling", True, "in the layer", scene(1.33, ambient=1.52, angle=55.0, instrument=SHIFTED)),
    ("polarisation", True, "mean of s and p", scene(instrument=SHIFTED)),
    ("polarisation", False, "s and p are equal at normal incidence", scene()),
    ("polarisation", False, "the light is p-polarised", scene(angle=30.0, polarisation="p")),
    ("polarisation", True, "the mean of s and p", scene(angle=30.0)),
    ("polarisation", True, "the mean of s and p", scene(angle=FREE_ANGLE)),
    ("transmission", False, "the signal is a reflectance", scene()),
    ("transmission", True, "the signal is a transmittance", scene(signal="T")),
    ("transmission", True, "reaches the back face", scene(substrate=pl.Substrate(1.5, "air"))),
    ("back-face", False, "without a back face", scene()),
    ("back-face", True, "a plate", scene(substrate=pl.Substrate(1.5, "air"))),
    ("coherence", False, "monochromatic", scene()),
    ("coherence", False, "monochromatic", scene(instrument=pl.Instrument(bandwidth=0, thickness_spread=0.0))),
    ("coherence", True, "damped by bandwidth", scene(instrument=BANDWIDTH)),
    ("coherence", True, "by uneven thickness", scene(instrument=UNEVEN)),
    ("coherence", True, "by bandwidth and uneven", scene(instrument=pl.Instrument("free", 0.0, 1, 1))),
    ("coherence", True, "bandwidth", scene(instrument=pl.Instrument(bandwidth=pl.Free(0, 9, start=0.0)))),
    ("coherence", True, "each averaged over 15 nodes", BLURRED),
    ("orders", False, "averaged over nodes instead", BLURRED),
    ("coherence", True, "fringes every 0.99 nm are narrower than the sampling of 50 nm", THICK),
    ("coherence", False, "monochromatic", scene(thickness=pl.Free(10, 2.5e5))),
    ("coherence", False, "monochromatic", scene(thickness=2.5e5, wavelength=np.array([600.0]))),
    ("orders", True, "no order remains", THICK),
    ("roughness", False, "no face has a roughness", scene()),
    ("roughness", True, "1 rough: up to 3 nm", scene(pl.Layer(1.46, 300.0, roughness=3.0))),
    ("stack", True, "rough faces", scene(pl.Layer(1.46, 300.0, roughness=FREE_K))),
    ("angle-spread", False, "no cone of light", scene()),
    ("angle-spread", True, "within 17.5° of its axis", scene(instrument=CONE)),
    ("oblique", True, "the light's cone has oblique rays", scene(instrument=pl.Instrument(angle_spread=5.0))),
    ("polarisation", True, "cone has s and p", scene(instrument=pl.Instrument(angle_spread=5.0))),
    ("back-face", True, "2 incoherent", PLATES),
    ("dispersion", False, "no index varies", scene()),
    ("dispersion", False, "one wavelength", scene(Cauchy(1.4, 1e4), wavelength=np.array([600.0]))),
    ("dispersion", True, "the index of layer and substrate varies", scene("SiO2", "Si")),
    ("dispersion", True, "the index of layer varies", scene(Cauchy(1.4, pl.Free(0, 1)))),
    ("opaque", False, "light may reach every layer", scene(0.2 + 3j)),
    ("precision", True, "double", scene()),
    ("coherence", True, "by uneven thickness, each averaged", scene(2 + 0.1j, instrument=UNEVEN)),
    ("orders", False, "the closed form sums all orders", scene()),
    ("orders", True, "over the bounds", scene(instrument=BANDWIDTH)),
]


@pytest.mark.parametrize(("effect", "on", "why", "thing"), TABLE)
def test_each_effect_and_its_reason(effect, on, why, thing):
    row = pl.plan(thing).row(effect)
    assert row.on is on
    assert why in row.why


def test_the_table_covers_every_effect_both_ways():
    """But for what only a tolerance decides (test_film_plan.py)."""
    both = {(name, on) for name in NAMES for on in (True, False)}
    assert {(effect, on) for effect, on, *_ in TABLE} == both - {("opaque", True), ("precision", False)}


def test_a_plan_lists_every_effect_in_order(refuses):
    plan = pl.plan(scene())
    assert [row.effect for row in plan.rows] == NAMES
    lines = str(plan).splitlines()
    assert len(lines) == len(NAMES)
    assert lines[0].split()[:2] == ["absorption", "off"]
    refuses(KeyError, "magic", plan.row, "magic")


def test_plans_are_values():
    """Equal scenes give equal plans, which share one compiled model."""
    one, two = pl.plan(scene(angle=30.0)), pl.plan(scene(thickness=500.0, angle=30.0))
    assert one == two
    assert hash(one) == hash(two)
    assert build(one) is build(two)
    assert pl.plan(scene(angle=31.0)) != one
    with pytest.raises(AttributeError):
        one.signal = "T"


def test_a_start_value_decides_nothing():
    """Only bounds do: the trap is an extinction, an angle or a bandwidth that starts at exactly 0."""

    def plan(value):
        free = [pl.Free(0, upper, start=value * upper) for upper in (1.0, 60.0, 9.0)]
        return pl.plan(
            scene(Constant(1.46, free[0]), angle=free[1], instrument=pl.Instrument(bandwidth=free[2]))
        )

    for row, same in zip(plan(0.0).rows, plan(0.5).rows, strict=True):
        assert (row.effect, row.on) == (same.effect, same.on)


def test_orders_need_wavelengths():
    with pytest.raises(ValueError, match="give the light its wavelengths"):
        pl.plan(scene(wavelength=None, instrument=BANDWIDTH))


ORDERS = {
    "oxide on silicon": scene(Constant(pl.Free(1.3, 1.7)), thickness=pl.Free(10, 900), instrument=BANDWIDTH),
    "titania on silicon, oblique": scene(
        2.5, thickness=pl.Free(10, 900), angle=pl.Free(0, 60), instrument=BANDWIDTH
    ),
    "absorbing on metal": scene(
        Constant(2.1, pl.Free(0, 0.2)), 0.2 + 3.4j, pl.Free(10, 900), instrument=BANDWIDTH
    ),
    "polymer on glass": scene(1.6, 1.52, pl.Free(10, 900), instrument=BANDWIDTH),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", ORDERS)
@pytest.mark.parametrize("signal", "RT")
def test_the_bound_on_what_the_orders_leave_out_is_true(name, signal):
    """Without a bandwidth, where every order counts in full, over random draws of the free parameters."""
    thing = replace(ORDERS[name], light=replace(ORDERS[name].light, signal=signal))
    row = pl.plan(thing).row("orders")
    sharp = replace(thing, instrument=pl.Instrument(bandwidth=0.0))
    series, closed = build(pl.plan(thing)), build(pl.plan(sharp))
    rng = np.random.default_rng(5)
    free = [f for _, f in free_leaves(thing)]
    draws = np.stack([rng.uniform(f.lower, f.upper, 100) for f in free], axis=1)

    def left_out(values):
        filled = insert(sharp, values)
        return series(filled) - closed(filled)

    worst = np.max(np.abs(jax.jit(jax.vmap(left_out))(draws)))
    assert 0 < worst <= row.error_bound
    assert row.error_bound <= 2 * ORDERS_ERROR or row.count == MOST_ORDERS


def test_stronger_reflections_need_more_orders():
    counts = [pl.plan(ORDERS[name]).row("orders").count for name in ("polymer on glass", "oxide on silicon")]
    counts.append(pl.plan(ORDERS["absorbing on metal"]).row("orders").count)
    assert counts == sorted(counts)
    assert counts[0] < 5 < counts[-1] <= MOST_ORDERS


@pytest.mark.parametrize(("metal", "angle"), [(0.9 + 3.2j, 45.0), (2.2, 70.0)])
def test_the_stated_error_of_slices_is_kept_between_the_bounds(metal, angle):
    """Against four times as many slices at new points; `benchmarks/slices.py` does this for 1000 scenes."""
    profile = pl.profile.Exponential(pl.Free(0.1, 0.4), pl.Free(0.3, 0.9), 0.1)
    layer = pl.Layer(pl.Graded(1.5, metal, profile, mix="linear"), pl.Free(200.0, 500.0))
    graded, rng = scene(layer, 2.0, angle=angle), np.random.default_rng(2)
    row, bounds = gradient(graded), [(leaf.lower, leaf.upper) for _, leaf in free_leaves(graded)]
    for _ in range(10):
        numbers = insert(graded, [rng.uniform(*each) for each in bounds])
        apart = np.abs(signals(numbers, row.count) - signals(numbers, 4 * row.count))
        assert np.max(apart) < row.error_bound
