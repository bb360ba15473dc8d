"""A surface and samples of it as a problem: parameters, coordinates, and the baselines without a layer."""

import dataclasses

import numpy as np
import pytest

import pellicle as pl
from pellicle.fitting.brdf.problem import in_plane, incoherent, linear_count, make, restricted, without_layer
from pellicle.fitting.brdf.view import INVERSES, RESIDUALS, SLOPES, Local
from pellicle.fitting.coordinates import Coordinates
from pellicle.fitting.problem import Problem
from pellicle.scene.free import Free
from pellicle.scene.surface import Surface

from ...differences import derivative
from .conftest import TILTED, ones

ARC = np.arange(10.0, 60.0)


@pytest.fixture
def problem():
    """Return the problem of 50 samples at an incidence of 30 degrees, and of any surface."""

    def build(flat: bool = False, surface: Surface = TILTED, residual: str = "linear", **options) -> Problem:
        data = ones(30.0, 0.0, ARC, 180.0 if flat else np.arange(100.0, 150.0), **options)
        return make([data], [""], surface, [pl.plan(surface, directions=data)], residual)

    return build


def test_parameters_are_the_free_numbers_with_the_weights_last(problem):
    built = problem()
    names = ["thickness", "n_r", "n_g", "n_b", "exponent_reflection", "deviation", "azimuth", "specular"]
    assert [p.name for p in built.parameters] == names
    assert [p.key for p in built.parameters][1:4] == ["n"] * 3
    assert linear_count(built) == 1
    bounds = {p.name: (p.lower, p.upper) for p in built.parameters}
    assert bounds["n_g"] == (1.05, 2.5)
    assert bounds["azimuth"] == (-180, 180)
    first = Surface("granier-heidrich", {"specular": Free(0, 100), "diffuse": 0.1, "thickness": Free(0, 500)})
    assert [p.name for p in problem(surface=first).parameters] == ["thickness", "specular"]


def test_coordinates_span_the_bounds(problem):
    built = problem()
    for corner, ends in ((0.0, (0, 1.05, 1.05, 1.05, 1)), (1.0, (1000, 2.5, 2.5, 2.5, 1000))):
        values = built.values(np.full(8, corner))
        np.testing.assert_allclose(values[:5], ends, rtol=1e-12)
        assert values[5] == pytest.approx(20)  # the edge of the disc
    assert built.values(np.full(8, 0.5))[4] == pytest.approx(np.sqrt(1000))  # exponents go by their logarithm


def test_bounds_that_physics_sets(problem):
    natural = {p.name: p.natural for p in problem().parameters}
    assert natural["thickness"] == natural["deviation"] == natural["specular"] == (True, False)
    assert natural["exponent_reflection"] == (False, True)  # beyond it lies a mirror
    assert natural["n_r"] == natural["azimuth"] == (False, False)
    chosen = Surface("granier-heidrich", {"thickness": Free(5, 500), "exponent_reflection": Free(2, 900)})
    limits = {p.name: p.natural for p in problem(surface=chosen).parameters}
    assert limits == {"thickness": (False, False), "exponent_reflection": (False, True)}
    [rough] = problem(surface=Surface("microfacet-film", {"roughness": Free(0.003, 1)})).parameters
    assert rough.natural == (True, False)


@pytest.mark.parametrize(
    ("flat", "lowest", "natural"), [(False, -180.0, (False, False)), (True, 0.0, (True, True))]
)
def test_a_tilt_is_searched_in_a_disc_and_in_one_plane_in_half_of_it(problem, flat, lowest, natural):
    built = problem(flat)
    assert built.coordinates == Coordinates((False,) * 4 + (True,) + (False,) * 3, (5, 6), folded=flat)
    units = np.random.default_rng(0).random((200, 8))
    deviation, azimuth = np.asarray(built.values(units))[:, 5:7].T
    assert deviation.max() <= 20
    assert (azimuth.min() >= 0) == flat
    turn = built.parameters[6]
    assert (turn.lower, turn.upper, turn.natural, turn.periodic) == (lowest, 180, natural, True)


@pytest.mark.parametrize(
    "changed", [{"deviation": Free(1, 20)}, {"azimuth": Free(0, 180)}, {"azimuth": 10.0}, {"deviation": 5.0}]
)
def test_only_a_whole_disc_is_searched_as_one(problem, changed):
    surface = dataclasses.replace(TILTED, numbers={**TILTED.numbers, **changed})
    built = problem(surface=surface)
    assert built.coordinates.tilt is None
    assert not any(p.periodic for p in built.parameters)


def test_samples_in_one_plane():
    arc = [10.0, 40.0, 80.0]
    assert in_plane(ones(30.0, 0.0, arc, [0.0, 180.0, 180.0]))
    assert in_plane(ones(30.0, 25.0, arc, [25.0, 205.0, 205.0]))
    assert in_plane(ones(30.0, [0.0, 180.0, 0.0], arc, 0.0))
    assert not in_plane(ones(30.0, 0.0, arc, [0.0, 180.0, 90.0]))
    assert not in_plane(ones(30.0, [0.0, 45.0, 90.0], arc, [180.0, 225.0, 270.0]))


