"""Programs of stacks of many layers: their size, values and slopes."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import pellicle as pl
from pellicle.dispersion.empirical import Cauchy
from pellicle.fitting.film.problem import make, measured
from pellicle.forward_model import film_signal
from pellicle.optics import coherent
from pellicle.optics.layer_rows import stacked

NM = np.linspace(450.0, 800.0, 64)
MEDIA = ["TiO2", "SiO2", 1.6 + 0.01j, Cauchy(1.7, 4000.0), Cauchy(1.38, 2000.0)]


def stack(count: int, signal: str = "R", angle: float = 0.0) -> pl.Scene:
    """Layers of five materials and different thicknesses, the index of one and the depth of two free."""
    depths = np.linspace(40.0, 120.0, count)
    layers = [pl.Layer(MEDIA[i % len(MEDIA)], float(d), f"l{i}") for i, d in enumerate(depths)]
    layers[0] = pl.Layer("SiO2", pl.Free(30.0, 60.0), "l0")
    layers[3] = pl.Layer(Cauchy(pl.Free(1.5, 1.9), 4000.0), pl.Free(30.0, 60.0), "l3")
    return pl.Scene(layers, "Si", light=pl.Light(NM, angle, signal))


def lines(count: int, names: str) -> int:
    """Lines of the program of a fit, or of one with slopes, as `kept` passes its arguments."""
    scene = stack(count)
    data = pl.Spectrum(NM, np.full(NM.size, 0.3), "R")
    view = make(measured(data, scene)).views[0]
    leaves, structure = jax.tree.flatten(view.arrays)
    own = {id(x) if np.ndim(x) else -i: np.asarray(x) for i, x in enumerate(leaves)}
    keys = [id(x) if np.ndim(x) else -i for i, x in enumerate(leaves)]

    def signal(numbers, values):
        return view.form.explain(structure.unflatten([numbers[key] for key in keys]), values).model

    run = signal if names == "value" else jax.jacfwd(signal, 1)
    with jax.enable_x64(True):
        return jax.jit(run).lower(own, np.array([45.0, 45.0, 1.7])).as_text().count("\n")


@pytest.mark.parametrize("names", ["value", "slopes"])
def test_a_program_grows_by_the_numbers_of_a_layer_alone(names):
    """1 line a layer, 4 with slopes, those of its thickness; 22 where each had formulas of its own."""
    assert lines(60, names) - lines(20, names) < 5 * 40


@pytest.mark.slow
@pytest.mark.parametrize(("signal", "angle"), [("R", 0.0), ("psi-delta", 65.0)])
def test_slopes_in_rows_are_those_of_each_layer(monkeypatch, signal, angle):
    scene = stack(9, signal, angle)
    with jax.enable_x64(True):
        view = make(measured(pl.simulate(stack(9, signal, angle), NM, noise=0.01, seed=1), scene)).views[0]
        at = np.array([45.0, 45.0, 1.7])
        slopes = jax.jit(jax.jacfwd(lambda x: view.form.explain(view.arrays, x).model))(at)
        monkeypatch.setattr(film_signal, "pointwise", lambda function, numbers: function(numbers))
        film_signal.build.cache_clear()
        plain = jax.jit(jax.jacfwd(lambda x: view.form.explain(view.arrays, x).model))(at)
    film_signal.build.cache_clear()
    np.testing.assert_allclose(slopes, plain, rtol=1e-11, atol=1e-13)


@pytest.mark.slow
def test_rows_are_the_layers_one_by_one():
    """In the precision of the wavelengths, also of Python's numbers."""
    with jax.enable_x64(True):
        phases = [2 * np.pi / NM * d for d in (30.0, 70.0, 11.0, 30.0, 45.0)]
        high = jnp.linspace(2.2, 2.4, NM.size)
        layers = [high, 1.46, 1.3 + 0.2j, high, 1.1]
        one = coherent.responses(1.0, layers, 3.9 + 0.02j, phases, 0.7)
        rows = stacked(layers, NM)
        assert rows.order == (0, 1, 2, 0, 3)
        other = coherent.responses(1.0, rows, 3.9 + 0.02j, jnp.stack(phases), 0.7)
    assert one[0].reflected.dtype == np.complex128
    for x, y in zip(jax.tree.leaves(one), jax.tree.leaves(other), strict=True):
        np.testing.assert_array_equal(x, y)
