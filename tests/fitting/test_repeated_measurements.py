"""Scatter of repeated measurements: examples of the GUM (JCGM 100:2008), by hand, by simulation."""

import math
from typing import Any

import numpy as np
import pytest

import pellicle as pl
from pellicle.errors import UsageError
from pellicle.fitting.curves import Curve
from pellicle.fitting.repeated_measurements import Agreement, RepeatedParameter
from pellicle.fitting.result import Estimate, Fit, Part, Rival, Status
from tests.made_fits import made_fit


def parameter(values, noise: Any = 1.0, common=0.0):
    errors = tuple(np.broadcast_to(noise, len(values)).tolist())
    return RepeatedParameter("thickness", "nm", tuple(map(float, values)), errors, common)


def fit(value, noise=0.2, path="", status=Status.CONVERGED, stderr=None, rivals=(), **others) -> Fit:
    """A fit of which only its thickness and its data are looked at."""
    nm = np.linspace(400.0, 800.0, 5)
    data = np.full(5, value % 1)
    curve = Curve(nm, data, data, data, nm, nm, nm, nm)
    whole = noise if stderr is None else stderr
    estimate = Estimate("thickness", value, whole, "nm", 10, 3000, True, stderr_noise=noise)
    plan = pl.plan(pl.Scene(pl.Layer(1.46, 100.0), 3.9))
    part = Part("", pl.Spectrum(nm, data, "R", path=path), curve, plan, 0.0, 1.0, 5.0)
    return made_fit(part, parameters=(estimate, *others.values()), status=status, rivals=rivals)


TEMPERATURES = (
    *(96.90, 98.18, 98.25, 98.61, 99.03, 99.49, 99.56, 99.74, 99.89, 100.07, 100.33, 100.42, 100.68),
    *(100.95, 101.11, 101.20, 101.57, 101.84, 102.36, 102.72),
)
"""GUM 4.4.3: table 1; the standard deviation is 1.489."""


@pytest.mark.parametrize(
    ("values", "mean", "sd_mean"),
    [
        (TEMPERATURES, "100.145", "0.333"),
        # GUM table H.2: voltage, current, phase, as printed
        ((5.007, 4.994, 5.005, 4.990, 4.999), "4.9990", "0.0032"),
        ((19.663, 19.639, 19.640, 19.685, 19.678), "19.6610", "0.0095"),
        ((1.0456, 1.0438, 1.0468, 1.0428, 1.0433), "1.04446", "0.00075"),
    ],
)
def test_mean_and_its_standard_deviation(values, mean, sd_mean):
    found = parameter(values)
    assert f"{found.mean:.{len(mean.split('.')[1])}f}" == mean
    assert f"{found.sd_mean:.{len(sd_mean.split('.')[1])}f}" == sd_mean
    assert found.freedom == len(values) - 1
    assert found.sd == pytest.approx(found.sd_mean * np.sqrt(len(values)))


@pytest.mark.parametrize(
    ("n", "percent"), [(2, 76), (3, 52), (4, 42), (5, 36), (10, 24), (20, 16), (30, 13), (50, 10)]
)
def test_standard_deviations_of_few_values_are_uncertain(n, percent):
    """GUM table E.1."""
    assert round(100 * parameter(np.arange(n)).sd_uncertainty) == percent


def test_chi_square_by_hand():
    """10 ± 1 and 13 ± 2: the weighted mean is 10.6, χ² is 0.6² + 2.4²/4 = 1.8, on one degree of freedom; and
    two values 2 standard errors apart have the probability erfc(1)."""
    assert parameter((10.0, 13.0), (1.0, 2.0)).chi2 == pytest.approx(1.8)
    apart = parameter((10.0, 12.0))
    assert apart.chi2 == pytest.approx(2.0)
    assert apart.ratio == pytest.approx(math.sqrt(2.0))
    assert apart.probability == pytest.approx(math.erfc(1.0))


def test_types_a_and_b_combined():
    """A standard deviation of the mean of 1 on 4 degrees of freedom, beside 1 of type B: √2 on 16 (eq. G.2b),
    whose factor for 95 % is 2.12 (GUM table G.2). Without type B it is 2.78 on 4."""
    five = np.array([-1.0, -0.5, 0.0, 0.5, 1.0])
    five *= math.sqrt(5) / np.std(five, ddof=1)
    both, alone = parameter(five, common=1.0), parameter(five)
    assert both.stderr == pytest.approx(math.sqrt(2.0))
    assert both.effective_freedom == pytest.approx(16.0)
    assert round(both.coverage_factor, 2) == 2.12
    assert round(alone.coverage_factor, 2) == 2.78
    assert both.expanded == pytest.approx(both.coverage_factor * math.sqrt(2.0))