def test_sets_in_two_planes_see_the_sign_of_a_tilt():
    """Each set is in a plane, but together they are not."""
    sets = [ones(30.0, phi, ARC, phi + 180.0) for phi in (0.0, 90.0)]
    assert all(in_plane(each) for each in sets)
    plans = [pl.plan(TILTED, directions=each) for each in sets]
    for data, folded in ((sets[:1] * 2, True), (sets, False)):
        assert make(data, ["a", "b"], TILTED, plans, "linear").coordinates.folded == folded


def local(problem: Problem) -> Local:
    """The only view at values that every problem of TILTED has."""
    values = {"thickness": 300.0, "n": 1.5, "exponent_reflection": 60.0, "deviation": 3.0, "azimuth": 40.0}
    [view] = problem.views
    return view.local(np.array([(values | {"specular": 1.5})[p.key] for p in problem.parameters]))


def test_a_problem_of_some_rows_has_weight_on_them_alone(problem):
    whole = problem(sigma=0.1)
    rows = np.array([3, 7, 8])
    part = restricted(whole, [rows])
    [view], [some] = whole.views, part.views
    residuals = some.residuals(local(part))
    np.testing.assert_array_equal(residuals[rows], view.residuals(local(whole))[rows])
    assert np.count_nonzero(residuals) == 3 * 3
    assert part.static == whole.static  # the program is the same


def test_without_interference_the_thickness_has_no_effect(problem):
    plain = incoherent(problem())
    at = local(plain)
    assert np.abs(at.slope[..., 4]).max() > 0
    np.testing.assert_array_equal(at.slope[..., 0], 0)


def test_two_lobes_without_a_layer(problem):
    """A GGX lobe of each roughness with Schlick's Fresnel, and a diffuse part, each of its own colour."""
    plain = without_layer(problem(flat=True))
    names = [f"{key}_{c}" for key in ("lobe_1", "lobe_2", "diffuse") for c in (1, 2, 3)]
    assert [p.name for p in plain.parameters] == ["roughness_1", "roughness_2", "normal", *names]
    assert linear_count(plain) == 9
    assert not plain.box.prior_weight.any()
    values = np.array([0.1, 0.4, 0.05, *[0.0] * 6, 0.1, 0.2, 0.3])
    [view] = plain.views
    np.testing.assert_allclose(view.local(values).model[:50], np.tile([0.1, 0.2, 0.3], (50, 1)))
    values[3] = 2.0  # the first lobe, in the first channel
    smooth, values[0] = view.local(values).model[:50], 0.3
    rough = view.local(values).model[:50]
    np.testing.assert_allclose(rough[:, 1:], np.tile([0.2, 0.3], (50, 1)))
    assert abs(ARC[smooth[:, 0].argmax()] - 30) < 5  # around the mirror direction, the narrower the higher
    assert np.ptp(rough[:, 0]) < 0.3 * np.ptp(smooth[:, 0])


@pytest.mark.parametrize("residual", ["linear", "cosine", "log", "cube-root"])
def test_weights_are_those_of_the_compared_numbers(problem, residual):
    """With a σ, residuals are in standard deviations to first order, whatever is compared."""
    [view] = problem(residual=residual, sigma=1e-4).views
    near = view.data.values * (1 + 3e-4)
    compared = np.asarray(view.form.compare(view.data, near))[: view.rows]
    np.testing.assert_allclose(compared, -3.0, rtol=1e-3)
    [bare] = problem(residual=residual).views
    assert (bare.noise.given, view.noise.given) == (False, True)
    np.testing.assert_array_equal(bare.data.weight[: bare.rows], 1.0)
    np.testing.assert_array_equal(bare.data.weight[bare.rows :], 0.0)


RHO, COSINE, FLOOR = np.array([0.0, 0.3, 40.0]), np.array([1.0, 0.5, 0.2]), 1e-3
EXPECTED = {
    "linear": RHO,
    "cosine": RHO * COSINE,
    "log": np.log(1 + RHO * COSINE),
    "cube-root": (RHO + FLOOR) ** (1 / 3),
}


@pytest.mark.parametrize("name", RESIDUALS)
def test_residuals_by_name(name):
    transform = RESIDUALS[name]
    np.testing.assert_allclose(transform(RHO, COSINE, FLOOR), EXPECTED[name], rtol=1e-12)
    np.testing.assert_allclose(INVERSES[name](EXPECTED[name], COSINE, FLOOR), RHO, atol=1e-12)
    expected = derivative(lambda rho: transform(rho, COSINE, FLOOR), RHO, 1e-6)
    np.testing.assert_allclose(SLOPES[name](RHO, COSINE, FLOOR), expected, rtol=1e-5)
