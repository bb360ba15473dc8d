"""Models compiled from plans: they compute what the scene calls for, and nothing else."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import pellicle as pl
from pellicle.dispersion import Cauchy, Constant
from pellicle.effects.film_plan import exact
from pellicle.forward_model.film_signal import build, tabulated

from ..films import WAVELENGTH, predict, scene

PLATE = pl.Substrate(1.52, back=1.0)
DENSE = {"ambient": 1.52, "angle": 65.0}
SCENES = {
    "transparent, normal": scene(),
    "transparent, oblique": scene(angle=60.0),
    "transmittance": scene(substrate=1.52, angle=60.0, signal="T"),
    "k fixed at 0": scene(Constant(1.46, 0.0), angle=60.0),
    "absorbing": scene(2.1 + 0.1j, angle=60.0),
    "one polarisation": scene(angle=60.0, polarisation="p"),
    "tunnelling layer": scene(1.33, 1.7, **DENSE),
    "tunnelling substrate": scene(2.1, 1.0, **DENSE),
    "dispersive": scene(Cauchy(1.45, 3e3), "Si"),
    "plate": scene(substrate=PLATE),
    "plate, oblique transmittance": scene(substrate=PLATE, angle=50.0, signal="T"),
    "an angle for each wavelength": scene(angle=np.linspace(0, 60, 9)),
}
QUICK = ("transparent, oblique", "absorbing", "tunnelling layer", "plate, oblique transmittance")
EVERY_SCENE = pytest.mark.parametrize(
    "name", [x if x in QUICK else pytest.param(x, marks=pytest.mark.slow) for x in SCENES]
)


def everything(thing):
    """A plan that leaves out no effect but the windows: absorption, both polarisations, any angle."""
    plan = pl.plan(thing)
    both = thing.light.polarisation == "unpolarised"
    on = {"absorption", "oblique", "tunnelling"} | ({"polarisation"} if both else set())
    return replace(plan, rows=tuple(replace(row, on=row.on or row.effect in on) for row in plan.rows))


@EVERY_SCENE
def test_what_a_plan_leaves_out_changes_nothing(name):
    thing = SCENES[name]
    whole = jax.jit(build(everything(thing)))(thing)
    np.testing.assert_allclose(predict(thing), whole, rtol=1e-12, atol=1e-15)


@EVERY_SCENE
def test_sampling_the_media_changes_nothing(name):
    """What is fixed is evaluated before a fit; values and the slope in thickness stay."""
    thing = SCENES[name]
    np.testing.assert_allclose(predict(tabulated(thing)), predict(thing), rtol=1e-14)


@pytest.mark.parametrize("name", [name for name, s in SCENES.items() if s.substrate.back is None])
def test_a_model_is_the_front_door(name):
    """The same film through `pl.reflectance` and `pl.transmittance`."""
    thing = SCENES[name]
    function = pl.reflectance if thing.light.signal == "R" else pl.transmittance
    film = thing.layers[0].thickness, thing.layers[0].material, thing.substrate.material
    light = {"angle": thing.light.angle, "polarisation": thing.light.polarisation}
    direct = function(WAVELENGTH, *film, ambient=thing.ambient, **light)
    np.testing.assert_allclose(predict(thing), direct, rtol=1e-12, atol=1e-15)


SHIFTED = pl.Instrument(angle_shift=-0.3)


def test_ellipsometry_at_shifted_angles():
    """Three angles in one measurement, all 0.3° smaller than the instrument's; the data keep its angles."""
    nm, angle = np.repeat([450.0, 600.0, 800.0], 3), np.tile([65.0, 70.0, 75.0], 3)
    light = {"wavelength": nm, "angle": angle, "signal": "psi-delta"}
    found = pl.simulate(scene(instrument=SHIFTED, **light), nm)
    psi, delta = pl.ellipsometry(nm, 300.0, 1.46, 3.9 + 0.02j, angle=angle - 0.3)
    np.testing.assert_allclose(found.values, psi, atol=1e-9)
    np.testing.assert_allclose(found.delta, np.mod(delta, 360), atol=1e-9)
    np.testing.assert_array_equal(found.angle, angle)


