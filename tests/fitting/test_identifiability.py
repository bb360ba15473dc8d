"""Correlated and undetermined parameters, from Jacobians whose answer is known."""

import math

import numpy as np
import pytest

import pellicle as pl
from pellicle.fitting.covariance import Scaled
from pellicle.fitting.identifiability import bounded, correlated, naming, step
from pellicle.fitting.result import Estimate

NM = np.linspace(400.0, 900.0, 128)


def estimate(name, value, lower, upper, stderr=1.0, unit="", **more):
    return Estimate(name, value, stderr, unit, lower, upper, True, **more)


N = estimate("n", 1.5, 1.2, 2.0)
D = estimate("thickness", 480.0, 10.0, 1000.0, unit="nm")
SCALE = estimate("instrument.scale", 1.0, -math.inf, math.inf)
OFFSET = estimate("instrument.offset_1", 0.0, -math.inf, math.inf)


def of_columns(noise, **columns):
    """A problem whose model has these derivatives, in each parameter's own unit."""
    names = tuple(columns)
    return Scaled(np.column_stack(list(columns.values())) / noise, np.eye(len(names)), names)


def fringes(noise, share=0.0):
    """cos(4π n d/λ), which depends on n·d alone, and a `share` of n's own."""
    phase = 4 * np.pi * N.value * D.value / NM
    by_product = -np.sin(phase) * 4 * np.pi / NM
    return of_columns(noise, n=by_product * D.value + share * np.cos(phase), thickness=by_product * N.value)


def test_only_the_product_is_determined():
    """d n/n = −d d/d: 0.01 of 1.5 is 3.2 nm of 480."""
    [sentence] = correlated(fringes(0.01), {"n": N, "thickness": D})
    assert sentence == (
        "only the product n·thickness is determined: n and thickness are correlated, 0.01 against 3.2 nm"
    )


def test_parameters_that_are_known_well_enough_are_not_named():
    """Correlated too, but the error of n is 0.001, below its meaningful step."""
    assert correlated(fringes(0.01, share=10.0), {"n": N, "thickness": D}) == []


def test_only_the_quotient_is_determined():
    column = np.cos(NM / 50)
    jacobian = of_columns(0.01, n=column / D.value, thickness=-column * N.value / D.value**2)
    [sentence] = correlated(jacobian, {"n": N, "thickness": D})
    assert sentence.startswith("only the quotient n/thickness is determined")


def test_another_direction_is_given_in_words():
    column = np.cos(NM / 50)
    [sentence] = correlated(of_columns(0.01, n=column, thickness=-column / 100), {"n": N, "thickness": D})
    assert sentence == (
        "n and thickness are strongly correlated, 0.01 against 1 nm (one rises as the other does):"
        " neither is determined alone"
    )


def test_two_parameters_without_effect_are_not_correlated():
    """Both columns are zero: no combination is better determined than any other."""
    assert correlated(of_columns(0.01, n=0.0 * NM, thickness=0.0 * NM), {"n": N, "thickness": D}) == []


def test_three_together():
    a, b = np.cos(NM / 50), np.sin(NM / 50)
    jacobian = of_columns(0.001, A=a, B=b * 1e-3, thickness=(a + b) / 100)
    names = {"A": estimate("A", 1.5, 1.2, 2.0), "B": estimate("B", 100.0, 0.0, 5000.0), "thickness": D}
    [sentence] = correlated(jacobian, names)
    assert sentence == "A, B and thickness are strongly correlated: none of them is determined alone"


def test_scale_and_offset_are_eliminated_and_named_apart():
    column = np.cos(NM / 50)
    jacobian = of_columns(
        0.001, n=column, **{"instrument.scale": 2 * column, "instrument.offset_1": NM / 900}
    )
    names = {"n": N, "instrument.scale": SCALE, "instrument.offset_1": OFFSET}
    [sentence] = correlated(jacobian, names)
    assert sentence == "n would be known far better with a known scale and offset of the instrument"
    assert correlated(of_columns(0.001, n=column, **{"instrument.scale": NM / 900}), names) == []


@pytest.mark.slow  # compiles a scene of its own
def test_a_product_in_a_real_fit(film, measured):
    """Two weak reflections of unknown scale and offset: a + b cos(4π n d/λ) shows n·d and nothing else."""
    index, glass = pl.dispersion.Constant(pl.Free(1.3, 1.7)), pl.dispersion.Constant(1.52)
    scene = film(pl.Free(10, 2000), index, substrate=glass, instrument=pl.Instrument("free", "free"))
    fit = pl.fit(measured(scene, 1.46, 1000.0, noise=1e-3, sigma=True), scene)
    assert "only the product n·thickness is determined" in fit.verdict
    assert "0.01 against 6.8 nm" in fit.verdict  # 1000 · 0.01 / 1.46
    assert fit["n"].stderr == math.inf
    assert fit["instrument.offset"].upper_limit > 0


def test_meaningful_steps():
    for name, value, lower, upper, size in (
        ("thickness", 480.0, 10, 1000, 4.8),
        ("film.thickness", 20.0, 1, 100, 1.0),
        ("instrument.bandwidth.film_R", 2.0, 0, 20, 1.0),
        ("n", 1.5, 1.499, 1.501, 2e-5),  # 1 % of narrow bounds
        ("E0", 4.0, 1, 10, 0.09),
        ("n_g", 1.5, 1.05, 2.5, 0.01),
        ("exponent_reflection", 60.0, 1, 1000, 0.6),
        ("specular", 0.0, 0, 100, 0.01),
    ):
        assert step(name, estimate(name, value, lower, upper)) == pytest.approx(size)


THICK = estimate("au.thickness", 300.0, 1.0, 4000.0, math.inf, "nm", lower_limit=180.2)


@pytest.mark.parametrize(
    ("parameter", "opaque", "words"),
    [
        (D, (), []),
        (estimate("n", 1.5, 1.2, 2.0, math.inf), (), ["n may be anything between 1.2 and 2"]),
        (
            *(estimate("k", 0.0, 0.0, 1.0, 1e-4, upper_limit=2.04e-4), ()),
            ["k is compatible with 0: it is at most 0.0002 (95 %)"],
        ),
        (THICK, {"au.thickness"}, ["the layer is opaque: au.thickness is at least 180.2 nm (95 %)"]),
        (THICK, (), ["au.thickness is at least 180.2 nm (95 %)"]),
        # beside a bound that is not zero
        (
            *(estimate("roughness", 0.01, 0.003, 1.0, 0.01, upper_limit=0.0213), ()),
            ["roughness is compatible with 0.003: it is at most 0.021 (95 %)"],
        ),
        (
            *(estimate("exponent", 950.0, 1.0, 1000.0, 90.0, lower_limit=771.2), ()),
            ["exponent is compatible with 1000: it is at least 771.2 (95 %)"],
        ),
        (
            *(estimate("instrument.offset", 0.001, -math.inf, math.inf, 0.01, upper_limit=0.02), ()),
            ["instrument.offset is compatible with 0: it is at most 0.02 (95 %)"],
        ),
    ],
)
def test_wording_of_bounds(parameter, opaque, words):
    assert bounded({parameter.name: parameter}, opaque) == words


def test_sentences_that_name_the_leading_parameter():
    sentences = ["A and au.thickness are correlated", "n and thickness are correlated"]
    assert naming("thickness", sentences) == sentences[1:]
    assert naming("au.thickness", sentences) == sentences[:1]
