"""Systematic effects against simulations of scenes that have them, and the errors that follow."""

import numpy as np
import pytest

import pellicle as pl
from pellicle.fitting.discrepancy import HALF_NORMAL
from pellicle.fitting.film.fit import fitted, measurements
from pellicle.fitting.film.systematic_effects import systematic_effects
from pellicle.fitting.progress import quiet

NM = np.linspace(420, 880, 60)
THICKNESS = 310.0
FREE = pl.Free(200, 400)


def spectrum(signal="R", angle=None, **layer):
    scene = pl.Scene(
        pl.Layer(1.6, THICKNESS, **layer), 3.9, light=pl.Light(signal=signal, angle=angle or 0.0)
    )
    return pl.simulate(scene, wavelength=NM)


def changes(scene, data):
    """Change of the data by every effect at the true thickness, (rows, channels)."""
    _, ranked = fitted(data, scene, 0.0, quiet)
    [view], values = ranked.problem.views, ranked.values
    assert values == pytest.approx([THICKNESS], abs=1e-4)
    [target] = measurements(data, scene)
    return {e.name: e for e in systematic_effects(view, values, ranked.fits[0].at, target.scene)}


@pytest.fixture(scope="module")
def reflectance():
    return changes(pl.Scene(pl.Layer(1.6, FREE), 3.9), spectrum())


def difference(scene):
    """Change of R by what a scene has in addition."""
    return pl.simulate(scene, wavelength=NM).values - spectrum().values


def R(nm, d=THICKNESS, n=1.6, substrate=3.9):
    return np.asarray(pl.reflectance(nm, d, n, substrate))


def slope(function, size):
    """Change by one uncertainty, to first order."""
    step = 1e-3 * size
    return (function(step) - function(-step)) / 2e-3


