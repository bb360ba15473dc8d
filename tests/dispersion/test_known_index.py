"""Known indices by NumPy: the same numbers as in a traced program, and no program compiled for them."""

from functools import partial

import jax
import jax.extend
import numpy as np
import pytest

from pellicle import dispersion as d
from pellicle.dispersion.base import known_index
from pellicle.materials import material
from pellicle.optics.pair import parts

WAVELENGTH = np.linspace(250, 900, 128)
KNOTS = (300.0, 400.0, 500.0, 700.0, 800.0)
K = (0.0, 0.1, 0.2, 0.1, 0.0)
GLASS, SILICON, GOLD = material("SiO2"), material("Si"), material("Au")

MODELS = {
    "constant": d.Constant(1.5, 0.1),
    "cauchy": d.Cauchy(1.4, 5e3, 1e6),
    "cauchy-urbach": d.CauchyUrbach(1.4, 5e3, 1e6),
    "sellmeier": d.Sellmeier((1.0,), (1e4,)),
    "lorentz": d.Oscillators(1.5, (d.Lorentz(1.0, 4.0, 0.5), d.Drude(1.0, 0.2), d.Gaussian(1.0, 3.5, 0.4))),
    "tauc-lorentz": d.Oscillators(1.5, (d.TaucLorentz(50.0, 3.5, 2.0, 1.2),)),
    "cody-lorentz": d.Oscillators(1.5, (d.CodyLorentz(50.0, 3.5, 2.0, 1.2, 1.0, 0.3, 0.05),)),
    "spline": d.Spline(KNOTS, (1.5, 1.6, 1.5, 1.4, 1.4), K),
    "spline-kk": d.KramersKronigSpline(KNOTS, K),
    "formula": GLASS,
    "table": SILICON,
    "bruggeman": d.Bruggeman(GLASS, SILICON, 0.3),
    "bruggeman of transparent media": d.Bruggeman(d.Cauchy(1.5), d.Cauchy(2.0), 0.3),
    "looyenga": d.Looyenga(SILICON, GOLD, 0.3),
    "looyenga of transparent media": d.Looyenga(d.Cauchy(1.5), d.Cauchy(2.0), 0.3),
    "maxwell-garnett": d.MaxwellGarnett(d.Cauchy(1.5), GOLD, 0.3),
    "linear": d.Linear(d.Cauchy(1.5), d.Cauchy(2.0), 0.3),
    "shifted": d.Shifted(SILICON, 0.1, 0.05),
}

traced = jax.jit(lambda dispersion, wavelength: dispersion.index(wavelength))


@pytest.mark.parametrize("name", MODELS)
def test_numpy_agrees_with_a_traced_program(name):
    expected = parts(traced(MODELS[name], WAVELENGTH))
    found = parts(known_index(MODELS[name], WAVELENGTH))
    for own, other in zip(found, expected, strict=True):
        assert (own is None) == (other is None)
        if own is not None:
            assert isinstance(own, np.ndarray)
            assert (own.dtype, own.shape) == (np.float64, WAVELENGTH.shape)
            # spline-kk cancels about three digits
            np.testing.assert_allclose(own, other, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("name", MODELS)
def test_nothing_is_traced(name, monkeypatch):
    """Every traced primitive, also of a single operation, passes through `bind`."""

    def refuse(primitive, *_, **__):
        raise AssertionError(f"JAX computed {primitive}")

    monkeypatch.setattr(jax.extend.core.Primitive, "bind", refuse)
    known_index(MODELS[name], WAVELENGTH)


@pytest.mark.parametrize("name", MODELS)
def test_a_known_model_compiles_nothing_when_it_is_called(name):
    called = jax.make_jaxpr(lambda: MODELS[name](WAVELENGTH))()
    assert not called.eqns
    assert called.consts[0].dtype == complex


def test_a_formula_without_a_real_index_is_nan_without_a_warning():
    assert np.isnan(known_index(d.Sellmeier((1.0,), (300.0**2,)), np.array([299.0]))).all()


def test_jax_where_a_parameter_is_traced():
    slope = jax.grad(lambda k0: partial(d.CauchyUrbach, 1.4, Eb=3.1)(k0=k0).index(np.array(400.0)).im)(0.01)
    energy = 1239.841984 / 400
    assert float(slope) == pytest.approx(np.exp((energy - 3.1) / 0.5), rel=1e-12)
