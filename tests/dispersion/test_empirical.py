"""Dispersion models: values, precision, what lies outside a table, and gradients."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from pellicle.dispersion.empirical import (
    Cauchy,
    Constant,
    Scaled,
    Sellmeier,
    Shifted,
    Table,
    Tabulated,
    WithExtinction,
)
from pellicle.optics.pair import Pair, imag, is_real, real, to_complex

from ..differences import derivative

WAVELENGTH = np.linspace(400.0, 800.0, 9)
TABLE = Table([400.0, 500.0, 800.0], [1.5, 1.4, 1.3], [0.3, 0.2, 0.0])
# BK7 (SCHOTT data sheet N-BK7, B and C there in µm²), n_d = 1.5168 at 587.5618 nm
BK7 = Sellmeier((1.03961212, 0.231792344, 1.01046945), (0.00600069867e6, 0.0200179144e6, 103.560653e6))
MODELS = {
    "constant": Constant(1.46),
    "absorbing constant": Constant(2.1, 0.3),
    "table": TABLE,
    "Cauchy": Cauchy(1.45, 3500.0, 1e8),
    "Sellmeier": BK7,
    "with extinction": WithExtinction(BK7, TABLE),
    "shifted": Shifted(TABLE, 0.01, 0.02),
    "scaled": Scaled(TABLE, 0.02, 0.5),
}
EVERY_MODEL = pytest.mark.parametrize("model", MODELS.values(), ids=MODELS)


def test_published_values():
    assert float(BK7.index(587.5618)) == pytest.approx(1.5168, abs=5e-7)
    assert complex(BK7(587.5618)).imag == 0


def test_values():
    assert Cauchy(1.4, 3000.0, 1e8).index(500.0) == pytest.approx(1.4 + 3e3 / 25e4 + 1e8 / 625e8)
    np.testing.assert_allclose(TABLE(WAVELENGTH[[0, 1, 2, 8]]), [1.5 + 0.3j, 1.45 + 0.25j, 1.4 + 0.2j, 1.3])
    np.testing.assert_array_equal(Constant(2.1, 0.3)(WAVELENGTH), np.full(9, 2.1 + 0.3j))
    np.testing.assert_allclose(MODELS["shifted"](500.0), 1.41 + 0.22j)
    np.testing.assert_allclose(MODELS["scaled"](500.0), (1.4 + 0.2j) * 1.01)
    tilted = Scaled(Constant(1.5), 0.1, np.linspace(-1, 1, 9))
    np.testing.assert_allclose(tilted(WAVELENGTH), 1.5 + 0.15 * np.linspace(-1, 1, 9))
    np.testing.assert_allclose(MODELS["with extinction"](500.0), BK7.index(500.0) + 0.2j)


def test_a_table_never_extrapolates():
    outside = TABLE(np.array([399.9, 400.0, 800.0, 800.1]))
    np.testing.assert_array_equal(np.isnan(outside), [True, False, False, True])


@pytest.mark.parametrize(
    ("model", "transparent"),
    [
        (Constant(1.46), True),
        (Constant(1.46, 0.0), False),  # an extinction that is 0 today may be free
        (Cauchy(1.45), True),
        (BK7, True),
        (Table([400.0, 800.0], [1.5, 1.4]), True),
        (TABLE, False),
        (Shifted(BK7, 0.1), True),
        (Shifted(BK7, None, 0.1), False),
        (Shifted(TABLE), False),
        (WithExtinction(BK7, Constant(0.0, 0.1)), False),
    ],
)
def test_the_type_says_whether_it_may_absorb(model, transparent):
    assert is_real(model.index(WAVELENGTH)) is transparent


@EVERY_MODEL
def test_precision_follows_the_wavelength(model):
    assert model(np.float32(500)).dtype == np.complex64
    assert model(WAVELENGTH).dtype == np.complex128
    assert real(model.index(jnp.float32(500))).dtype == np.float32
    np.testing.assert_allclose(model(np.float32(500)), model(500.0), rtol=1e-6)


@EVERY_MODEL
def test_gradients_in_every_parameter_and_in_wavelength(model):
    """Against central differences, under jit; away from the knots of a table."""
    at = np.array([430.0, 530.0, 660.0])
    leaves, structure = jax.tree.flatten(jax.tree.map(jnp.asarray, model))

    def value(leaves, at):
        index = jax.tree.unflatten(structure, leaves).index(at)
        return jnp.sum(jnp.sin(real(index)) + jnp.cos(3 * imag(index)))

    slopes, along = jax.jit(jax.grad(value, argnums=(0, 1)))(leaves, at)
    numeric = derivative(lambda at: value(leaves, at), at, 1e-3)
    assert float(jnp.sum(along)) == pytest.approx(float(numeric), rel=1e-5, abs=1e-9)
    # every parameter scaled together
    numeric = derivative(lambda scale: value([x * scale for x in leaves], at), 1.0, 1e-6)
    found = sum(jnp.sum(g * x) for g, x in zip(slopes, leaves, strict=True))
    assert float(found) == pytest.approx(float(numeric), rel=1e-6)


def test_gradient_of_a_tables_values():
    """An interpolated value moves with its two neighbours, in proportion."""

    def n(values):
        return Table([400.0, 500.0, 800.0], values).index(425.0)

    np.testing.assert_allclose(jax.grad(n)(jnp.array([1.5, 1.4, 1.3])), [0.75, 0.25, 0.0])


def test_sampled_gives_the_samples_and_their_slope():
    n, slope = jax.jvp(BK7.index, (WAVELENGTH,), (np.ones_like(WAVELENGTH),))
    same = Tabulated(WAVELENGTH, n, slope)
    found, rate = jax.jvp(same.index, (WAVELENGTH,), (np.ones_like(WAVELENGTH),))
    np.testing.assert_array_equal(found, n)
    np.testing.assert_array_equal(rate, slope)
    _, none = jax.jvp(Tabulated(WAVELENGTH, n, None).index, (WAVELENGTH,), (np.ones_like(WAVELENGTH),))
    np.testing.assert_array_equal(none, 0)


def test_sampled_absorption():
    index = TABLE.index(WAVELENGTH)
    same = Tabulated(WAVELENGTH, index, Pair(0 * WAVELENGTH, 0 * WAVELENGTH))
    np.testing.assert_array_equal(same(WAVELENGTH), to_complex(index))
