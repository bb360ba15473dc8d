"""Numbers of a film in Mitsuba: thickness, index and tables, against Airy's formula and tmm."""

import numpy as np
import pytest

import pellicle as pl
from pellicle.colour import sensor
from pellicle.dispersion.base import known_index
from pellicle.rendering import mitsuba_plugin
from pellicle.rendering.appearance import appearance
from pellicle.rendering.mitsuba import _sides, lookup
from tests.airy import airy

mi = pytest.importorskip("mitsuba")
tmm = pytest.importorskip("tmm")

STEEL = 2.7 + 2.8j
# linear sRGB of IEC 61966-2-1 to XYZ
TO_XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])


@pytest.mark.slow
@pytest.mark.parametrize("layers", [1, 2])
def test_an_even_film_has_a_finer_table_at_its_own_thickness(tmp_path, layers):
    """Elsewhere one layer follows Airy's formula, and two are looked up, a number as a texture of it."""
    film = pl.Scene([pl.Layer(2.0, 1000.0, name="a"), pl.Layer(1.8, 200.0, name="b")][:layers], 1.5)
    np.savez(tmp_path / "film.npz", **lookup(appearance(film, layer="a")).arrays())
    mi.set_variant("scalar_spectral")
    mitsuba_plugin.register()
    si, wavelengths = mi.SurfaceInteraction3f(), [421.3, 487.6, 552.2, 618.9]
    si.wi, si.wavelengths = mi.Vector3f(0, 0.6, 0.8), wavelengths

    def reflected(thickness):
        plugin = {"type": "pellicle_film", "filename": str(tmp_path / "film.npz"), "alpha": 0.0}
        bsdf = mi.load_dict(plugin | thickness)
        sampled, weight = bsdf.sample(mi.BSDFContext(), si, 0.0, [0.5, 0.5])
        return np.ravel(weight) * sampled.pdf

    def image(nm):
        texture = {"type": "bitmap", "raw": True, "bitmap": mi.Bitmap(np.ones((2, 2, 1), np.float32))}
        return {"thickness": texture, "thickness_max": nm}

    def exact(thickness):
        depths = [np.inf, *[thickness, 200.0][:layers], np.inf]
        media = [1.0, *[2.0, 1.8][:layers], 1.5]
        angle = np.arccos(0.8)
        return [tmm.unpolarized_RT(media, depths, angle, nm)["R"] for nm in wavelengths]

    np.testing.assert_allclose(reflected({}), exact(1000.0), atol=2e-3)  # steps of 2 nm
    np.testing.assert_allclose(reflected({"thickness": 731.0}), reflected(image(731.0)), rtol=1e-4)
    off = np.max(np.abs(reflected(image(1000.0)) - exact(1000.0)))
    assert off < 1e-5 if layers == 1 else off > 1e-4  # of 5 nm


