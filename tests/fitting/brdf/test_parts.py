"""What a BRDF fit is made of: surfaces, coordinates, residuals, weights, and the rule of evidence."""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from pellicle.fitting.brdf.coordinates import coordinates, log_area, named, values
from pellicle.fitting.brdf.neighbourhood import affine
from pellicle.fitting.brdf.result import Baseline
from scipy.optimize import nnls

from pellicle.data.brdf_samples import BrdfSamples
from pellicle.errors import UsageError
from pellicle.fitting.brdf import evidence, fit, residuals, search
from pellicle.fitting.brdf.problem import _nonnegative
from pellicle.fitting.result import Estimate, Rival
from pellicle.fitting.spectra.search import quiet
from pellicle.sampling import brdf
from pellicle.scene.free import Free
from pellicle.scene.surface import Surface


def between(lower, upper):
    return Free(lower, upper)


TILTED = Surface(
    "granier-heidrich",
    {
        "thickness": between(0, 1000),
        "n": between(1.05, 2.5),
        "exponent_reflection": between(1, 1000),
        "deviation": between(0, 20),
        "azimuth": between(-180, 180),
        "specular": between(0, 100),
    },
)


def test_a_free_key_per_channel_is_one_number_each():
    assert [leaf.name for leaf in TILTED.free_numbers()] == [
        *("thickness", "n_r", "n_g", "n_b", "exponent_reflection", "deviation", "azimuth", "specular")
    ]
    grey = Surface("granier-heidrich", {"n": between(1.2, 2)}, wavelengths=(550.0,))
    assert [leaf.name for leaf in grey.free_numbers()] == ["n"]


def test_what_is_not_given_keeps_its_default():
    fixed = TILTED.fixed_numbers()
    assert fixed["exponent_transmission"] == 170.0
    assert fixed["wavelengths"].tolist() == [645.0, 525.0, 445.0]
    assert "n" not in fixed
    assert Surface("granier-heidrich", {"n": [1.4, 1.5, 1.6]}).fixed_numbers()["n"].tolist() == [
        1.4,
        1.5,
        1.6,
    ]


@pytest.mark.parametrize(
    ("name", "numbers", "told"),
    [
        ("granier-heidrik", {}, "did you mean 'granier-heidrich'"),
        ("microfacet-film", {"roughnes": 0.1}, "did you mean 'roughness'"),
        ("granier-heidrich", {"n": [1.4, 1.5]}, "2 numbers for 3 wavelengths"),
    ],
)
def test_a_wrong_surface_is_refused_in_words(name, numbers, told):
    with pytest.raises(UsageError, match=told):
        Surface(name, numbers)


def steep(surface, in_plane=False):
    return coordinates(tuple(leaf for leaf in surface.free_numbers() if not leaf.parameter.linear), in_plane)


def test_coordinates_span_the_bounds():
    chosen, box = steep(TILTED)
    for corner in (0.0, 1.0):
        found = named(chosen, values(chosen, box, jnp.full(7, corner)))
        ends = [(0, 1000), (1.05, 2.5), (1, 1000)]
        for key, end in zip(("thickness", "n", "exponent_reflection"), ends, strict=True):
            np.testing.assert_allclose(found[key], end[int(corner)], rtol=1e-12)
        assert found["n"].shape == (3,)
        assert float(found["deviation"]) == pytest.approx(20)
    middle = values(chosen, box, jnp.full(7, 0.5))
    assert float(middle[4]) == pytest.approx(np.sqrt(1000))  # exponents are searched by their logarithm


def test_a_tilt_is_a_disc_and_in_a_plane_half_of_one():
    rng = np.random.default_rng(0)
    for in_plane in (False, True):
        chosen, box = steep(TILTED, in_plane)
        found = np.array([values(chosen, box, jnp.asarray(rng.random(7)))[5:] for _ in range(200)])
        deviation, azimuth = found.T
        assert deviation.max() <= 20
        assert (azimuth.min() >= 0) == in_plane


def test_in_a_plane_the_square_of_the_tilt_out_of_it_is_searched():
    """Such samples see cos δ alone: at no tilt along the plane it falls in proportion to the square."""
    chosen, box = steep(TILTED, in_plane=True)
    reach = np.deg2rad(20)

    def upright(square):
        numbers = values(chosen, box, jnp.full(7, 0.5).at[6].set(square))
        return jnp.cos(jnp.deg2rad(numbers[5]))

    found, slope = jax.jit(jax.vmap(jax.value_and_grad(upright)))(jnp.array([0.0, 1e-4, 0.25]))
    np.testing.assert_allclose(slope[:2], -(reach**2) / 2, rtol=1e-4)
    np.testing.assert_allclose(found, np.cos([0, reach / 100, reach / 2]), atol=1e-6)


