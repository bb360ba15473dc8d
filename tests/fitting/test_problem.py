"""Both kinds of view, spectra and BRDF samples, fulfil the protocol on which fits rest."""

from collections.abc import Callable
from typing import NamedTuple

import jax
import numpy as np
import pytest

import pellicle as pl
from pellicle.data.brdf_samples import BrdfSamples
from pellicle.fitting.brdf.problem import make as make_surface
from pellicle.fitting.evaluation import total_deviance
from pellicle.fitting.film.problem import make as make_scene
from pellicle.fitting.film.problem import measured
from pellicle.fitting.problem import Explained, Form, Problem, View
from pellicle.scene.surface import Surface

from ..differences import jacobian
from .brdf import conftest as brdf

NM = np.linspace(450.0, 850.0, 50)
CAUCHY = pl.dispersion.Cauchy(pl.Free(1.3, 1.9), pl.Free(0.0, 2e4))
FILM = {"A": 1.5, "B": 4000.0, "thickness": 300.0}
PRIOR = pl.priors.Normal(300.0, 30.0)
NUMBERS = {**brdf.TILTED.numbers, "thickness": pl.Free(0, 1000, prior=PRIOR), "n": 1.5, "diffuse": 0.1}
TILTED = Surface("granier-heidrich", NUMBERS)
TILT = {"thickness": 310.0, "exponent_reflection": 40.0, "deviation": 4.0, "azimuth": 50.0, "specular": 1.5}


def film(data: pl.Spectrum, material=CAUCHY, **instrument) -> Problem:
    layer = pl.Layer(material, pl.Free(10, 1000))
    return make_scene(measured(data, pl.Scene(layer, 3.9 + 0.02j, instrument=pl.Instrument(**instrument))))


def reflectance() -> Problem:
    """R with a σ of its own at each wavelength; nothing of the instrument is free."""
    sigma = np.linspace(0.002, 0.004, NM.size)
    return film(pl.Spectrum(NM, 0.2 + 0.1 * np.cos(NM / 40), "R", sigma=sigma))


def ellipsometry() -> Problem:
    """Ψ and Δ, each with its own σ."""
    psi, delta = 30 + 10 * np.cos(NM / 40), 120 + 30 * np.sin(NM / 30)
    noise = {"sigma": np.full(NM.size, 0.05), "delta_sigma": np.full(NM.size, 0.2)}
    return film(pl.Spectrum(NM, psi, "psi-delta", delta=delta, angle=np.full(NM.size, 70.0), **noise))


def samples(in_plane: bool, sigma: float | None) -> BrdfSamples:
    """30 samples of three channels around the mirror direction, in the plane of incidence or beside it."""
    theta_i = np.repeat([20.0, 40.0, 60.0], 10)
    theta_o = theta_i + np.tile(np.linspace(-15, 15, 10), 3)
    phi_o = np.full(30, 180.0) if in_plane else 180 + np.linspace(-25, 25, 30)
    values = 0.3 + 0.2 * np.cos(np.arange(90).reshape(30, 3))
    known = None if sigma is None else np.full(values.shape, sigma)
    return BrdfSamples(theta_i, np.zeros(30), theta_o, phi_o, values, ("R", "G", "B"), sigma=known)


def surface(residual: str, in_plane: bool = False, sigma: float | None = 0.02) -> Problem:
    data = samples(in_plane, sigma)
    plan = pl.plan(TILTED, directions=data)
    return make_surface([data], [""], TILTED, [plan], residual)


class Case(NamedTuple):
    """A problem of one view, and a point of it in the parameters' own units, by name."""

    problem: Callable[[], Problem]
    point: dict[str, float]
    channels: int


CASES = {
    "reflectance": Case(reflectance, FILM, 1),
    "ellipsometry": Case(ellipsometry, FILM, 3),
    "BRDF": Case(lambda: surface("linear"), TILT, 3),
    "BRDF, cube root": Case(lambda: surface("cube-root", sigma=None), TILT, 3),
}


@pytest.fixture(params=CASES)
def case(request):
    """The view of a case, and the values of its parameters."""
    chosen = CASES[request.param]
    problem = chosen.problem()
    [view] = problem.views
    return view, np.array([chosen.point[p.name] for p in problem.parameters]), chosen.channels


def deviance(view: View, values: np.ndarray) -> float:
    """By the traced path, which fits minimise."""
    return float(traced(view, values).deviance)


def traced(view: View, values: np.ndarray) -> Explained:
    return jax.jit(lambda arrays, x: view.form.explain(arrays, list(x)))(view.arrays, values)


