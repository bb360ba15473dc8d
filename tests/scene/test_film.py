"""Scenes: free parameters and their bounds, words for numbers, and what is refused."""

import math

import numpy as np
import pytest

import pellicle as pl
from pellicle.dispersion.empirical import Constant
from pellicle.scene.film import with_wavelength
from pellicle.scene.free import free_leaves, insert, start_values
from pellicle.scene.instrument import ONE_NUMBER, SLOW_OFFSET, SLOW_SCALE
from pellicle.scene.layers import absorbs, medium

FREE = pl.Free(10, 3000)


def scene(**changes):
    parts = {"layers": pl.Layer(1.46, FREE), "substrate": 3.9 + 0.02j} | changes
    return pl.Scene(**parts)


def test_a_free_number_starts_in_the_middle_unless_told():
    starts = [FREE.start, pl.Free(10, 30, start=20).start, pl.Free(10, 30, start=10).start]
    assert starts == [1505, 20, 10]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"lower": 20, "upper": 10}, "bounds are reversed or equal: lower 20 is not below upper 10"),
        ({"lower": 10, "upper": 10}, "bounds are reversed or equal: lower 10 is not below upper 10"),
        ({"lower": math.nan, "upper": 10}, "bounds are reversed or equal"),
        ({"lower": 20, "upper": math.inf}, "a free parameter needs two finite bounds: give lower and upper"),
        ({"start": 5, "lower": 10, "upper": 20}, "the start value 5 is outside its bounds 10 to 20"),
        ({"start": math.nan, "lower": 10, "upper": 20}, "the start value nan is outside its bounds"),
    ],
)
def test_impossible_bounds_are_refused(arguments, message, refuses):
    refuses(ValueError, message, pl.Free, **arguments)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: pl.priors.Normal(1.0, 0.0), "a prior's standard deviation must be positive, not 0"),
        (lambda: pl.Layer(1.46, -5), "`thickness` must not be negative, got -5 nm"),
        (lambda: pl.Layer(1.46, pl.Free(-5, 5)), "`thickness` must not be negative, got -5 nm"),
        (lambda: pl.Layer(1.46 - 0.1j, 5), "negative imaginary part, which is gain"),
        (lambda: pl.Layer("Unobtainium", 5), "Unobtainium"),
        (lambda: pl.Layer("cauchy", 100.0), r"'cauchy' is a dispersion model.* pl\.dispersion\.Cauchy"),
        (lambda: pl.Layer("tauc-lorentz", 5), r"give pl\.dispersion\.TaucLorentz\(\.\.\.\), with pl\.Free"),
        (lambda: pl.Layer("cauchy(1.4,3000)", 5), r"pl\.dispersion\.Cauchy"),
        (lambda: pl.Layer(-1.46, 5), "index -1.46 has a negative real part"),
        (lambda: pl.Layer(0.0, 5), "index 0 is that of no medium"),
        (lambda: pl.Layer(math.nan, 5), "index nan is not finite"),
        (lambda: pl.Layer(1.46, math.inf), "`thickness` must be finite, got inf"),
        (lambda: pl.Instrument(scale=FREE), "`scale` has no bounds: give 'free', 'slow' or a number"),
        (lambda: pl.Substrate(1.5, "air", -1), "`plate_mm` must not be negative, got -1 mm"),
        (lambda: pl.Substrate(1.5, "air", 0.0), "`plate_mm` must be above 0 mm"),
        (lambda: pl.Plate(1.5, 0), "`plate_mm` must be above 0 mm"),
        (
            lambda: pl.Light(signal="A"),
            "`signal` must be one of R, T, psi-delta, mueller, generalised-psi-delta, contrast, not 'A'",
        ),
        (lambda: pl.Light(polarisation="TE"), "`polarisation` must be one of unpolarised, s, p, not 'TE'"),
        (lambda: pl.Light(angle=95), "`angle` of incidence must lie in 0 to 90 degrees, got 95"),
        (lambda: pl.Light(angle=np.array([0.0, -5.0])), "must lie in 0 to 90 degrees, got -5"),
        (lambda: pl.Light(angle=pl.Free(80, 91)), "must lie in 0 to 90 degrees, got 91"),
        (lambda: pl.Instrument(scale="often"), "`scale` must be 'free', 'slow' or a number, not 'often'"),
        (lambda: pl.Instrument(offset="never"), "`offset` must be 'free', 'slow' or a number, not 'never'"),
        (lambda: pl.Instrument(bandwidth=-1), "`bandwidth` must not be negative, got -1 nm"),
        (lambda: pl.Instrument(thickness_spread=-1), "`thickness_spread` must not be negative, got -1 nm"),
        (lambda: scene(layers=[]), "a scene needs at least one layer"),
        (lambda: scene(layers=[pl.Layer(n, FREE, name="a") for n in (1.4, 1.5)]), "named 'a'"),
        (
            lambda: scene(layers=[pl.Layer(1.5, 1)] * 2, instrument=pl.Instrument(thickness_spread=1.0)),
            "with several layers give each its own `thickness_spread`",
        ),
        (lambda: scene(ambient=1.33 + 0.1j), "the ambient must not absorb: give it a real index"),
        (lambda: scene(ambient="Au"), "the ambient must not absorb: give it a real index"),
        (lambda: scene(ambient=np.array(1.33 + 0.1j)), "the ambient must not absorb"),
        (lambda: scene(ambient=pl.dispersion.Constant(1.33, FREE)), "the ambient must not absorb"),
    ],
)
def test_impossible_scenes_are_refused(make, message, refuses):
    refuses(ValueError, message, make)


