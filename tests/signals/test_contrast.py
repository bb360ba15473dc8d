"""Optical contrast against a reference of its own: values by the package tmm, fits, files and recipes."""

from pathlib import Path

import equinox as eqx
import numpy as np
import pytest
import tmm

import pellicle as pl
from pellicle.data.options import SIGNALS, SPACES
from pellicle.data.read_spectrum import read_spectrum
from pellicle.data.write_spectrum import write_spectrum
from pellicle.effects.film_plan import exact, plan
from pellicle.errors import DataError, UsageError
from pellicle.fitting.film.extended_scene import extended
from pellicle.fitting.film.problem import Measured, make
from pellicle.recipes.python_text import python_text
from pellicle.recipes.read import read_recipe
from pellicle.recipes.write import recipe_text
from pellicle.reporting.figures import draw_spectrum
from pellicle.scene.film import with_wavelength
from pellicle.signals.registry import SIMULATED
from tests.film_recipes import CONTRAST

ROOT = Path(__file__).resolve().parents[2]

NM = np.linspace(450.0, 750.0, 64)
FILM, OXIDE, SILICON = 2.6 + 1.3j, 1.46, 3.9 + 0.02j


def scene(form: str = "relative", **more) -> pl.Scene:
    flake = pl.Layer(FILM, pl.Free(0.1, 20.0, start=3.35), "flake")
    reference = pl.Reference(SILICON, pl.Layer(OXIDE, 285.0), form)
    layers = [flake, pl.Layer(OXIDE, 285.0, "oxide")]
    return pl.Scene(layers, SILICON, light=pl.Light(signal="contrast", **more), reference=reference)


OXIDISED = (OXIDE, 285.0)


def reflectance(stack, angle: float, polarisation: str) -> np.ndarray:
    indices, depths = [1.0, *(n for n, _ in stack), SILICON], [np.inf, *(d for _, d in stack), np.inf]
    each = [tmm.coh_tmm(polarisation, indices, depths, np.deg2rad(angle), nm)["R"] for nm in NM]
    return np.array(each)


def contrast(form: str, sample: np.ndarray, bare: np.ndarray) -> np.ndarray:
    return (sample - bare) / (bare if form == "relative" else sample + bare)


def by_tmm(form: str, angle: float, polarisation: str) -> np.ndarray:
    stacks = [(FILM, 3.35), OXIDISED], [OXIDISED]
    return contrast(form, *(reflectance(stack, angle, polarisation) for stack in stacks))


@pytest.mark.parametrize(
    ("form", "angle", "polarisation"),
    [("relative", 0.0, "s"), ("normalised", 0.0, "s"), ("relative", 50.0, "p"), ("normalised", 50.0, "s")],
)
def test_values_of_tmm(form, angle, polarisation):
    simulated = pl.simulate(scene(form, angle=angle, polarisation=polarisation), NM)
    np.testing.assert_allclose(simulated.values, by_tmm(form, angle, polarisation), atol=1e-12)


def through_lens(stack, aperture: float, weight=np.ones_like) -> np.ndarray:
    """Reflectance of unpolarised light by 8 rays, whose sines fill the pupil, each of a `weight`(cos θ)."""
    nodes, weights = np.polynomial.legendre.leggauss(8)
    sines = aperture * np.sqrt(0.5 * (nodes + 1))
    rays = [
        [reflectance(stack, float(np.rad2deg(np.arcsin(sine))), polarisation) for polarisation in "sp"]
        for sine in sines
    ]
    return np.average(np.mean(rays, axis=1), axis=0, weights=weights * weight(np.sqrt(1 - sines**2)))