@pytest.mark.parametrize(
    ("values", "agreement", "words"),
    [
        ((123.1, 123.4, 123.3), Agreement.AGREES, "the stated noise error agrees with the scatter"),
        ((122.5, 123.4, 124.1), Agreement.LARGER, "the stated noise error is too small"),
        ((123.4, 123.41, 123.42), Agreement.SMALLER, "the remainder is common to all of them"),
    ],
)
def test_verdicts(values, agreement, words):
    found = pl.fitting.repeats([fit(value) for value in values])
    assert found["thickness"].agreement is agreement
    assert words in found.verdict
    assert found.verdict.startswith("3 repeats: thickness 123.")
    assert found.warnings == ()


def test_effects_that_repeats_share_remain():
    """An error of 0.5, of which 0.3 is noise, leaves 0.4, whatever the number of repeats."""
    found = pl.fitting.repeats([fit(100 + x, 0.3, stderr=0.5) for x in (0.0, 0.3, 0.5, -0.2)])
    thickness = found["thickness"]
    assert thickness.noise == (0.3,) * 4
    assert thickness.common == pytest.approx(0.4)
    assert "With 0.4 nm from effects that all repeats share" in found.verdict


def test_the_whole_stated_error_may_cover_the_scatter():
    """A wavelength error of each spectrum scatters, and is no noise: stated it was, nevertheless."""
    values = (122.5, 123.4, 124.1)
    covered = pl.fitting.repeats([fit(value, stderr=1.0) for value in values]).verdict
    assert "too small, though the whole stated error, 1 nm, covers the scatter." in covered
    assert "covers the scatter" not in pl.fitting.repeats([fit(x, stderr=0.5) for x in values]).verdict


def test_what_does_not_scatter_remains():
    """Stated errors of 0.2 and values that agree within 0.01: nearly all of the 0.2 is shared."""
    thickness = pl.fitting.repeats([fit(value) for value in (123.4, 123.41, 123.42)])["thickness"]
    assert thickness.stderr == pytest.approx(math.sqrt(0.2**2 - 0.01**2 + 0.01**2 / 3))


def test_fits_that_are_no_use_are_left_out_and_named():
    good = [fit(100.0, path="a"), fit(100.3, path="b")]
    wrong = fit(250.5, path="c", status=Status.MISFIT)
    found = pl.fitting.repeats([good[0], wrong, good[1], fit(100.0, path="copy")])
    assert found["thickness"].values == (100.0, 100.3)
    misfit, copy = "c is left out: its fit is misfit", "copy is left out: it holds the same numbers as a"
    assert found.warnings == (misfit, copy)
    with pytest.raises(UsageError, match=r"two usable fits or more, and 1 of 2 are; c is left out"):
        pl.fitting.repeats([good[0], wrong])


def test_parameters_without_an_error_are_not_compared():
    seen = Estimate("k", 0.0, math.inf, "", 0.0, 1.0, True)
    fixed = Estimate("n", 1.46, 0.0, "", 1.46, 1.46, False)
    found = pl.fitting.repeats([fit(100.0, k=seen, n=fixed), fit(100.3, k=seen, n=fixed)])
    assert list(found.parameters) == ["thickness"]
    assert found.uncompared == ("k",)
    resting = Estimate("A", 1.3, 0.1, "", 1.3, 1.7, True, at_bound=True)
    second = fit(100.3, A=resting, status=Status.AT_BOUND, path="b")
    found = pl.fitting.repeats([fit(100.0, A=resting), second])
    assert found.uncompared == ("A",)
    assert found.warnings == ("b: its fit is at-bound",)
    with pytest.raises(UsageError, match="no parameter has a finite error"):
        pl.fitting.repeats([fit(100.0, math.inf), fit(100.3, math.inf)])


def test_another_order_of_interference_is_named():
    rivals = Rival({"thickness": 3494.1}, 2.1), Rival({"thickness": 800.0}, 9.0)
    [warning] = pl.fitting.repeats([fit(3494.0), fit(3493.9), fit(357.3, path="c", rivals=rivals)]).warnings
    words = "c lies in another minimum: thickness 357.3 nm, while its rival of 3494.1 nm (Δχ² 2.1)"
    assert warning.startswith(words)


@pytest.mark.parametrize(("last", "named"), [(512.6, True), (500.1, False)])
def test_the_one_repeat_that_disagrees_is_named(last, named):
    values = (500.0, 500.2, 499.8, 500.3, 499.9, last)
    found = pl.fitting.repeats([fit(value, path=f"{i}.csv") for i, value in enumerate(values)])
    sentences = [w for w in found.warnings if "alone disagrees" in w]
    assert [w[:5] for w in sentences] == (["5.csv"] if named else [])


def test_repeats_that_all_scatter_have_no_outlier():
    found = pl.fitting.repeats([fit(value, path=f"{value}.csv") for value in (490.1, 495.2, 500.3, 505.4)])
    assert not any("alone" in w for w in found.warnings)