def test_words_stand_for_linear_nuisances():
    instrument = pl.Instrument(scale="slow", offset="free")
    assert (instrument.scale, instrument.offset) == (SLOW_SCALE, ONE_NUMBER)
    assert pl.Instrument(offset="slow").offset == SLOW_OFFSET
    assert (pl.Instrument().scale, pl.Instrument(scale=1.1).scale) == (1.0, 1.1)
    assert SLOW_SCALE.degree > SLOW_OFFSET.degree > ONE_NUMBER.degree == 0


def test_free_parameters_are_found_and_filled_in_the_same_order():
    thing = scene(
        layers=pl.Layer(pl.dispersion.Constant(pl.Free(1, 2), pl.Free(0, 1)), FREE),
        instrument=pl.Instrument(bandwidth=pl.Free(0, 20)),
    )
    found = free_leaves(thing)
    assert [free.upper for _, free in found] == [2, 1, 3000, 20]
    np.testing.assert_array_equal(start_values(thing), [1.5, 0.5, 1505, 10])
    filled = insert(thing, [1.0, 2.0, 3.0, 4.0])
    assert (filled.layers[0].material.n, filled.layers[0].material.k) == (1.0, 2.0)
    assert (filled.layers[0].thickness, filled.instrument.bandwidth) == (3.0, 4.0)
    assert free_leaves(filled) == []
    assert len(free_leaves(thing)) == 4  # the scene itself is unchanged


def test_a_medium_is_a_number_a_name_or_a_material():
    assert medium(1.46) == Constant(1.46)
    assert medium(2.9 + 0.1j) == Constant(2.9, 0.1)
    assert medium(np.complex128(2.9 + 0.1j)) == Constant(2.9, 0.1)
    assert medium(FREE).n is FREE
    assert medium("SiO2").name == "SiO2"
    material = pl.dispersion.Cauchy(1.45)
    assert medium(material) is material
    plate = scene(substrate=pl.Substrate("SiO2", back="air")).substrate
    assert (plate.plate_mm, plate.back.name, scene().substrate.back) == (1.0, "air", None)


@pytest.mark.parametrize(
    ("material", "does"),
    [
        (1.46, False),
        (1.46 + 0.1j, True),
        (1.46 + 0j, False),
        (complex(1.46, -0.0), False),
        (np.array(1.46 + 0.1j), True),
        (pl.dispersion.Constant(1.46, 0), False),
        (pl.dispersion.Constant(1.46, pl.Free(0, 1, start=0.0)), True),
        (pl.dispersion.Shifted(pl.dispersion.Constant(1.46), None, pl.Free(0, 1, start=0.0)), True),
        (pl.dispersion.Cauchy(FREE), False),
        ("Si", True),
        ("air", False),
    ],
)
def test_absorption_is_judged_from_types_and_not_from_values(material, does):
    assert absorbs(medium(material)) is does


def test_looking_at_other_wavelengths():
    first = scene(light=pl.Light(angle=30, signal="T", polarisation="p"))
    other = with_wavelength(first, np.array([500.0, 600.0]))
    assert (other.light.angle, other.light.signal, other.light.polarisation) == (30, "T", "p")
    np.testing.assert_array_equal(other.light.wavelength, [500, 600])
    angles = np.array([10.0, 20.0])
    assert with_wavelength(first, np.array([500.0, 600.0]), angles).light.angle is angles
