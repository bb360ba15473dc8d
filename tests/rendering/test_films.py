"""Films to export: of surfaces, and of fits by the names of their parameters."""

import dataclasses

import numpy as np

import pellicle as pl
from pellicle.errors import DataError, UsageError
from pellicle.rendering.export import film_of, with_values
from pellicle.scene.free import start_values

NM = np.array([450.0, 550.0, 650.0])


def test_a_surface_is_a_film_on_rough_facets(refuses):
    """Indices per channel, in the order of the model's wavelengths, are linear between them."""
    numbers = {"thickness": pl.Free(10, 70, start=33), "n": 2.9, "base_n": [2.6, 2.5, 2.4], "base_k": 2.8}
    surface = pl.Surface("microfacet-film", numbers | {"roughness": 0.3}, (650.0, 550.0, 450.0))
    film = film_of(surface)
    [layer] = film.scene.layers
    assert (layer.thickness, film.roughness) == (33, 0.3)
    np.testing.assert_allclose(layer.material(NM), 2.9)
    np.testing.assert_allclose(film.scene.substrate.material(NM), [2.4 + 2.8j, 2.5 + 2.8j, 2.6 + 2.8j])
    assert film.notes == ("the diffuse part of the surface is left out",)
    bright = pl.Surface("microfacet-film", {"diffuse": 0.0, "multiple_scattering": 1.0})
    assert film_of(bright).notes == ("light reflected more than once between facets is left out",)
    for model in ("granier-heidrich", "clear-coat-film"):
        refuses(UsageError, f"{model} is not a film on a base in air", film_of, pl.Surface(model))


def test_values_of_a_fit_replace_starts_by_name(refuses):
    layers = [pl.Layer(pl.Free(1.3, 1.7), pl.Free(10, 300), name="oxide"), pl.Layer(2.0, pl.Free(5, 50))]
    scene = pl.Scene(layers, "Si", light=pl.Light(angle=pl.Free(0, 10)))
    values = {"oxide.n": 1.45, "oxide.thickness": 120.0, "layer2.thickness": 60.0}  # beyond its bound
    found = with_values(scene, values)
    assert start_values(found).tolist() == [1.45, 120, 60, 5]
    refuses(DataError, r"no value of oxide\.thickness", with_values, scene, {"oxide.n": 1.45})


def test_values_of_a_surface():
    surface = pl.Surface("granier-heidrich", {"thickness": pl.Free(0, 500), "n": pl.Free(1.1, 2.5)})
    found = with_values(surface, {"thickness": 250.0, "n_r": 1.4, "n_g": 1.5, "n_b": 1.6})
    assert isinstance(found, pl.Surface)
    assert found.numbers == {"thickness": 250, "n": [1.4, 1.5, 1.6]}


def test_a_fit_has_its_best_values():
    scene = pl.Scene(pl.Layer(1.46, pl.Free(200, 400)), 3.9 + 0.02j)
    estimate = pl.fitting.result.Estimate("thickness", 287.0, 0.1, "nm", 200.0, 400.0, True)
    fit = object.__new__(pl.Fit)
    for field in dataclasses.fields(pl.Fit):
        object.__setattr__(fit, field.name, None)
    object.__setattr__(fit, "scene", scene)
    object.__setattr__(fit, "parameters", {"thickness": estimate})
    assert start_values(film_of(fit).scene).tolist() == [287]


def test_a_birefringent_film_is_refused(refuses):
    film = pl.Scene(pl.Layer(pl.Anisotropic(1.8, 1.95), 150.0), "Si")
    refuses(UsageError, "birefringent film is not exported", film_of, film)