def test_shapes_of_a_view(case):
    view, values, channels = case
    assert isinstance(view, View)
    assert isinstance(view.form, Form)
    at = view.local(values)
    residuals = view.residuals(at)
    assert residuals.shape == (view.rows, channels)
    assert view.jacobian(at).shape == (view.rows * channels, len(values) + len(view.nuisances(at)))
    assert view.takes == tuple(range(len(values)))
    assert view.independent == view.rows * min(channels, 2 if view.plan.signal == "psi-delta" else 3)
    assert view.correlation_length(residuals) >= 1
    assert view.off_tolerance(values) == 0


def test_the_jacobian_by_finite_differences(case):
    """Of the weighted residuals, data less model: by each parameter in its own unit."""
    view, values, _ = case

    def residuals(at):
        return view.residuals(view.local(at)).ravel()

    expected = -jacobian(residuals, values, 1e-6 * values)
    np.testing.assert_allclose(
        view.jacobian(view.local(values)), expected, rtol=1e-6, atol=1e-7 * np.abs(expected).max()
    )


def test_the_traced_path_and_the_local_model_agree(case):
    view, values, _ = case
    explained = traced(view, values)
    at = view.local(values)
    np.testing.assert_allclose(np.asarray(explained.model), at.model, rtol=1e-9)
    square = float(np.sum(view.residuals(at) ** 2))
    assert float(explained.deviance) == pytest.approx(square, rel=1e-9)
    assert float(np.sum(explained.residual**2)) == pytest.approx(square, rel=1e-9)


def test_reweighting_multiplies_weights_and_counts_points(case):
    view, values, channels = case
    before = view.residuals(view.local(values))
    factor = np.linspace(0.5, 2.0, view.rows * channels).reshape(view.rows, channels)
    after = view.reweighted(factor, 0.25)
    at = after.local(values)
    np.testing.assert_allclose(after.residuals(at), factor * before, rtol=1e-12)
    expected = factor.reshape(-1, 1) * view.jacobian(view.local(values))
    np.testing.assert_allclose(after.jacobian(at), expected, rtol=1e-12)
    assert deviance(after, values) == pytest.approx(0.25 * np.sum((factor * before) ** 2), rel=1e-9)
    twice = after.reweighted(2.0, 1.0)
    assert deviance(twice, values) == pytest.approx(np.sum((2 * factor * before) ** 2), rel=1e-9)
    assert (after.takes, after.rows, after.form) == (view.takes, view.rows, view.form)


def test_counting_changes_the_deviance_and_no_residual(case):
    view, values, _ = case
    fewer = view.reweighted(1.0, 0.5).counting(0.125)
    np.testing.assert_array_equal(fewer.residuals(fewer.local(values)), view.residuals(view.local(values)))
    assert deviance(fewer, values) == pytest.approx(0.125 * deviance(view, values), rel=1e-9)


def test_programs_are_shared_by_what_is_static(case):
    view, _, _ = case
    assert hash(view.form) == hash(view.reweighted(2.0, 0.5).form)
    assert repr(view.form) == repr(view.thinned().form)


def test_where_weights_drift_points_never_count_more_than_a_tenth():
    data = pl.Spectrum(NM, 0.2 + 0.1 * np.cos(NM / 40), "R", calibrated=False)
    [view] = film(data, 1.46, scale="slow", offset="slow").views
    assert view.noise.drifting
    assert view.noise.known
    assert view.data.independent_fraction == pytest.approx(0.1)
    assert view.reweighted(1.0, 1.0).data.independent_fraction == pytest.approx(0.1)
    assert view.reweighted(1.0, 0.05).data.independent_fraction == pytest.approx(0.05)
    assert view.counting(1.0).data.independent_fraction == 1.0


def test_scale_and_offset_are_columns_of_the_jacobian_in_units_of_their_priors():
    """The model is linear in them: it is their sum."""
    data = pl.Spectrum(NM, 900 * (0.3 + 0.1 * np.cos(NM / 40)), "R", calibrated=False)
    [view] = film(data, 1.46, scale="slow", offset="slow").views
    at = view.local(np.array([300.0]))
    coefficients = view.nuisances(at)
    names = ["scale", "scale_1", "scale_2", "scale_3", "offset", "offset_1", "offset_2"]
    assert [c.name for c in coefficients] == [f"instrument.{name}" for name in names]
    columns = view.jacobian(at)[:, 1:]
    scaled = [c.value / c.prior_sd for c in coefficients]
    weight = view.data.weight[: view.points]
    np.testing.assert_allclose(columns @ scaled, weight * at.model[: view.points], rtol=1e-9)


