"""Measurements that are not made yet, against the tmm package and least squares by hand."""

from typing import Any

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

import pellicle as pl
from pellicle.errors import UsageError
from pellicle.fitting.planned_measurement import ExpectedError, MeasurementPlan, PlannedMeasurement

from ..by_tmm import films, ncs, psi_delta

NM, SUBSTRATE = np.linspace(400.0, 800.0, 128), 3.9 + 0.02j
NOISE, DEGREES = 2e-4, 0.1
EXACT = pl.Uncertainty.none()


def scene(index, thickness, substrate=SUBSTRATE):
    return pl.Scene(pl.Layer(index, pl.Free(50, 500, start=thickness)), substrate, uncertainty=EXACT)


def by_tmm(index, thickness, signal, angle):
    indices = [1.0, index, SUBSTRATE]
    if signal == "R":
        return films("sp", NM, indices, [thickness], angle)[:, None] / NOISE
    n, c, s = ncs(NM, indices, [thickness], angle).T
    return np.stack(psi_delta(n, c, s), axis=1) / DEGREES


@pytest.fixture(scope="module")
def plan():
    """What tells 1.600 from 1.604, whose optical thickness is the same."""
    rivals = {"low": scene(1.600, 150.0), "high": scene(1.604, 149.6)}
    signals = "R", "psi-delta"
    about = {
        "angles": (0.0, 70.0),
        "polarisations": ["unpolarised"],
        "noise": NOISE,
        "noise_degrees": DEGREES,
    }
    return pl.plan_measurement(rivals, NM, signals=signals, **about)


@pytest.mark.slow
@pytest.mark.parametrize(("signal", "angle"), [("R", 0.0), ("R", 70.0), ("psi-delta", 70.0)])
def test_evidence_is_half_of_the_misfit_that_a_refit_leaves(plan, signal, angle):
    def left(true, other):
        data, (index, depth) = by_tmm(true[0], true[1], signal, angle), other
        found: Any = minimize_scalar(
            lambda d: float(np.sum((by_tmm(index, d, signal, angle) - data) ** 2)),
            bounds=(depth - 15, depth + 15),
            method="bounded",
            options={"xatol": 1e-3, "maxiter": 30},
        )
        return found.fun / 2

    least = min(left((1.600, 150.0), (1.604, 149.6)), left((1.604, 149.6), (1.600, 150.0)))
    [found] = [
        m
        for m in plan.measurements
        if (m.signal, m.angle) == (signal, angle) and not m.wider and m.times == 1
    ]
    # the posteriors of the thickness are not quite equally wide
    assert found.delta_ln_z == pytest.approx(least, rel=0.02, abs=0.05)
    assert set(found.between) == {"low", "high"}


def test_the_most_decisive_measurement_is_first_and_in_the_verdict(plan):
    numbers = [m.delta_ln_z for m in plan.measurements]
    assert numbers == sorted(numbers, reverse=True)
    assert plan.verdict.startswith(f"would decide: {plan.measurements[0].name} (Δ ln Z ")
    assert plan.would_decide[0]["delta_ln_z"] == numbers[0]
    assert any(m.times == 2 for m in plan.measurements)
    assert plan.report().count("\n") > len(numbers)
    assert plan.not_tried == ()
    # the best angle of a wider range is not that of the given one
    assert {(m.signal, m.angle) for m in plan.measurements if m.wider} == {
        ("R", 0.0),
        ("R", 70.0),
        ("psi-delta", 70.0),
    }


def test_error_of_a_thickness_by_noise_is_that_of_its_slope():
    plan = pl.plan_measurement(scene(1.6, 150.0), NM, signals=["R"], angles=[0.0], noise=NOISE)
    slope = (by_tmm(1.6, 150.01, "R", 0.0) - by_tmm(1.6, 149.99, "R", 0.0)) / 0.02
    m, wider = plan.measurements
    expected = 1 / np.sqrt(np.sum(slope**2))
    assert m.errors["thickness"].stderr_noise == pytest.approx(expected, rel=1e-4)
    assert m.errors["thickness"].stderr == pytest.approx(expected, rel=1e-4)  # nothing else is uncertain
    assert (wider.lower, wider.upper) == (240.0, 1700.0)
    assert plan.best["thickness"].errors["thickness"].stderr == min(
        x.errors["thickness"].stderr for x in (m, wider)
    )
    assert plan.verdict.startswith("best: thickness ± ")


def test_words_of_a_plan():
    def of(signal, angle, value, **more):
        return PlannedMeasurement(signal, angle, "unpolarised", 400.0, 900.0, 0.1, delta_ln_z=value, **more)

    every = of("psi-delta", 65.0, 5812.0), of("psi-delta", 70.0, 900.0), of("R", 60.0, 0.4)
    plan = MeasurementPlan(("a", "b"), every)
    assert plan.verdict == "would decide: ψ and Δ at 65° (Δ ln Z 5800); R at 60° (0.4) does not"
    assert [row["signal"] for row in plan.would_decide] == ["psi-delta"]
    none = MeasurementPlan(("a", "b"), (of("R", 0.0, 3.0, wider=True), of("R", 0.0, 1.0, times=2.0)))
    assert none.verdict == (
        "none of these measurements would decide; the best are R at 0° from 400 to 900 nm (3.0) and"
        " R at 0° of a film 2 times as thick (1.0)"
    )
    blind = of("R", 0.0, None, errors={"A": ExpectedError(np.inf, np.inf, "")})
    assert MeasurementPlan(("a",), (blind,)).verdict == "no measurement determines a free number"


def test_bad_input_in_one_sentence(refuses):
    one = scene(1.6, 150.0)
    refuses(
        UsageError, "`signals` must be among R, T, psi-delta", pl.plan_measurement, one, NM, signals=["B"]
    )
    refuses(UsageError, "`polarisations` must be", pl.plan_measurement, one, NM, polarisations=["x"])
    fixed = pl.Scene(pl.Layer(1.5, 100.0), SUBSTRATE)
    refuses(UsageError, "nothing is free", pl.plan_measurement, fixed, NM)
    narrow = pl.Scene(pl.Layer("SU-8", pl.Free(10, 900)), "Si")
    refuses(UsageError, "share none of these wavelengths", pl.plan_measurement, narrow, [200.0, 220.0])
