"""Systematic effects against simulations of scenes that have them, and the errors that follow."""

import jax
import numpy as np
import pytest
import tmm

import pellicle as pl
from pellicle.dispersion.effective_medium import Bruggeman
from pellicle.dispersion.empirical import Constant
from pellicle.fitting.film import extended_scene
from pellicle.fitting.film.extended_scene import extended
from pellicle.fitting.film.fit import fitted, measurements
from pellicle.fitting.film.problem import make
from pellicle.fitting.film.systematic_effects import simulations_of, systematic_effects
from pellicle.fitting.linear_system import HALF_NORMAL
from pellicle.fitting.progress import quiet

from ...differences import derivative

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
    return {e.name: e for e in systematic_effects(view, values, ranked.fits[0].at, target.scene, values)}


@pytest.fixture(scope="module")
def reflectance():
    return changes(pl.Scene(pl.Layer(1.6, FREE), 3.9), spectrum())


def R(nm, n=1.6, substrate=3.9):
    return np.asarray(pl.reflectance(nm, THICKNESS, n, substrate))


def linear(function, size):
    """Change by one uncertainty, to first order."""
    return size * derivative(function, 0.0, 1e-3 * size)


def wide(change):
    """Change by a width, times the root mean square of a half-normal prior on the variance."""
    return HALF_NORMAL * (change - R(NM))


def simulated(*below, **more):
    layer = {key: more.pop(key) for key in ("thickness_spread", "roughness") if key in more}
    layers = [pl.Layer(1.6, THICKNESS, name="film", **layer), *below]
    return pl.simulate(pl.Scene(layers, 3.9, instrument=pl.Instrument(**more)), wavelength=NM).values