def test_thinning_keeps_the_weight_of_all_points():
    """1000 wavelengths become every third: the deviance is the same where residuals vary slowly."""
    nm = np.linspace(450.0, 850.0, 1000)
    data = pl.Spectrum(nm, 0.2 + 0.1 * np.cos(nm / 60), "R", sigma=np.full(1000, 0.01))
    problem = film(data, 1.46)
    thinned = problem.thinned()
    assert thinned.views[0].rows == 334
    whole, part = (total_deviance(each, np.array([[0.2], [0.5]])) for each in (problem, thinned))
    np.testing.assert_allclose(part, whole, rtol=5e-3)


def tilted(in_plane: bool) -> tuple[Problem, np.ndarray]:
    """A problem with a disc of tilts, and points of its cube away from the centre and the edges."""
    problem = surface("linear", in_plane)
    assert problem.coordinates.tilt is not None
    assert problem.coordinates.folded == in_plane
    return problem, np.random.default_rng(1).uniform(0.1, 0.9, (6, len(problem.parameters)))


@pytest.mark.parametrize("in_plane", [False, True])
def test_affine_coordinates_are_the_same_problem(in_plane):
    """The same values, up to a turn, and the same deviance, priors included."""
    problem, units = tilted(in_plane)
    affine = problem.affine()
    moved = np.array([problem.in_affine(unit) for unit in units])
    assert ((moved >= 0) & (moved <= 1)).all()
    np.testing.assert_allclose(affine.values(moved), problem.values(units), rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(total_deviance(affine, moved), total_deviance(problem, units), rtol=1e-9)
    assert not affine.coordinates.folded
    assert not any(affine.coordinates.log)


@pytest.mark.parametrize("in_plane", [False, True])
def test_own_units_are_the_same_problem(in_plane):
    """Deviation and azimuth themselves, the azimuth within half a turn of its value, or from 0 to 180."""
    problem, units = tilted(in_plane)
    deviation, azimuth = problem.coordinates.tilt
    for unit in units:
        values = np.asarray(problem.values(unit))
        own = problem.in_own_units(values)
        assert own.coordinates.tilt is None
        at = (values - own.box.lower) / (own.box.upper - own.box.lower)
        assert ((at >= 0) & (at <= 1)).all()
        np.testing.assert_allclose(own.values(at), values, rtol=1e-9)
        [there], [here] = total_deviance(own, at[None]), total_deviance(problem, unit[None])
        assert there == pytest.approx(here, rel=1e-9)
        ends = (0.0, 180.0) if in_plane else (values[azimuth] - 180, values[azimuth] + 180)
        assert (own.box.lower[azimuth], own.box.upper[azimuth]) == pytest.approx(ends)
        assert (own.box.lower[deviation], own.box.upper[deviation]) == (0.0, 20.0)


def test_without_a_tilt_own_units_are_affine():
    problem = reflectance()
    unit = np.array([0.2, 0.7, 0.4])
    np.testing.assert_allclose(problem.in_affine(unit), unit)
    own = problem.in_own_units(np.asarray(problem.values(unit)))
    np.testing.assert_allclose(own.box.lower, problem.box.lower)
    np.testing.assert_allclose(own.box.upper, problem.box.upper)


def test_a_shared_prior_counts_once_in_the_deviance():
    problem, _ = tilted(False)
    values = np.array([TILT[p.name] for p in problem.parameters])
    own = problem.in_own_units(values)
    at = ((values - own.box.lower) / (own.box.upper - own.box.lower))[None]
    [both], [one] = (total_deviance(own._replace(views=own.views * n), at) for n in (2, 1))
    assert 2 * one - both == pytest.approx(((310 - 300) / 30) ** 2, rel=1e-6)


def test_the_thickness_with_the_widest_bounds_is_scanned():
    layers = [pl.Layer(1.46, pl.Free(0, 100), "thin"), pl.Layer(2.1, pl.Free(0, 900), "thick")]
    data = pl.Spectrum(NM, np.full(NM.size, 0.2), "R")
    problem = make_scene(measured(data, pl.Scene(layers, 3.9 + 0.02j)))
    assert problem.parameters[problem.thickness_axis].name == "thick.thickness"
    bare = make_scene(measured(data, pl.Scene(pl.Layer(CAUCHY, 100.0), 3.9 + 0.02j)))
    assert bare.thickness_axis is None
