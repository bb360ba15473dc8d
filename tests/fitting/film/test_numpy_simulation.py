"""Signals of a scene by NumPy: those of the compiled program, for the plans that it evaluates."""

import jax
import numpy as np
import pytest

import pellicle as pl
from pellicle.fitting.film import extended_scene
from pellicle.fitting.film.fit import measurements
from pellicle.fitting.film.problem import make
from pellicle.fitting.film.systematic_effects import simulated_effects
from pellicle.scene.free import free_leaves, insert, start_values

NM = np.linspace(420.0, 880.0, 40)
FREE = pl.Free(200, 400)
AT = np.array([310.0])
TILTED = pl.Anisotropic(1.6, 1.7, axis=(40.0, 20.0))
BIAXIAL = pl.Anisotropic(x=1.6, y=1.7, z=1.8 + 0.01j, axis=(40.0, 20.0, 10.0))
DICHROIC = pl.Anisotropic(1.6, 1.7 + 0.3j, axis=(40.0, 20.0))
PLATE = pl.Substrate("BK7", back="air")
STACK = [pl.Layer("SiO2", FREE), *(pl.Layer(n, 60.0) for n in ("TiO2", "SiO2", "TiO2", "SiO2", "TiO2"))]


def scene(layers, substrate, signal="R", angle=0.0, polarisation="unpolarised", **more):
    light = pl.Light(signal=signal, angle=angle, polarisation=polarisation)
    return pl.Scene(layers, substrate, light=light, **more)


ELEMENTARY = {
    "R": scene(pl.Layer("SiO2", FREE), "Si"),
    "two layers, p": scene([pl.Layer(1.4 + 0.02j, 90.0), pl.Layer("TiO2", FREE)], "Au", "R", 50.0, "p"),
    "psi and delta": scene(pl.Layer("Si3N4", FREE), "Si", "psi-delta", 65.0),
    "T of a plate": scene(pl.Layer("TiO2", FREE), PLATE, "T"),
    "psi and delta of a plate": scene(pl.Layer("SiO2", FREE), PLATE, "psi-delta", 58.0),
    "Mueller elements": scene(pl.Layer("SiO2", FREE), "Si", "mueller", 58.0),
    "six layers": scene(STACK, "BK7", "psi-delta", 50.0),
    "R of six layers": scene(STACK, "BK7"),
    "cone": scene(pl.Layer("SiO2", FREE), "Si", instrument=pl.Instrument(numerical_aperture=0.5)),
    "oblique cone": scene(
        pl.Layer("SiO2", FREE), "Si", "psi-delta", 58.0, instrument=pl.Instrument(angle_spread=2.0)
    ),
    "bandwidth, two layers": scene(
        [pl.Layer("SiO2", FREE), pl.Layer("TiO2", 90.0)], "Si", instrument=pl.Instrument(bandwidth=10.0)
    ),
    "axes along the faces": scene(pl.Layer(pl.Anisotropic(1.6, 1.7), FREE), PLATE, "R", 50.0, "p"),
    "total reflection": scene(pl.Layer(1.33, FREE), "Au", "R", 70.0, "s", ambient=1.5),
    "tilted axis": scene(pl.Layer(TILTED, FREE), "Si", "R", 50.0),
    "Mueller elements of a tilted axis": scene(pl.Layer(TILTED, FREE), "Si", "mueller", 50.0),
    "psi and delta of three media": scene(
        [pl.Layer(TILTED, FREE), pl.Layer(BIAXIAL, 70.0)], "Si", "psi-delta", 60.0
    ),
    "birefringent substrate": scene(pl.Layer("SiO2", FREE), pl.Substrate(TILTED), "R", 60.0, "p"),
    "biaxial substrate": scene(pl.Layer("SiO2", FREE), pl.Substrate(BIAXIAL), "psi-delta", 60.0),
    "dichroic": scene(pl.Layer(DICHROIC, pl.Free(200, 40000)), "Si", "R", 50.0, "s"),
    "tilted axis on a plate": scene(pl.Layer(TILTED, FREE), PLATE, "mueller", 50.0),
    "dichroic on a plate": scene(pl.Layer(DICHROIC, pl.Free(200, 40000)), PLATE, "T", 50.0, "p"),
    "axes along the faces of a plate": scene(
        pl.Layer(pl.Anisotropic(1.6 + 0.1j, 1.7), FREE), PLATE, "psi-delta", 50.0
    ),
    "cone through a tilted axis": scene(
        pl.Layer(TILTED, FREE), "Si", "psi-delta", 58.0, instrument=pl.Instrument(angle_spread=2.0)
    ),
    "transmission of a tilted axis": scene(pl.Layer(TILTED, FREE), "BK7", "T", 30.0, "p"),
}
OTHERS = {
    "gradient": scene(pl.Layer(pl.Graded(1.45, 1.9, pl.profile.Linear()), FREE), "Si"),
}
QUICK = ("R", "two layers, p", "psi and delta", "tilted axis")


def simulations(sample, monkeypatch):
    """Arguments of the programs that simulate the effects of a fit, and what NumPy has for each."""
    calls = []

    def by_numpy(*arguments):
        calls.append((arguments, extended_scene._by_numpy(*arguments)))
        rows, points = len(arguments[-1]), len(arguments[2].values)
        return extended_scene.Simulated(np.zeros((rows, points)))

    for name in ("simulated", "simulated_once"):
        monkeypatch.setattr(extended_scene, name, by_numpy)
    data = pl.simulate(insert(sample, AT), NM)
    [target] = measurements(data, sample)
    with jax.enable_x64(True):
        [view] = make(*measurements(data, sample)).views
        simulated_effects(view, AT, target.scene, AT)
    return calls


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] * (name not in QUICK)) for name in ELEMENTARY]
)
def test_numpy_and_the_program_simulate_the_same(name, monkeypatch):
    calls = simulations(ELEMENTARY[name], monkeypatch)
    assert calls
    for arguments, found in calls:
        with jax.enable_x64(True):
            expected = jax.jit(extended_scene._simulated, static_argnums=0)(*arguments).signal
        assert isinstance(found.signal, np.ndarray)
        np.testing.assert_allclose(found.signal, expected, rtol=0, atol=1e-13)