LINEAR = {
    "wavelength shift": (0.5, lambda s: R(NM + s)),
    "index of the layer": (0.005, lambda s: R(NM, n=1.6 * (1 + s))),
    "index of the substrate": (0.005, lambda s: R(NM, substrate=3.9 * (1 + s))),
    "offset": (0.005, lambda s: R(NM) + s),
    "scale": (0.01, lambda s: R(NM) * (1 + s)),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", LINEAR)
def test_linear_effects_are_derivatives(reflectance, name):
    size, function = LINEAR[name]
    effect = reflectance[name]
    assert effect.size == size
    expected = slope(function, size)
    np.testing.assert_allclose(effect.change[:, 0], expected, atol=2e-4 * np.abs(expected).max())


def test_a_slit_is_an_average_over_wavelengths(reflectance):
    """A full width of 2 nm at half maximum, by Gauss and Hermite's quadrature."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(9)
    sd = 2.0 / np.sqrt(8 * np.log(2))
    mean = np.average([R(NM + sd * node) for node in nodes], axis=0, weights=weights)
    change = reflectance["bandwidth"].change[:, 0]
    np.testing.assert_allclose(change, HALF_NORMAL * (mean - R(NM)), rtol=1e-2, atol=1e-8)


WIDTHS = {
    "thickness spread": lambda: pl.Scene(pl.Layer(1.6, THICKNESS, thickness_spread=3.1), 3.9),
    "roughness": lambda: pl.Scene(pl.Layer(1.6, THICKNESS, roughness=1.5), 3.9),
    "angle spread": lambda: pl.Scene(
        pl.Layer(1.6, THICKNESS), 3.9, instrument=pl.Instrument(angle_spread=2.0)
    ),
}


@pytest.mark.parametrize("name", WIDTHS)
def test_widths_are_averages(reflectance, name):
    """Of their own size, times the root mean square of a half-normal prior on the variance."""
    expected = HALF_NORMAL * difference(WIDTHS[name]())
    change = reflectance[name].change[:, 0]
    np.testing.assert_allclose(change, expected, atol=0.02 * np.abs(expected).max())


def test_a_native_oxide_is_one_more_layer(reflectance):
    thin = pl.Layer(1.46, 1.0, name="oxide")
    expected = difference(pl.Scene([pl.Layer(1.6, THICKNESS, name="film"), thin], 3.9))
    np.testing.assert_allclose(reflectance["native oxide"].change[:, 0], expected, atol=1e-9)


@pytest.mark.slow  # compiles a scene of its own
def test_offsets_of_psi_and_delta():
    data = spectrum("psi-delta", 70.0)
    scene = pl.Scene(pl.Layer(1.6, FREE), 3.9, light=pl.Light(angle=70.0, signal="psi-delta"))
    found = changes(scene, data)
    psi, delta = np.deg2rad(2 * data.values), np.deg2rad(data.delta)

    def sphere(psi, delta):
        return np.stack([np.cos(psi), np.sin(psi) * np.cos(delta), np.sin(psi) * np.sin(delta)], axis=1)

    for name, moved, size in (
        ("offset of psi", lambda s: sphere(psi + 2 * s, delta), np.deg2rad(0.05)),
        ("offset of delta", lambda s: sphere(psi, delta + s), np.deg2rad(0.15)),
    ):
        expected = slope(moved, size)
        np.testing.assert_allclose(found[name].change, expected, atol=1e-3 * np.abs(expected).max())


@pytest.mark.slow  # compiles a scene for each effect
def test_what_the_scene_describes_is_no_effect():
    scene = pl.Scene(
        pl.Layer(1.6, FREE, roughness=1.0),
        3.9,
        instrument=pl.Instrument(scale="free", bandwidth=2.0),
        uncertainty=pl.Uncertainty(wavelength=0.0),
    )
    data = pl.simulate(
        pl.Scene(pl.Layer(1.6, THICKNESS, roughness=1.0), 3.9, instrument=pl.Instrument(bandwidth=2.0)),
        wavelength=NM,
    )
    names = set(changes(scene, data))
    assert not names & {"roughness", "scale", "bandwidth", "wavelength shift"}
    assert {"offset", "index of the layer", "thickness spread"} <= names
    assert changes(pl.Scene(pl.Layer(1.6, FREE), 3.9, uncertainty=pl.Uncertainty.none()), spectrum()) == {}


def test_a_wrong_index_moves_the_answer_as_the_budget_says():
    """Data of a film whose index is 0.1 % higher than the scene says: a fifth of the standard uncertainty."""
    data = pl.simulate(pl.Scene(pl.Layer(1.6 * 1.001, THICKNESS), 3.9), wavelength=NM, noise=1e-6)
    fit = pl.fit(data, pl.Scene(pl.Layer(1.6, FREE), 3.9))
    [row] = [row for row in fit.budget if row.name == "index of the layer"]
    moved = fit["thickness"].value - THICKNESS
    # the budget says by what the answer moves where the true index is the given one and the scene's is off
    assert -row.changes["thickness"] / 5 == pytest.approx(moved, rel=0.02)
    assert abs(moved) < 3 * fit["thickness"].stderr


def test_errors_shrink_to_those_of_the_noise_as_more_is_known():
    data = pl.simulate(pl.Scene(pl.Layer(1.6, THICKNESS), 3.9), wavelength=NM, noise=0.001)

    def errors(**known):
        fit = pl.fit(data, pl.Scene(pl.Layer(1.6, FREE), 3.9, uncertainty=pl.Uncertainty(**known)))
        return fit["thickness"].stderr, fit["thickness"].stderr_noise

    (usual, noise), (better, same) = errors(), errors(index=0.0005, interlayer=0.0)
    assert noise == same
    assert usual > 2 * better > 2 * noise
    alone = pl.fit(data, pl.Scene(pl.Layer(1.6, FREE), 3.9, uncertainty=pl.Uncertainty.none()))
    assert alone["thickness"].stderr == pytest.approx(noise, rel=0.02)
    own = pl.fit(data, pl.Scene(pl.Layer(1.6, FREE, index_uncertainty=0.0), 3.9))
    assert own["thickness"].stderr < 0.7 * usual
    assert "index of the layer" not in {row.name for row in own.budget}


@pytest.mark.parametrize("wrong", [-0.1, float("inf"), float("nan")])
def test_impossible_uncertainties_are_refused(wrong):
    with pytest.raises(ValueError, match="the uncertainty of `wavelength` must be finite and not negative"):
        pl.Uncertainty(wavelength=wrong)
    with pytest.raises(ValueError, match="the uncertainty of `index`"):
        pl.Layer(1.6, 100.0, index_uncertainty=wrong)
