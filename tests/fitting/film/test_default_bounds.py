"""Default bounds: widened where the data want it, else a remark; bounds of the user stay."""

import dataclasses

import jax
import pytest

import pellicle as pl
from pellicle.fitting.film.parameters import anonymous
from pellicle.scene.free import free_leaves

INDEX = (1.0, 6.0)


def constant(lower, upper, limits=INDEX):
    return pl.dispersion.Constant(pl.Free(lower, upper, limits=limits))


def said(fit, words):
    return [warning for warning in fit.warnings if words in warning]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("n", "lower", "upper"),
    [
        (1.46, 1.2, 1.35),  # by two
        (1.46, 1.5, 1.8),  # downwards
        (1.15, 1.6, 2.3),  # downwards, where the best fit rests on the upper bound
    ],
)
def test_default_bounds_are_widened_where_the_data_want_it(film, measured, n, lower, upper):
    fit = pl.fit(measured(film(material=n), 430.0), film(material=constant(lower, upper)))
    assert fit.status is pl.Status.CONVERGED
    assert abs(fit["n"].value - n) < 4 * fit["n"].stderr
    assert abs(fit["thickness"].value - 430.0) < 4 * fit["thickness"].stderr
    [warning] = said(fit, "widened")
    assert f"n were widened from {lower:g} ... {upper:g} to {fit['n'].lower:g} ..." in warning
    [_, (_, free)] = sorted(free_leaves(fit.scene), key=lambda pair: pair[1].limits is not None)
    assert (free.lower, free.upper) == (fit["n"].lower, fit["n"].upper)


@pytest.mark.slow
def test_bounds_of_the_user_are_kept(film, measured):
    fit = pl.fit(measured(film(), 430.0), film(material=constant(1.2, 1.4, None)))
    assert fit.status in (pl.Status.AT_BOUND, pl.Status.MISFIT)
    assert (fit["n"].value, fit["n"].upper) == (1.4, 1.4)
    assert not said(fit, "widened")


def test_a_limit_of_physics_is_a_remark(film, measured):
    fit = pl.fit(measured(film(), 430.0), film(material=constant(1.2, 1.459, (1.2, 1.459))))
    assert fit["n"].value == fit["n"].upper == 1.459
    assert fit.status is pl.Status.CONVERGED
    assert said(fit, "n rests on 1.459, the largest value that physics allows")


def test_an_answer_that_runs_on_is_at_a_bound(film, measured):
    """Its thickness depends on where the bound is."""
    fit = pl.fit(measured(film(), 430.0), film(material=constant(1.2, 1.44, (1.2, 1.45))))
    assert fit["n"].value == fit["n"].upper == 1.44
    assert fit.status is pl.Status.AT_BOUND
    assert "lies on a default bound: n (1.44)" in fit.verdict
    assert said(fit, "the best fit rests on the default bounds of n, and within wider ones on their end")
    assert not said(fit, "n rests on")


def test_where_the_data_do_not_want_it_a_bound_is_a_remark(film, measured):
    """The truth lies on the bound, and noise on either side of it."""
    scene, found = film(material=constant(1.3, 1.46)), []
    for seed in range(1, 7):
        fit = pl.fit(measured(film(), 430.0, seed=seed), scene)
        assert fit.status is pl.Status.CONVERGED
        assert fit["n"].upper == 1.46
        assert not said(fit, "widened")
        found.append(bool(said(fit, "n rests on 1.46, a default bound: wider ones explain the data no")))
        assert found[-1] == (fit["n"].value == 1.46)
    assert set(found) == {True, False}


@pytest.mark.slow
def test_a_joint_fit_is_widened_as_one(film, measured):
    oblique = film(light=pl.Light(angle=50.0))
    data = [measured(film(), 430.0), measured(oblique, 430.0, seed=2)]
    data[1] = dataclasses.replace(data[1], path="oblique")
    narrow = constant(1.2, 1.4)
    fit = pl.fit(data, [film(material=narrow), film(material=narrow, light=pl.Light(angle=50.0))])
    assert fit.status is pl.Status.CONVERGED
    assert abs(fit["n"].value - 1.46) < 4 * fit["n"].stderr
    assert len(said(fit, "widened")) == 1
    first, second = fit.scene
    assert first.layers[0].material == second.layers[0].material
    assert first.layers[0].material.n.upper == fit["n"].upper > 1.46


def test_limits_make_no_new_program(film, refuses):
    media = constant(1.2, 1.4), constant(1.2, 1.4, None)
    marked, plain = (jax.tree_util.tree_structure(anonymous(film(material=m))) for m in media)
    assert marked == plain
    refuses(ValueError, r"bounds 0\.5 to 2 are outside 1 to 6", pl.Free, 0.5, 2.0, limits=INDEX)