def test_how_much_of_the_disc_a_step_sweeps():
    """The determinant of the map onto the plane of tilts, by finite differences."""
    chosen, box = steep(TILTED)

    def tilt(x, y):
        deviation, azimuth = values(chosen, box, jnp.full(7, 0.5).at[5].set(x).at[6].set(y))[5:]
        return np.array(deviation * np.exp(1j * np.deg2rad(azimuth)))

    def area(x, y, step=1e-5):
        along, across = tilt(x + step, y) - tilt(x - step, y), tilt(x, y + step) - tilt(x, y - step)
        return abs((np.conj(along) * across).imag)

    found = [log_area(chosen, box, jnp.full(7, 0.5).at[5].set(x).at[6].set(y)) for x, y in PLACES]
    areas = np.array([area(x, y) for x, y in PLACES])
    np.testing.assert_allclose(np.exp(np.subtract(found, found[0])), areas / areas[0], rtol=1e-6)


PLACES = ((0.6, 0.3), (0.1, 0.9), (0.5, 0.95))


@pytest.mark.parametrize("in_plane", [False, True])
def test_a_point_that_was_searched_is_the_same_where_it_is_sampled(in_plane):
    """In their own units, with the azimuth within half a turn of the best one's."""
    seen = samples(30.0, 0.0, np.arange(10.0, 60.0), 180.0 if in_plane else np.arange(100.0, 150.0))
    searched = fit.problem(seen, TILTED, "linear", TILTED.brdf.evaluate)
    own = affine(TILTED, searched)
    for unit in np.random.default_rng(0).random((5, 8)):
        numbers = np.array([*values(searched.form.coordinates, searched.box, unit[:7]), 100 * unit[7]])
        moved = brdf._moved(searched, own, unit)
        again = brdf._values(own, numbers, moved[None])[0]
        np.testing.assert_allclose(again, numbers, rtol=1e-9)
        turned = brdf._values(own, numbers + 350, moved[None])[0]
        np.testing.assert_allclose(turned - numbers, [0] * 6 + [360, 0], atol=1e-6)


@pytest.fixture
def grey():
    """A problem of five numbers, one of them a weight."""
    free = ("thickness", "n", "exponent_reflection", "deviation", "specular")
    surface = Surface("granier-heidrich", {key: TILTED.numbers[key] for key in free}, (550.0,))
    seen = samples(30.0, 0.0, np.arange(10.0, 60.0), 180.0, ("value",))
    return fit.problem(seen, surface, "linear", surface.brdf.evaluate)


def test_later_candidates_keep_the_lobes_and_draw_the_fringes(grey):
    parents = np.array([[0.5] * 4 + [0.1], [0.25] * 4 + [0.2]])
    drawn = search.candidates(grey, 5, seed=1)
    found = search._other_fringes(grey, parents, drawn.copy())
    np.testing.assert_array_equal(found[:, :2], drawn[:, :2])
    np.testing.assert_array_equal(found[:, 2:], np.tile([[0.5] * 2, [0.25] * 2], (3, 1))[:5])


def test_the_best_minimum_is_polished_until_it_settles(grey, monkeypatch):
    """Only where it has not, and the others stay."""
    two = search.Minima(np.array([[0.3], [0.6]]), np.array([4.0, 5.0]), np.array([False, True]))
    asked = []

    def solver(*given):
        asked.append((given[-2].tolist(), given[-1]))
        return np.array([[0.4]]), np.array([3.0]), np.array([True])

    monkeypatch.setattr(search, "polished", solver)
    found = search.settle(grey, two, quiet)
    assert asked == [([[0.3]], search._LONG)]
    assert (found.units.tolist(), found.chi2.tolist()) == ([[0.4], [0.6]], [3.0, 5.0])
    assert found.converged.all()
    assert search.settle(grey, found, quiet) is found
    assert len(asked) == 1


@pytest.mark.parametrize("name", residuals.RESIDUALS)
def test_residuals_by_name(name):
    rho, cosine = np.array([0.0, 0.3, 40.0]), np.array([1.0, 0.5, 0.2])
    expected = {
        "linear": rho,
        "cosine": rho * cosine,
        "log": np.log(1 + rho * cosine),
        "cube-root": (rho + 1e-3) ** (1 / 3),
    }[name]
    transform = residuals.RESIDUALS[name]
    np.testing.assert_allclose(transform(rho, cosine, 1e-3), expected, rtol=1e-12)
    np.testing.assert_allclose(residuals.INVERSES[name](expected, cosine, 1e-3), rho, atol=1e-12)
    step = 1e-6
    slope = (transform(rho + step, cosine, 1e-3) - transform(rho - step, cosine, 1e-3)) / (2 * step)
    np.testing.assert_allclose(residuals.slope(transform, jnp.asarray(rho), cosine, 1e-3), slope, rtol=1e-5)


def test_weights_are_the_nonnegative_least_squares():
    rng = np.random.default_rng(1)
    for _ in range(20):
        columns, data = rng.normal(size=(30, 3)), rng.normal(size=30)
        found = _nonnegative(jnp.asarray(columns.T @ columns), jnp.asarray(columns.T @ data))
        np.testing.assert_allclose(found, nnls(columns, data)[0], atol=1e-9)