def slit():
    """A full width of 2 nm at half maximum, by Gauss and Hermite's quadrature."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(9)
    sd = 2.0 / np.sqrt(8 * np.log(2))
    return np.average([R(NM + sd * node) for node in nodes], axis=0, weights=weights)


# the change, and its relative error
EFFECTS = {
    "wavelength shift": (lambda: linear(lambda s: R(NM + s), 0.5), 2e-4),
    "index of the layer": (lambda: linear(lambda s: R(NM, n=1.6 * (1 + s)), 0.005), 2e-4),
    "index of the substrate": (lambda: linear(lambda s: R(NM, substrate=3.9 * (1 + s)), 0.005), 2e-4),
    "offset": (lambda: linear(lambda s: R(NM) + s, 0.005), 2e-4),
    "scale": (lambda: linear(lambda s: R(NM) * (1 + s), 0.01), 2e-4),
    "bandwidth": (lambda: wide(slit()), 0.01),
    "thickness spread": (lambda: wide(simulated(thickness_spread=3.1)), 0.02),
    "roughness": (lambda: wide(simulated(roughness=1.5)), 0.02),
    "angle spread": (lambda: wide(simulated(angle_spread=2.0)), 0.02),
    "overlayer": (
        lambda: np.asarray(pl.reflectance(NM, [0.5, THICKNESS], [1.5, 1.6], 3.9)) - R(NM),
        1e-7,
    ),
    "native oxide": (lambda: simulated(pl.Layer(1.46, 1.0, name="oxide")) - R(NM), 1e-7),
}


@pytest.mark.parametrize("name", EFFECTS)
def test_an_effect_changes_the_data_as_a_scene_that_has_it(reflectance, name):
    change, error = EFFECTS[name]
    expected = change()
    np.testing.assert_allclose(reflectance[name].change[:, 0], expected, atol=error * np.abs(expected).max())


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
        expected = linear(moved, size)
        np.testing.assert_allclose(found[name].change, expected, atol=1e-3 * np.abs(expected).max())


@pytest.mark.slow  # compiles a scene for each effect
def test_what_the_scene_describes_is_no_effect():
    window, known = pl.Instrument(scale="free", bandwidth=2.0), pl.Uncertainty(wavelength=0.0)
    scene = pl.Scene(pl.Layer(1.6, FREE, roughness=1.0), 3.9, instrument=window, uncertainty=known)
    names = set(changes(scene, pl.Spectrum(NM, simulated(roughness=1.0, bandwidth=2.0), "R")))
    assert not names & {"roughness", "scale", "bandwidth", "wavelength shift"}
    assert {"offset", "index of the layer", "thickness spread"} <= names
    assert changes(pl.Scene(pl.Layer(1.6, FREE), 3.9, uncertainty=pl.Uncertainty.none()), spectrum()) == {}


def test_the_index_of_a_mixture_is_more_uncertain_in_a_thin_layer():
    mixture = Bruggeman(Constant(1.6), Constant(1.0), 0.2)
    film = pl.Scene(pl.Layer(mixture, pl.Free(1, 100)), 3.9)
    uncertainties = []
    for thickness in (10.0, 20.0):
        data = pl.simulate(pl.Scene(pl.Layer(mixture, thickness), 3.9), wavelength=NM, noise=1e-4)
        budget = {row.name: row for row in pl.fit(data, film).budget}
        assert abs(budget["index of the layer"].changes["thickness"]) > 0
        uncertainties.append("mixing rule" in budget)
    assert uncertainties == [True, False]


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
def test_impossible_uncertainties_are_refused(wrong, refuses):
    with pytest.raises(ValueError, match="the uncertainty of `wavelength` must be finite and not negative"):
        pl.Uncertainty(wavelength=wrong)
    refuses(ValueError, "the uncertainty of `index`", pl.Layer, 1.6, 100.0, index_uncertainty=wrong)


NINE = np.linspace(400, 800, 9)


@pytest.mark.parametrize(
    ("film", "mixes"),
    [(1.6, True), (pl.Anisotropic(1.6, 1.7, axis=(20.0, 10.0)), True), (pl.Anisotropic(1.46, 1.5), False)],
)
def test_mixed_interface_under_a_birefringent_film(film, mixes):
    """An oxide between film and silicon mixes with it; a film that is like an oxide has none beneath it."""
    scene = pl.Scene(pl.Layer(film, pl.Free(50, 400, start=200.0)), "Si", light=pl.Light(angle=60.0))
    (view,) = make(*measurements(pl.simulate(scene, NINE, noise=0.01), scene)).views
    scene = extended(view, np.array([200.0]))
    assert (scene.mixture is not None) == mixes
    mixtures = [
        [type(x.material) is Bruggeman for x in program.scene.layers] for program in scene.programs().values()
    ]
    assert any(map(any, mixtures)) == mixes


def with_faces(layers, angle=60.0, signal="R"):
    """The extended scene of films on a half space that oxidises, its data and the parameters."""
    scene = pl.Scene(layers, 3.9, light=pl.Light(angle=angle, signal=signal))
    (view,) = make(*measurements(pl.simulate(scene, NINE, noise=0.01), scene)).views
    return extended(view, np.array([200.0])), view.data, np.array([200.0])


FILM = pl.Layer(2.0, pl.Free(50, 400, start=200.0))


def test_faces_beside_each_other():
    """Of no size they are not there: each is simulated as if it were alone."""
    scene, data, at = with_faces(FILM)
    effects = scene.roughness, scene.oxide, scene.mixture, scene.overlayer
    together = scene.signals(data, at, [(number, 2.0) for number in effects])[:, :9]

    def tmm_R(layers):
        n, d = [1.0, *(n for n, _ in layers), 3.9], [np.inf, *(d for _, d in layers), np.inf]
        rays = [(nm, p) for nm in NINE for p in "sp"]
        return np.reshape([tmm.coh_tmm(p, n, d, np.pi / 3, nm)["R"] for nm, p in rays], (9, 2)).mean(axis=1)

    # Bruggeman's equation of half and half: 2 ε² − (a + b) ε / 2 − a b = 0 of permittivities a, b
    a, b = 2.0**2, 3.9**2
    half = np.sqrt(((a + b) / 2 + np.sqrt((a + b) ** 2 / 4 + 8 * a * b)) / 4)
    film = (2.0, 200.0)
    thin = [[film, (1.46, 2.0)], [film, (half, 2.0)], [(1.5, 2.0), film]]
    np.testing.assert_allclose(together[1:], [*map(tmm_R, thin)], atol=1e-12)
    rough = pl.Scene(pl.Layer(2.0, 200.0, roughness=2.0), 3.9, light=pl.Light(angle=60.0, signal="R"))
    np.testing.assert_allclose(together[0], pl.simulate(rough, NINE).values, atol=1e-12)


@pytest.mark.parametrize(
    ("layers", "count"),
    [
        (FILM, 2),
        (pl.Layer(pl.Anisotropic(1.6, 1.7, axis=(20.0, 10.0)), pl.Free(50, 400, start=200.0)), 1),
    ],
)
def test_programs_of_effects(layers, count, monkeypatch):
    """The scene and all faces take two programs, and one where s and p mix."""
    scene, data, at = with_faces(layers, signal="psi-delta")
    numbers = [scene.wavelength, scene.thickness[0], scene.mixture, scene.oxide, scene.overlayer]
    numbers += [] if scene.roughness is None else [scene.roughness]
    called = set()
    for name in ("simulated", "simulated_once"):
        program = getattr(extended_scene, name)

        def counted(form, own, data, values, name=name, program=program):
            called.add((name, form, jax.tree.structure(own), values.shape))
            return program(form, own, data, values)

        monkeypatch.setattr(extended_scene, name, counted)
    scene.signals(data, at, [(number, 1.0) for number in numbers])
    assert len(called) == count


def test_a_shift_of_wavelengths_at_the_ends_of_a_table_beside_a_free_index():
    """The table of HfO2 ends at 250 and 900 nm; beyond, its index goes on with its slope there."""
    nm = np.linspace(250, 900, 66)
    film = pl.dispersion.Shifted(pl.material("HfO2"), pl.Free(-0.3, 0.3, start=0.0))
    scene = pl.Scene(pl.Layer(film, 120.0), 1.5)
    (view,) = make(*measurements(pl.Spectrum(nm, np.full(66, 0.1), "R"), scene)).views
    at = np.array([0.05])
    shift = extended(view, at).wavelength
    changes = [(shift, x) for x in (0.5, 0.0, -0.5)]
    longer, as_is, shorter = extended(view, at).signals(view.data, at, changes)[:, :66]

    known = np.real(pl.material("HfO2")(nm)) + 0.05

    def reflectance(shift):
        return np.asarray(pl.reflectance(nm + shift, 120.0, known + shift * np.gradient(known, nm), 1.5))

    np.testing.assert_allclose(as_is, reflectance(0.0), atol=1e-9)
    np.testing.assert_allclose(longer - shorter, reflectance(0.5) - reflectance(-0.5), atol=3e-5)


def test_a_wide_cone_takes_few_rays():
    """Beneath half of the index of mica lies an aperture of 0.8, but its index is never there."""
    nm, depth = np.linspace(450, 750, 20), np.array([60.0])
    of_lens = pl.Instrument(numerical_aperture=0.8)
    light, wafer = pl.Light(signal="contrast"), pl.Reference("Si", pl.Layer("SiO2", 285.0))

    def flake(thickness, index=1.58, angle=0.0):
        shifted = pl.Instrument(numerical_aperture=0.8, angle_shift=angle) if angle else of_lens
        layers = [pl.Layer(index, thickness), pl.Layer("SiO2", 285.0)]
        return pl.Scene(layers, "Si", light=light, instrument=shifted, reference=wafer)

    data = pl.simulate(flake(60.0), nm, noise=0.004)
    (view,) = make(*measurements(data, flake(pl.Free(0.5, 200.0)))).views
    scene = extended(view, depth)
    for program in scene.programs().values():
        for plan in (program.form.plan, program.form.plan.reference):
            rays = plan.row("angle-spread")
            assert rays.on
            assert rays.count * rays.around <= 3 * view.form.plan.row("angle-spread").count
    signals = scene.signals(view.data, depth, [(scene.index[0], 0.02), (scene.angle, 1.0)])[:, :20]
    truth = [pl.simulate(flake(60.0, **x), nm).values for x in ({"index": 1.58 * 1.02}, {"angle": 1.0})]
    # the error of the rays of both, 1e-6 of a fringe, divided by a reference of some percent
    np.testing.assert_allclose(signals, truth, atol=1e-4)


@pytest.mark.parametrize(
    ("angle", "cone"),
    [(55.0, {"numerical_aperture": pl.Free(0.05, 0.4)}), (80.0, {"angle_spread": pl.Free(0.0, 6.0)})],
)
def test_a_free_cone_at_oblique_incidence(angle, cone):
    """Its bounds are checked as given, and not those that the prepared scene has; it replaces an effect."""
    instrument, light = pl.Instrument(**cone), pl.Light(signal="R", angle=angle)
    scene = pl.Scene(pl.Layer(1.6, FREE), 3.9, instrument=instrument, light=light)
    [view] = make(*measurements(spectrum(angle=angle), scene)).views
    free = extended(view, np.array([THICKNESS, 3.0]))
    effects = simulations_of(view, np.array([THICKNESS, 3.0]), scene)
    assert free.angle is not None
    assert effects is not None
    assert "angle spread" not in [row.name for row in effects[1]]
    with pytest.raises(ValueError, match="reaches beyond 90 degrees"):
        pl.Scene(pl.Layer(1.6, FREE), 3.9, instrument=pl.Instrument(angle_spread=40.0), light=light)
