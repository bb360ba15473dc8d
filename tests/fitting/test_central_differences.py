"""Slopes by central differences, against formulas and against the compiled programs that they stand for."""

import jax
import numpy as np
import pytest

import pellicle as pl
from pellicle.fitting import evaluation
from pellicle.fitting.central_differences import around, central_differences, steps_within
from pellicle.fitting.film import view as film_view
from pellicle.fitting.film.fit import measurements
from pellicle.fitting.film.problem import make
from pellicle.programs.cache import compiled_at_once

NM = np.linspace(420.0, 880.0, 32)


def waves(x):
    phase = x[:, :1] * np.linspace(1.0, 100.0, 50)
    return np.sin(phase) * x[:, 1:], x[:, :1] ** 2


def test_values_and_slopes_of_known_functions():
    at = np.array([[0.3, 0.7], [1.0, 0.0]])
    found = central_differences(waves, at, steps_within(at, np.array([1e-6, 1e-6]), 0.0, 1.0))
    rates = np.linspace(1.0, 100.0, 50)
    np.testing.assert_array_equal(found.values[0], waves(at)[0])
    for point, slope, square in zip(at, *found.slopes, strict=True):
        np.testing.assert_allclose(slope[:, 0], rates * np.cos(point[0] * rates) * point[1], atol=1e-7)
        np.testing.assert_allclose(slope[:, 1], np.sin(point[0] * rates), atol=1e-9)
        np.testing.assert_allclose(square, [[2 * point[0], 0.0]], atol=1e-9)


def test_points_at_a_wall_stay_inside():
    seen = []

    def root(x):
        seen.append(x)
        assert np.all(x >= 0)
        return (np.exp(x) + x[:, ::-1] ** 2,)

    found = around(root, np.array([0.0, 3.0]), np.array([1e-6, 1e-6]))
    np.testing.assert_allclose(found.slopes[0], [[1.0, 6.0], [0.0, np.exp(3.0)]], atol=1e-5)


def test_a_step_that_changes_nothing_is_lengthened():
    def weak(x):
        return (1.0 + 1e-10 * x,)

    found = around(weak, np.array([1.0]), np.array([1e-6]))
    np.testing.assert_allclose(found.slopes[0], [[1e-10]], rtol=1e-3)


def tilted(thickness, theta, phi, index):
    medium = pl.Anisotropic(1.6, index, axis=(theta, phi))
    return pl.Scene(pl.Layer(medium, thickness), "Si", light=pl.Light(signal="psi-delta", angle=65.0))


SCENE = tilted(
    pl.Free(100, 400), pl.Free(10, 80), pl.Free(0, 90), pl.dispersion.Cauchy(pl.Free(1.6, 1.9), 4e3)
)


@pytest.fixture(scope="module")
def data():
    return pl.simulate(tilted(240.0, 40.0, 30.0, pl.dispersion.Cauchy(1.72, 4e3)), NM, noise=0.03, seed=2)


@pytest.mark.slow
def test_equations_and_local_models_are_those_of_the_programs(data):
    with jax.enable_x64(True):
        problem = make(*measurements(data, SCENE))
        [view] = problem.views
        units = np.array([[0.45, 0.4, 0.3, 0.4], [0.2, 0.9, 1.0, 0.5], [0.7, 0.0, 0.4, 0.8]])
        box = problem.box._replace(
            lower=np.tile(problem.box.lower, (3, 1)), upper=np.tile(problem.box.upper, (3, 1))
        )
        arguments = (problem.static, 1), (view.arrays,), box, units, np.int64(3)
        values = np.asarray(problem.values(units))
        found = evaluation._equations_by_numpy(*arguments)
        local = [film_view._local_by_numpy(view.form, *view.arrays, each) for each in values]
        with compiled_at_once():
            expected = evaluation.equations(*arguments)
            exact = [film_view.local(view.form, *view.arrays, each) for each in values]
    for mine, own in zip(found, expected, strict=True):
        np.testing.assert_allclose(mine, own, rtol=1e-6, atol=1e-7 * np.max(np.abs(own)))
    for mine, own in zip(local, exact, strict=True):
        for name, x, y in zip(own._fields, mine, own, strict=True):
            # each parameter by its own size
            size = (
                np.max(np.abs(y), axis=tuple(range(np.ndim(y) - 1)), keepdims=True)
                if "slope" in name
                else 1.0
            )
            assert np.all(np.abs(x - y) <= 1e-6 * size + 1e-12), name


def film(thickness, index, scale):
    instrument = pl.Instrument(scale=scale, offset=scale if scale == "free" else 0.0)
    return pl.Scene(pl.Layer(pl.dispersion.Cauchy(index, 4e3), thickness), "Si", instrument=instrument)


SLOW = [pytest.param(kind, marks=pytest.mark.slow) for kind in ("tilted axis", "25 µm")]


@pytest.mark.parametrize("kind", [*SLOW, "free scale, offset"])
def test_the_first_fit_is_that_of_compiled_programs(kind, request):
    if kind == "tilted axis":
        sample, data = SCENE, request.getfixturevalue("data")
    elif kind == "25 µm":  # its signal bends within small steps
        medium = pl.dispersion.Constant(pl.Free(1.4, 1.6))
        sample = pl.Scene(pl.Layer(medium, pl.Free(20000, 30000)), "Si")
        truth = pl.Scene(pl.Layer(1.5, 25000.0), "Si")
        data = pl.simulate(truth, np.linspace(420.0, 880.0, 90), noise=0.002, seed=3)
    else:
        sample = film(pl.Free(100, 400), pl.Free(1.3, 1.8), "free")
        data = pl.simulate(film(240.0, 1.46, 1.0), NM, noise=0.002, seed=2)
    first = pl.fit(data, sample)
    with compiled_at_once():
        again = pl.fit(data, sample)
    assert first.status == again.status
    for name, parameter in again.parameters.items():
        if not parameter.free:
            continue
        assert abs(first[name].value - parameter.value) < 1e-6 * parameter.stderr
        assert first[name].stderr == pytest.approx(parameter.stderr, rel=1e-5)