@pytest.mark.slow
@pytest.mark.parametrize("base", [1.5, STEEL])
def test_a_film_of_free_index_takes_a_change_of_it(tmp_path, base):
    free = pl.dispersion.Constant(pl.Free(1.3, 3.0, start=2.0))
    np.savez(tmp_path / "film.npz", **lookup(appearance(pl.Scene(pl.Layer(free, 150.0), base))).arrays())
    mi.set_variant("scalar_spectral")
    mitsuba_plugin.register()
    wavelengths, plugin = [421.3, 487.6, 552.2, 618.9], {"filename": str(tmp_path / "film.npz"), "alpha": 0.0}
    texture = {"type": "bitmap", "raw": True, "bitmap": mi.Bitmap(np.full((2, 2, 1), 0.07, np.float32))}
    for given, change in ((-0.05, -0.05), (0.04, 0.04), (texture, 0.07)):
        bsdf = mi.load_dict({"type": "pellicle_film", "index_change": given} | plugin)
        for cosine in (1.0, 0.7, 0.3):
            si = mi.SurfaceInteraction3f()
            si.wi, si.wavelengths = mi.Vector3f(0, np.sqrt(1 - cosine**2), cosine), wavelengths
            kinds = [0.0, 1.0 - 1e-6] if base == 1.5 else [0.0]  # reflected, transmitted
            exact = np.array(
                [airy(np.array([nm]), 150.0, 2.0 + change, base, cosine)[0] for nm in wavelengths]
            )
            for kind in kinds:
                sampled, weight = bsdf.sample(mi.BSDFContext(), si, kind, [0.5, 0.5])
                value = np.ravel(weight) * sampled.pdf * sampled.eta ** (2 if kind else 0)
                np.testing.assert_allclose(value, 1 - exact if kind else exact, atol=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("base", [1.5, STEEL])
def test_colours_of_a_film_of_free_index_take_a_change_of_it(tmp_path, base):
    free, eye = pl.dispersion.Constant(pl.Free(1.3, 3.0, start=2.0)), sensor()
    np.savez(tmp_path / "film.npz", **lookup(appearance(pl.Scene(pl.Layer(free, 150.0), base))).arrays())
    mi.set_variant("scalar_rgb")
    mitsuba_plugin.register()
    plugin = {"type": "pellicle_film", "filename": str(tmp_path / "film.npz"), "alpha": 0.0}
    for change in (-0.05, 0.04, 0.1):
        bsdf = mi.load_dict(plugin | {"index_change": change})
        for cosine in (1.0, 0.7, 0.3):
            si = mi.SurfaceInteraction3f()
            si.wi = mi.Vector3f(0, np.sqrt(1 - cosine**2), cosine)
            sampled, weight = bsdf.sample(mi.BSDFContext(), si, 0.0, [0.5, 0.5])
            exact = airy(eye.wavelength, 150.0, 2.0 + change, base, cosine) @ eye.weights
            colour = np.maximum(np.linalg.solve(TO_XYZ, exact), 0.0)
            np.testing.assert_allclose(np.ravel(weight) * sampled.pdf, colour, atol=1.5e-3)


def test_a_table_of_one_index_refuses_another(tmp_path):
    np.savez(tmp_path / "film.npz", **lookup(appearance(pl.Scene(pl.Layer(2.0, 150.0), STEEL))).arrays())
    mi.set_variant("scalar_rgb")
    mitsuba_plugin.register()
    plugin = {"type": "pellicle_film", "filename": str(tmp_path / "film.npz"), "index_change": 0.1}
    with pytest.raises(
        RuntimeError, match="has one index: export a recipe in which that of the film is free"
    ):
        mi.load_dict(plugin)


@pytest.mark.slow
@pytest.mark.parametrize("absorbs", [0.0, 0.1])
def test_indices_with_and_without_dispersion_are_those_of_their_wavelength(tmp_path, absorbs):
    """The index of the base has dispersion, that of a film that absorbs has none."""
    film = pl.dispersion.Constant(2.0, absorbs) if absorbs else pl.dispersion.Cauchy(1.9, 2e4)
    scene = pl.Scene(pl.Layer(film, 150.0), pl.dispersion.Cauchy(1.5, 4e3))
    np.savez(tmp_path / "film.npz", **lookup(appearance(scene)).arrays())
    mi.set_variant("scalar_spectral_polarized")
    mitsuba_plugin.register()
    si, wavelengths = mi.SurfaceInteraction3f(), [421.3, 487.6, 552.2, 618.9]
    si.wi, si.wavelengths = mi.Vector3f(0, 0.6, 0.8), wavelengths
    bsdf = mi.load_dict({"type": "pellicle_film", "filename": str(tmp_path / "film.npz"), "alpha": 0.0})
    context = mi.BSDFContext(mi.TransportMode.Importance)
    for kind, choice in (("R", 0.0), ("T", 1 - 1e-6)):
        sampled, weight = bsdf.sample(context, si, choice, [0.5, 0.5])
        expected = []
        for nm in wavelengths:
            media = [1.0, 2.0 + 1j * absorbs if absorbs else 1.9 + 2e4 / nm**2, 1.5 + 4e3 / nm**2]
            both = tmm.unpolarized_RT(media, [np.inf, 150.0, np.inf], np.arccos(0.8), nm)
            expected.append(both[kind])
        np.testing.assert_allclose(np.array(weight)[0, 0] * sampled.pdf, expected, atol=5e-5)


EPILAYER = pl.Scene(pl.Layer(2.5605, 8000.0), pl.dispersion.Constant(2.56, 3e-5))
"""On a base that absorbs a little, in which light near grazing incidence would gain energy."""


@pytest.mark.parametrize(
    "scene",
    [
        pl.Scene(pl.Layer(1.33, 100.0), 1.0),
        pl.Scene(pl.Layer(1.5, 100.0), 1.33, ambient="H2O"),
        EPILAYER,
    ],
    ids=["bubble", "in water", "epilayer"],
)
def test_reflectances_are_finite_and_at_most_1(scene):
    sides, _ = _sides(appearance(scene), np.array([0.0, scene.layers[0].thickness]), 12, np.array([700.0]))
    for elements in sides.values():
        assert np.max(np.abs(elements)) <= 1 + 1e-9  # False for NaN


def test_an_angle_is_that_in_an_ambient_medium_with_dispersion():
    scene, nm = pl.Scene(pl.Layer(1.5, 100.0), 2.0, ambient="H2O"), np.array([400.0, 700.0])
    sides, _ = _sides(appearance(scene), np.array([100.0]), 12, nm)
    n0 = np.asarray(known_index(scene.ambient, nm))
    cosine = (2 / 11) ** 2  # of the third node
    found = [
        tmm.unpolarized_RT([n, 1.5, 2.0], [np.inf, 100.0, np.inf], np.arccos(cosine), each)["R"]
        for n, each in zip(n0.tolist(), nm.tolist(), strict=True)
    ]
    np.testing.assert_allclose(sides[""][0, 2, -2:, 0], found, rtol=1e-9)