@pytest.mark.parametrize(("factor", "stray"), [(None, None), (0.7, 0.03)])
def test_a_wide_cone_with_apodisation_and_stray_light(factor, stray):
    """A lens whose pupil is lit by exp(−2Gρ²), as Zemax calls it, and 3 % of the light on both samples."""
    instrument = pl.Instrument(numerical_aperture=0.8, apodisation=factor, stray_light=stray)
    seen = eqx.tree_at(lambda s: s.instrument, scene("normalised"), instrument)

    def lit(cosine):
        return np.exp(-2 * (factor or 0.0) * (1 - cosine**2) / 0.8**2)

    both = (through_lens(stack, 0.8, lit) for stack in ([(FILM, 3.35), OXIDISED], [OXIDISED]))
    truth = contrast("normalised", *(power + (stray or 0.0) for power in both))
    # the error of the rays, 1e-6 of a fringe, divided by a reflectance of some percent
    np.testing.assert_allclose(pl.simulate(seen, NM).values, truth, atol=2e-5)


def test_a_group_in_the_reference_at_two_angles():
    """A mirror of ten pairs, bare and beneath a film, at 0 and 45°."""
    pair = [(2.3, 60.0), (OXIDE, 94.0)]
    mirror = pl.Group([pl.Layer(n, d) for n, d in pair], 10)
    nm, angles = np.tile(NM[::4], 2), np.repeat([0.0, 45.0], 16)
    light = pl.Light(nm, angle=angles, signal="contrast", polarisation="s")
    bare = pl.Reference(SILICON, mirror, "normalised")
    film = pl.Scene([pl.Layer(FILM, 20.0), mirror], SILICON, light=light, reference=bare)

    def at(angle):
        return (reflectance(stack, angle, "s")[::4] for stack in ([(FILM, 20.0), *10 * pair], 10 * pair))

    # a spectrum is in the order of the wavelengths, then of the angles
    truth = np.stack([contrast("normalised", *at(angle)) for angle in (0.0, 45.0)], axis=1).ravel()
    simulated = pl.simulate(film, nm)
    np.testing.assert_allclose(simulated.values, truth, atol=1e-9)
    noisy = pl.simulate(film, nm, noise=0.01, seed=3)
    assert 0.005 < np.std(noisy.values - simulated.values) < 0.02


def test_apodisation_and_stray_light_are_checked(refuses):
    refuses(ValueError, "`apodisation` is that of a cone", pl.Instrument, apodisation=0.5)
    refuses(ValueError, "`stray_light` is a fraction", pl.Instrument, stray_light=1.0)
    of_power = pl.Scene(pl.Layer(1.46, 100.0), "Si", instrument=pl.Instrument(stray_light=0.01))
    refuses(UsageError, "for R give `offset`", pl.simulate, of_power, NM)


def test_a_bare_reference_and_a_plan_within_a_tolerance():
    light = pl.Light(NM, signal="contrast")
    bare = pl.Scene(pl.Layer(1.46, 100.0), "Si", light=light, reference=pl.Reference("Si"))
    sample, substrate = (pl.reflectance(NM, d, 1.46, "Si") for d in (100.0, 0.0))
    values = pl.simulate(bare, NM).values
    np.testing.assert_allclose(values, (sample - substrate) / substrate, atol=1e-12)
    assert exact(bare).reference == exact(bare).reference.static_key.__class__(**vars(exact(bare).reference))
    assert plan(bare, 1e-3).error_bound <= 1e-3


def test_scene_and_data_are_checked(refuses):
    without = pl.Scene(pl.Layer(1.46, pl.Free(10, 300)), "Si", light=pl.Light(signal="contrast"))
    refuses(UsageError, r"contrast needs a reference: .*\[reference\]", pl.simulate, without, NM)
    refuses(UsageError, "`form`", pl.Reference, "Si", form="difference")
    refuses(UsageError, "a `reference` is known", pl.Reference, "Si", pl.Layer("SiO2", pl.Free(10, 300)))
    with pytest.raises(DataError, match=r"`values` at 450 nm: -1\.2 is a contrast below -1"):
        pl.Spectrum(NM, np.full(64, -1.2), "contrast")
    refuses(DataError, "above 50 for a contrast", pl.Spectrum, NM, np.full(64, 120.0), "contrast")
    free = pl.Instrument(scale="free")
    scaled = pl.Scene(scene().layers, SILICON, instrument=free, reference=scene().reference)
    refuses(UsageError, "contrast has no scale and no offset", pl.fit, pl.simulate(scene(), NM), scaled)