@pytest.mark.parametrize(("angle", "polarisation"), [(0.0, "unpolarised"), (50.0, "s")])
def test_reflectance_at_a_shifted_angle(angle, polarisation):
    """At normal incidence, too, where nothing else makes the light oblique."""
    thing = scene(angle=angle, polarisation=polarisation, instrument=pl.Instrument(angle_shift=4.0))
    truth = pl.reflectance(WAVELENGTH, 300.0, 1.46, 3.9 + 0.02j, angle=angle + 4.0, polarisation=polarisation)
    np.testing.assert_allclose(predict(thing), truth, rtol=1e-12)


def primitives(thing, plan=None):
    """Number of operations that a model is made of, those inside others counted too."""

    def count(jaxpr):
        inner = [x for e in jaxpr.eqns for x in jax.tree.leaves(list(e.params.values()), is_leaf=is_jaxpr)]
        return len(jaxpr.eqns) + sum(count(getattr(x, "jaxpr", x)) for x in inner if is_jaxpr(x))

    def is_jaxpr(x):
        return isinstance(x, jax.extend.core.ClosedJaxpr | jax.extend.core.Jaxpr)

    numbers = jax.tree.map(jnp.asarray, thing)
    return count(jax.make_jaxpr(build(plan or pl.plan(thing)))(numbers).jaxpr)


BANDWIDTH = pl.Instrument(bandwidth=5.0)
LEAVES_NO_TRACE = {
    "absorption": (scene(), scene(1.46 + 0.1j)),
    "absorption, k fixed at 0": (scene(Constant(1.46, 0.0)), scene(Constant(1.46, 0.1))),
    "oblique": (scene(polarisation="p"), scene(polarisation="p", angle=30.0)),
    "angle shift": (scene(angle=30.0), scene(angle=30.0, instrument=SHIFTED)),
    "polarisation": (scene(angle=30.0, polarisation="s"), scene(angle=30.0)),
    "tunnelling": (scene(angle=80.0), scene(angle=80.0, ambient=1.6)),
    "back face": (scene(substrate=1.52), scene(substrate=PLATE)),
    "wavelength shift": (
        scene(Cauchy(1.4, 1e4), instrument=pl.Instrument(wavelength_shift=0.0)),
        scene(Cauchy(1.4, 1e4), instrument=pl.Instrument(wavelength_shift=1.0)),
    ),
    "coherence": (scene(), scene(instrument=BANDWIDTH)),
    "bandwidth of 0": (scene(instrument=pl.Instrument(bandwidth=0.0)), scene(instrument=BANDWIDTH)),
    "transmission": (scene(substrate=1.52), scene(substrate=PLATE)),
}


@pytest.mark.parametrize("name", LEAVES_NO_TRACE)
def test_an_absent_effect_leaves_no_trace(name):
    without, with_it = LEAVES_NO_TRACE[name]
    assert primitives(without) < primitives(with_it)


def test_k_fixed_at_zero_costs_what_no_k_costs():
    plain, fixed = scene(angle=30.0), scene(Constant(1.46, 0.0), angle=30.0)
    assert primitives(fixed) <= primitives(plain) + 2  # the constant itself


@pytest.mark.parametrize("signal", ["R", "T"])
def test_both_polarisations_share_what_is_equal(signal):
    """The mean of s and p traces the phases of the layers once."""

    def operations(polarisation):
        light = pl.Light(np.linspace(400, 800, 4), 50.0, signal, polarisation)
        scene = pl.Scene([pl.Layer(1.46, 90.0), pl.Layer(2.3, 120.0)], 1.5, light=light)
        return str(jax.make_jaxpr(build(exact(scene).static_key))(scene)).count("\n")

    assert operations("unpolarised") < 1.8 * operations("s")
