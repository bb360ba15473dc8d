"""Profiles and graded media: faces, bounds, the mean over depth, and what is refused."""

import jax
import numpy as np
import pytest

import pellicle as pl
from pellicle.dispersion.profiles import PROFILES
from pellicle.errors import UsageError
from pellicle.optics.pair import real

from ..differences import jacobian

NM = np.array([400.0, 600.0])
ENDS = {
    "linear": (pl.profile.Linear(0.1, 0.8), 0.1, 0.8),
    "exponential": (pl.profile.Exponential(0.1, 0.8, 0.2), 0.1, 0.8),
    "exponential upwards": (pl.profile.Exponential(0.1, 0.8, -0.01), 0.1, 0.8),
    "power": (pl.profile.Power(0.1, 0.8, 2.5), 0.1, 0.8),
    "spline": (pl.profile.Spline([0.1, 0.9, 0.3, 0.8]), 0.1, 0.8),
    "spline of two": (pl.profile.Spline([0.1, 0.8]), 0.1, 0.8),
    "sine": (pl.profile.Sine(0.5, 0.4, 3.25), 0.5, 0.9),
}


@pytest.mark.parametrize("name", ENDS)
def test_a_profile_has_its_values_at_the_faces_and_stays_within_them(name):
    profile, top, bottom = ENDS[name]
    z = np.linspace(0, 1, 101)
    f = np.asarray(profile.fraction(z))
    assert f[[0, -1]] == pytest.approx([top, bottom], abs=1e-12)
    assert np.all((f >= 0) & (f <= 1))


def test_profiles_by_their_formulas():
    z = np.array([0.3, 0.7])
    decay = (1 - np.exp(-z / 0.2)) / (1 - np.exp(-5.0))
    assert pl.profile.Exponential(0.0, 1.0, 0.2).fraction(z) == pytest.approx(decay, rel=1e-14)
    assert pl.profile.Exponential(1.0, 0.0, -0.2).fraction(1 - z) == pytest.approx(decay, rel=1e-13)
    assert pl.profile.Exponential(0.0, 1.0, 1e6).fraction(z) == pytest.approx(z, rel=1e-5)
    assert pl.profile.Power(0.0, 1.0, 3.0).fraction(z) == pytest.approx(z**3)
    sites = pl.profile.Spline(6 * [0.5]).sites
    assert pl.profile.Spline(sites).fraction(z) == pytest.approx(z, abs=1e-14)


@pytest.mark.parametrize(
    ("kind", "numbers"),
    [(pl.profile.Power, [0.1, 0.9, 0.5]), (pl.profile.Exponential, [0.1, 0.9, -0.02])],
)
def test_slopes_of_a_profile_also_at_its_upper_face(kind, numbers):
    def fractions(numbers):
        leaves, structure = jax.tree.flatten(kind(0.1, 0.9, -0.5 if kind is pl.profile.Exponential else 0.5))
        assert len(leaves) == 3
        return jax.tree.unflatten(structure, list(numbers)).fraction(np.array([0.0, 0.5]))

    expected = jacobian(fractions, np.array(numbers), 1e-6)
    np.testing.assert_allclose(jax.jacfwd(fractions)(np.array(numbers)), expected, rtol=1e-6, atol=1e-9)


def test_a_graded_medium_follows_its_mixing_rule():
    mean = pl.Graded(1.5, 2.0, mix="linear").index(NM)
    assert real(mean) == pytest.approx(np.sqrt(0.5 * (1.5**2 + 2.0**2)), rel=1e-12)
    graded = pl.Graded("SiO2", "Si3N4", pl.profile.Linear(0.2, 0.6), mix="looyenga")
    found = graded.at(np.array([0.0, 0.5]), NM)
    for row, fraction in zip(np.asarray(found), (0.2, 0.4), strict=True):
        mixed = pl.mixing.Looyenga(pl.material("SiO2"), pl.material("Si3N4"), fraction)
        assert row == pytest.approx(np.asarray(mixed(NM)).real, rel=1e-6)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: pl.profile.Linear(-0.1, 0.5), "`top` is a volume fraction"),
        (lambda: pl.profile.Linear(0.0, pl.Free(0.5, 1.5)), "`bottom` is a volume fraction"),
        (lambda: pl.profile.Exponential(0.0, 1.0, pl.Free(-1, 1)), "`length`"),
        (lambda: pl.profile.Power(0.0, 1.0, 0.0), "`exponent` must be above 0"),
        (lambda: pl.profile.Spline([0.5]), "two or more"),
        (lambda: pl.profile.Spline([0.5, 0.6], [0.0, 0.9]), "from 0 to 1"),
        (lambda: pl.profile.Sine(0.5, 0.6), "mean ± amplitude"),
        (lambda: pl.Graded(1.5, 2.0, mix="cubic"), "no mix 'cubic'"),
        (lambda: pl.Graded(1.5, 2.0, "linear"), "pl.profile.Linear"),
        (lambda: pl.Graded(pl.Graded(1.5, 2.0), 2.0), "stack graded layers"),
        (lambda: pl.Scene(pl.Layer(1.5, 9.0), pl.Graded(1.5, 2.0)), "material of a pl.Layer"),
        (lambda: pl.Scene(pl.Plate(pl.Graded(1.5, 2.0)), 1.5), "material of a pl.Layer"),
    ],
)
def test_refusals(make, message, refuses):
    refuses((ValueError, UsageError), message, make)


def test_every_profile_has_a_name():
    assert set(PROFILES) == {"linear", "exponential", "power", "spline", "sine"}
