"""The index of a film in Mitsuba as a number or a texture, against Airy's formula."""

import numpy as np
import pytest

import pellicle as pl
from pellicle.rendering import mitsuba_plugin
from pellicle.rendering.appearance import appearance
from pellicle.rendering.mitsuba import lookup
from tests.airy import airy

mi = pytest.importorskip("mitsuba")

STEEL = 2.7 + 2.8j


@pytest.mark.slow
@pytest.mark.parametrize(("base", "tolerance"), [(1.5, 4e-4), (STEEL, 2e-3)])
def test_a_film_of_free_index_takes_a_change_of_it(tmp_path, base, tolerance):
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
                np.testing.assert_allclose(value, 1 - exact if kind else exact, atol=tolerance)


def test_a_table_of_one_index_refuses_another(tmp_path):
    np.savez(tmp_path / "film.npz", **lookup(appearance(pl.Scene(pl.Layer(2.0, 150.0), STEEL))).arrays())
    mi.set_variant("scalar_rgb")
    mitsuba_plugin.register()
    plugin = {"type": "pellicle_film", "filename": str(tmp_path / "film.npz"), "index_change": 0.1}
    with pytest.raises(
        RuntimeError, match="has one index: export a recipe in which that of the film is free"
    ):
        mi.load_dict(plugin)