def test_files(tmp_path):
    written = pl.simulate(scene(), NM, noise=0.004)
    write_spectrum(tmp_path / "c.csv", written)
    back = read_spectrum(tmp_path / "c.csv")
    assert back.signal == "contrast"
    np.testing.assert_array_equal(back.values, written.values)
    rows = "\n".join(f"{nm},{100 * value}" for nm, value in zip(NM, written.values, strict=True))
    (tmp_path / "percent.csv").write_text(f"wavelength_nm,ΔR/R (%)\n{rows}\n", encoding="utf-8")
    np.testing.assert_allclose(read_spectrum(tmp_path / "percent.csv").values, written.values)
    assert draw_spectrum(back).axes[0].get_ylabel() == "contrast"


def test_a_recipe_both_ways(tmp_path, write):
    path = tmp_path / "flake.toml"
    for form in ("", 'form = "normalised"\n'):
        path.write_text(CONTRAST + form, encoding="utf-8")
        read = read_recipe(path).scene()
        assert read.reference == scene("normalised" if form else "relative").reference
        again = write(recipe_text(read, tmp_path), "again.toml")
        assert read_recipe(again).scene().reference == read.reference
        assert "reference=pl.Reference(" in python_text(with_wavelength(read, None))


def test_the_example_recipe():
    """`docs/examples/flake.toml`; and the words of options are those of the registry."""
    read = read_recipe(ROOT / "docs" / "examples" / "flake.toml").scene()
    assert set(SIMULATED) == set(SIGNALS) - set(SPACES)
    data = pl.simulate(read, NM, noise=0.004, seed=1)
    assert data.signal == "contrast"
    assert 0.2 < np.ptp(data.values) < 3


@pytest.mark.slow
def test_effects_on_one_wafer_move_sample_and_reference():
    """Index of the oxide in both, an oxide on bare silicon in both, by tmm; `pl.Tied` follows the sample."""
    film, nm = pl.Layer(2.0, pl.Free(1, 150), "film"), NM

    def by_stacks(*below: tuple[float, float]) -> np.ndarray:
        stacks = [(2.0, 54.0), *below], [*below]
        return contrast("relative", *(reflectance(stack, 0.0, "s") for stack in stacks))

    def changed(scene: pl.Scene, number, *sizes: float) -> np.ndarray:
        seen = with_wavelength(eqx.tree_at(lambda s: s.light, scene, pl.Light(signal="contrast")), nm)
        view = make(Measured(seen, nm, np.zeros(nm.size), np.ones(nm.size), seen.light.kind)).views[0]
        extension = extended(view, np.array([54.0]))
        changes = [(number(extension), size) for size in sizes]
        rows = extension.signals(view.data, np.array([54.0]), changes)
        return rows[:, : nm.size]

    oxidised = pl.Scene(
        [film, pl.Layer(OXIDE, 285.0)], SILICON, reference=pl.Reference(SILICON, pl.Layer(OXIDE, 285.0))
    )
    more, less = changed(oxidised, lambda x: x.index[1], 0.01, -0.01)
    np.testing.assert_allclose(more, by_stacks((1.01 * OXIDE, 285.0)), atol=1e-9)
    np.testing.assert_allclose(less, by_stacks((0.99 * OXIDE, 285.0)), atol=1e-9)
    bare = pl.Scene(film, SILICON, reference=pl.Reference(SILICON))
    [one] = changed(bare, lambda x: x.oxide, 1.0)
    np.testing.assert_allclose(one, by_stacks((1.46, 1.0)), atol=1e-9)
    tied = pl.Reference(SILICON, pl.Layer(OXIDE, pl.Tied("layer2.thickness / 2 + 100")))
    light = pl.Light(signal="contrast")
    given = pl.Scene(
        [pl.Layer(2.0, 54.0), pl.Layer(OXIDE, pl.Free(200, 400))], SILICON, light=light, reference=tied
    )
    sample, known = (
        reflectance(stack, 0.0, "s") for stack in ([(2.0, 54.0), (OXIDE, 300.0)], [(OXIDE, 250.0)])
    )
    np.testing.assert_allclose(pl.simulate(given, nm).values, contrast("relative", sample, known), atol=1e-9)