@pytest.mark.parametrize("name", OTHERS)
def test_other_plans_take_the_program(name, monkeypatch):
    assert all(found is None for _, found in simulations(OTHERS[name], monkeypatch))


TILT = pl.Anisotropic(1.6, pl.dispersion.Constant(pl.Free(1.65, 1.8)), axis=(pl.Free(10, 80), 20.0))
SCANNED = {
    "R": ELEMENTARY["R"],
    "psi and delta, two layers": scene(
        [pl.Layer(pl.dispersion.Cauchy(pl.Free(1.4, 1.7), 5e3), FREE), pl.Layer("SiO2", pl.Free(0, 5))],
        *("Si", "psi-delta", 65.0),
    ),
    "free scale and slow offset": scene(
        pl.Layer("SiO2", FREE), "Si", instrument=pl.Instrument(scale="free", offset="slow")
    ),
    "slow scale": scene(pl.Layer("SiO2", FREE), "Si", instrument=pl.Instrument(scale="slow")),
    "cone": scene(pl.Layer("SiO2", FREE), "Si", instrument=pl.Instrument(numerical_aperture=0.5)),
    "free axis": scene(pl.Layer(TILT, FREE), "Si", "psi-delta", 60.0),
}


def deviances(sample):
    """Those of candidates by NumPy, and a function that returns those of the program."""
    data = pl.simulate(insert(sample, start_values(sample)), NM, noise=0.01)
    with jax.enable_x64(True):
        [view] = make(*measurements(data, sample)).views
        lower, upper = np.array([(x.lower, x.upper) for _, x in free_leaves(sample)]).T
        values = np.random.default_rng(0).uniform(lower, upper, (8, len(lower)))
        found = view.form.explained(view.arrays, values)

    def compiled():
        def one(arrays, each):
            return view.form.explain(arrays, each).deviance

        with jax.enable_x64(True):
            return np.asarray(jax.jit(jax.vmap(one, in_axes=(None, 0)))(view.arrays, values))

    return found, compiled


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] * (name == "free axis")) for name in SCANNED]
)
def test_numpy_and_the_program_scan_the_same(name):
    found, compiled = deviances(SCANNED[name])
    assert isinstance(found.deviance, np.ndarray)
    np.testing.assert_allclose(found.deviance, compiled(), rtol=1e-12)


def test_the_time_of_numpy_grows_with_points_and_rays_and_ends_with_gradients():
    plain, cone = ELEMENTARY["R"], SCANNED["cone"]
    data = {len(nm): pl.simulate(insert(plain, AT), nm) for nm in (NM[::4], np.linspace(420.0, 880.0, 640))}

    def share(sample, data):
        with jax.enable_x64(True):
            [view] = make(*measurements(data, sample)).views
            return view.form.numpy_share(view.arrays)

    few, many = (share(plain, each) for each in data.values())
    assert 0 < few < many < share(cone, data[max(data)]) < np.inf
    mirror = scene(
        [pl.Layer("SiO2", FREE), pl.Group([pl.Layer("TiO2", 60.0), pl.Layer("SiO2", 90.0)], 20)], "Si"
    )
    assert share(mirror, data[min(data)]) > 15 * few
    lens = pl.Instrument(numerical_aperture=0.4)
    tilted, alone = (scene(pl.Layer(TILT, FREE), "Si", "R", **more) for more in ({"instrument": lens}, {}))
    assert share(tilted, data[min(data)]) > 20 * share(alone, data[min(data)])
    cody = pl.dispersion.CodyLorentz(pl.Free(50, 150), 4.0, 2.0, 1.5, 1.0, 1.0, 0.1)
    slow = scene(pl.Layer(pl.dispersion.Oscillators(1.0, (cody,)), FREE), "Si")
    assert share(slow, data[min(data)]) > 10 * few
    assert share(OTHERS["gradient"], data[min(data)]) == np.inf


SIMULATED = {
    "many layers": pl.Scene([pl.Layer(name, 60.0) for name in ("TiO2", "SiO2", "Si3N4") * 3], "BK7"),
    "drift": pl.Scene(pl.Group([pl.Layer("TiO2", 60.0, drift=0.05), pl.Layer("SiO2", 90.0)], 5), "BK7"),
    "periods": scene(pl.Group([pl.Layer("TiO2", 60.0), pl.Layer("SiO2", 90.0)], 5), PLATE, "R", 50.0),
    "cone": ELEMENTARY["oblique cone"],
    "tilted axis on a plate": ELEMENTARY["tilted axis on a plate"],
    "biaxial substrate": ELEMENTARY["biaxial substrate"],
    "cone through a tilted axis": ELEMENTARY["cone through a tilted axis"],
}


@pytest.mark.parametrize("name", SIMULATED)
def test_a_simulation_compiles_nothing(name, compiled):
    pl.simulate(SIMULATED[name], NM)
    assert not compiled


@pytest.mark.parametrize("name", ["R", "psi and delta, two layers", "free scale and slow offset"])
def test_a_first_fit_compiles_nothing(name, compiled):
    sample = SCANNED[name]
    result = pl.fit(pl.simulate(insert(sample, start_values(sample)), NM, noise=0.002), sample)
    assert result.status
    assert not compiled
