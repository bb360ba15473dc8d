"""The table of a film's colours against the Airy formula in complex NumPy, in steps of 1 nm."""

from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import pellicle as pl
from pellicle.colour import FilmColourTable, delta_e2000, lab, sensor
from pellicle.simulation.colours import colour_table

from ..airy import airy

EYE = sensor()
RNG = np.random.default_rng(3)
FILMS = {"soap": (1.33, 1.0, 600.0), "oxide on steel": (2.9, 2.7 + 2.8j, 150.0)}


@cache
def table_of(name):
    n, base, top = FILMS[name]
    return FilmColourTable.build(n, base, (0, top))


def exact(thickness, cosine, n1, n2):
    """XYZ (N, 3)."""
    return airy(EYE.wavelength, thickness[:, None], n1, n2, cosine[:, None]) @ EYE.weights


def films(name):
    n1, n2, top = FILMS[name]
    return RNG.uniform(0.5, top - 0.5, 400), RNG.uniform(np.cos(np.deg2rad(79)), 0.999, 400), n1, n2


@pytest.mark.slow  # compiles for 4 s
@pytest.mark.parametrize("name", FILMS)
def test_colours_in_single_precision(name):
    """Measured: 0.0004 on average and 0.03 at most, with a soap film that is almost black."""
    thickness, cosine, *media = films(name)
    found = table_of(name)(np.float32(thickness), np.float32(cosine))
    assert found.xyz.dtype == jnp.float32
    both = (np.asarray(found.xyz, float), exact(thickness, cosine, *media))
    missed = delta_e2000(*(np.asarray(lab(xyz, EYE.white)) for xyz in both))
    assert np.mean(missed) < 0.005
    assert np.max(missed) < 0.1


@pytest.mark.slow
@pytest.mark.parametrize("name", FILMS)
def test_derivatives(name):
    """Of the sum of X, Y and Z, within 1 % of the largest, against differences of the exact colours."""
    thickness, cosine, *media = films(name)
    slopes = jax.jit(jax.vmap(jax.grad(lambda d, c: table_of(name).xyz(d, c).sum(), (0, 1))))(
        thickness, cosine
    )
    for slope, nm, tilt in zip(slopes, (1e-3, 0.0), (0.0, 1e-5), strict=True):
        above, below = (exact(thickness + s * nm, cosine + s * tilt, *media).sum(-1) for s in (1, -1))
        expected = (above - below) / (2 * (nm + tilt))
        assert np.max(np.abs(slope - expected)) < 0.01 * np.max(np.abs(expected))


@pytest.mark.slow
def test_its_stated_error_and_size():
    for table in map(table_of, FILMS):
        assert table.nbytes < 1_000_000
        assert table.error.mean <= table.error.largest < 0.05
        assert table.error.slope < 0.01
    assert table_of("soap").thickness == (0.0, 600.0)


@pytest.mark.slow
def test_outside_the_table_the_edge_counts():
    table = table_of("soap")
    np.testing.assert_array_equal(table.xyz(900.0, 1.0), table.xyz(600.0, 1.0))
    np.testing.assert_array_equal(table.xyz(300.0, 0.0), table.xyz(300.0, table.cosine[0]))
    assert jax.grad(lambda d: table.xyz(d, 1.0).sum())(900.0) == 0.0


@pytest.mark.slow  # compiles for 4 s
def test_table_of_a_scene_is_that_of_the_film():
    """The forward model of scenes, with materials by name and a layer of no thickness."""
    scene = pl.Scene([pl.Layer(2.0, 0.0), pl.Layer("SiO2", pl.Free(0, 600), name="oxide")], "Si")
    table = colour_table(scene, (100.0, 300.0), (0.0, 60.0), "oxide", tolerance=1.0)
    media = pl.material("SiO2"), pl.material("Si")
    film = FilmColourTable.build(*media, (100, 300), angle=(0, 60), tolerance=1.0)
    at = np.array([120.0, 200.0, 290.0])[:, None], np.array([0.5, 0.8, 1.0])
    np.testing.assert_allclose(table.xyz(*at), film.xyz(*at), atol=2e-6)


def test_ranges_that_cannot_be(refuses):
    for thickness, angle in (
        ((100, 100), (0, 80)),
        ((-1, 100), (0, 80)),
        ((0, 100), (0, 91)),
        ((0, 100), (50, 20)),
    ):
        refuses(ValueError, "rising", FilmColourTable.build, 1.33, 1.0, thickness, angle=angle)