def estimate(name, value, stderr=0.1, lower=0.0, upper=1000.0, at_bound=False):
    return Estimate(name, value, stderr, "", lower, upper, True, at_bound)


def none_at_all(most):
    return dataclasses.replace(estimate("thickness", 0.2), upper_limit=most)


GOOD = {
    "thickness": estimate("thickness", 300.0),
    "exponent_reflection": estimate("exponent_reflection", 50.0),
}
WORSE = (Baseline("no interference", 2.0), Baseline("two lobes", 3.0))


def test_a_layer_that_passes_every_doubt():
    found = evidence.weigh(GOOD, (Rival({"thickness": 500.0}, 40.0),), 1.0, WORSE)
    assert found.layered
    assert "thickness 300.00 ± 0.10" in found.verdict
    assert "50 % below no interference and 67 % below two lobes" in found.verdict


@pytest.mark.parametrize(
    ("changed", "rivals", "held_out", "why"),
    [
        ({}, (), 1.84, "8 % below no interference"),
        ({"thickness": none_at_all(1.2)}, (), 1.0, "0 fits as well, for it is at most 1.2 (95 %)"),
        ({}, (), 3.3, "1.10 times that of two lobes"),
        ({}, (Rival({"thickness": 500.0}, 3.0),), 1.84, "500 nm fits as well as 300 nm"),
        ({"thickness": estimate("thickness", 300.0, np.inf)}, (), 1.0, "no finite error"),
        ({"exponent_reflection": estimate("exponent_reflection", 1.5)}, (), 1.0, "is no lobe"),
        ({"exponent_reflection": estimate("exponent_reflection", 1e3, at_bound=True)}, (), 1.0, "its bound"),
        ({"deviation": estimate("deviation", 20.0, upper=20.0, at_bound=True)}, (), 1.0, "its bound 20"),
        ({"n_g": estimate("n_g", 2.5, upper=2.5, at_bound=True)}, (), 1.0, "n_g rests on its bound"),
        ({"roughness": estimate("roughness", 0.84)}, (), 1.0, "roughness 0.84 is no lobe"),
        ({"specular": estimate("specular", 0.0, at_bound=True)}, (), 1.0, "no weight"),
    ],
)
def test_each_doubt_alone_denies_a_layer(changed, rivals, held_out, why):
    found = evidence.weigh({**GOOD, **changed}, rivals, held_out, WORSE)
    assert not found.layered
    assert found.verdict.startswith("No evidence of a layer: ")
    assert why in found.verdict


def test_a_layer_of_several_thicknesses_is_not_no_layer():
    found = evidence.weigh(GOOD, (Rival({"thickness": 500.0}, 3.0),), 1.0, WORSE)
    assert (found.layered, found.several) == (False, True)
    assert found.verdict == (
        "The samples do not decide the thickness of the layer: 500 nm fits as well as 300 nm (Δχ² 3.0)."
    )


def samples(theta_i, phi_i, theta_o, phi_o, channels=("R", "G", "B")):
    theta_i, phi_i, theta_o, phi_o = np.broadcast_arrays(
        *map(np.atleast_1d, (theta_i, phi_i, theta_o, phi_o))
    )
    return BrdfSamples(theta_i, phi_i, theta_o, phi_o, np.ones((theta_i.size, len(channels))), channels)


def test_samples_in_a_plane():
    arc = [10.0, 40.0, 80.0]
    assert evidence.in_plane(samples(30.0, 0.0, arc, [0.0, 180.0, 180.0]))
    assert evidence.in_plane(samples(30.0, 25.0, arc, [25.0, 205.0, 205.0]))
    assert evidence.in_plane(samples(30.0, [0.0, 180.0, 0.0], arc, 0.0))
    assert not evidence.in_plane(samples(30.0, 0.0, arc, [0.0, 180.0, 90.0]))
    assert not evidence.in_plane(samples(30.0, [0.0, 45.0, 90.0], arc, [180.0, 225.0, 270.0]))


def test_what_directions_cannot_decide_is_told():
    told = " ".join(evidence.directions(samples(30.0, 0.0, [10.0, 40.0], 180.0), TILTED))
    assert "at one angle" in told
    assert "cannot see the sign" in told
    told = " ".join(evidence.directions(samples([10.0, 30.0], 0.0, 40.0, [90.0, 180.0]), TILTED))
    assert "never turned" in told
    grey = samples([5.0, 12.0], 0.0, 10.0, 180.0, ("value",))
    base = Surface("microfacet-film", {"base_n": between(1, 3), "base_k": between(0, 6)}, (550.0,))
    told = " ".join(evidence.directions(grey, base))
    assert "within 12 degrees of the normal" in told
    assert "one channel" in told
    assert "base_n and base_k are both free" in told
