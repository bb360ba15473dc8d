"""Each method of simulation leaves out its own effect and nothing else, against independent numbers."""

import jax
import numpy as np
import pytest

import pellicle as pl
from pellicle.accuracy.case import compiled
from pellicle.accuracy.film_methods import METHODS
from pellicle.scene.instrument import Instrument

from .conftest import NM, few

reflectance = jax.jit(lambda d, n, substrate, angle: pl.reflectance(NM, d, n, substrate, angle=angle))
BY_NAME = {method.name: method for method in METHODS}


def answer(case, name):
    """Signal of a method, (draws, wavelengths)."""
    method = BY_NAME[name]
    return compiled(case, method.apply(case), method.double).run()


def reason(case, name):
    variant = BY_NAME[name].apply(case)
    assert isinstance(variant, str)
    return variant


def by_library(case, thickness=None, **changes):
    """Reflectance of the films by `pl.reflectance`, with something of the scene changed."""
    given = {
        "angle": 60.0,
        "n": 1.9 + 12000.0 / NM**2,
        "k": case.draws[:, :1],
        "substrate": 1.5 + 0.4j,
    } | changes
    layer = given["n"] + 1j * given["k"]
    return np.asarray(reflectance(case.draws[:, 1:], layer, given["substrate"], given["angle"]))


@pytest.mark.slow
def test_what_is_left_out_is_left_out(oblique):
    k, d = oblique.draws.T
    assert np.all(k <= 0.2)
    assert np.all(d >= 50)
    for name, changes in {
        "float64": {},
        "normal incidence": {"angle": 0.0},
        "constant index": {"n": 1.9 + 12000.0 / 580.0**2},
        "transparent layer": {"k": 0.0 * k[:, None]},
    }.items():
        np.testing.assert_allclose(answer(oblique, name), by_library(oblique, **changes), atol=1e-14)


def test_single_precision_is_single(oblique):
    found = answer(oblique, "float32")
    assert found.dtype == np.float32
    error = np.abs(found - by_library(oblique)).max()
    assert 1e-9 < error < 2e-6


def test_what_is_planned_is_within_the_tolerance():
    """A bandwidth that hardly blurs the fringes may go, and most of the cost with it."""
    case = few(pl.Scene(pl.Layer(2.2, 300.0), 1.5, instrument=Instrument(bandwidth=1.0)), draws=1)
    full, planned = (compiled(case, BY_NAME[name].apply(case)) for name in ("float64", "planned"))
    assert 0 < np.abs(planned.run() - full.run()).max() < case.tolerance
    assert planned.flops < full.flops / 3


def test_coarser_wavelengths_are_joined_by_lines(oblique):
    truth = by_library(oblique)
    lines = np.stack([np.interp(NM, NM[::2], row[::2]) for row in truth])
    np.testing.assert_allclose(answer(oblique, "every 2nd wavelength"), lines, atol=1e-14)
    np.testing.assert_allclose(answer(oblique, "twice the wavelengths"), truth, atol=1e-14)
    assert "too few" in reason(oblique, "every 4th wavelength")


def test_orders_converge_as_a_geometric_series(oblique):
    """Each order is smaller than the last by |q| or more, which is below a half here."""
    truth = by_library(oblique)
    errors = [np.abs(answer(oblique, f"{m} order{'s' * (m > 1)}") - truth).max() for m in (1, 3, 8)]
    assert errors[0] < 0.2
    assert errors[1] < errors[0] / 4
    assert errors[2] < errors[1] / 32


def test_incoherent_is_the_mean_over_the_phase(oblique):
    """Over one period of a film that does not absorb, as thicknesses."""
    scene = pl.Scene(pl.Layer(2.2, pl.Free(50.0, 400.0, start=100.0)), substrate=1.5)
    case = few(scene)
    periods = np.arange(16)[:, None] / 16 * NM / (2 * 2.2)
    mean = np.asarray(pl.reflectance(NM, 100.0 + periods, 2.2, 1.5)).mean(axis=0)
    np.testing.assert_allclose(answer(case, "incoherent"), np.tile(mean, (3, 1)), atol=1e-12)


def test_a_blur_a_cone_and_a_back_face_are_left_out():
    film = pl.Layer(2.2, 300.0, thickness_spread=8.0)
    glass = pl.Substrate(1.5, back=1.0)
    case = few(pl.Scene(film, glass, instrument=Instrument(bandwidth=4.0)), draws=1)
    bare = np.asarray(pl.reflectance(NM, 300.0, 2.2, 1.5))
    front, back = bare, (0.5 / 2.5) ** 2
    np.testing.assert_allclose(
        answer(case, "closed form")[0], front + (1 - front) ** 2 * back / (1 - front * back), atol=1e-13
    )
    assert np.abs(answer(case, "half space")[0] - bare).max() > 1e-3  # still blurred
    cone = few(pl.Scene(pl.Layer(2.2, 300.0), 1.5, instrument=Instrument(angle_spread=20.0)), draws=1)
    np.testing.assert_allclose(answer(cone, "one ray")[0], bare, atol=1e-14)
    assert np.abs(answer(cone, "float64")[0] - bare).max() > 1e-3


def test_methods_that_do_not_apply_say_why():
    case = few(pl.Scene(pl.Layer(2.2, 300.0), 1.5))
    assert {name for name in BY_NAME if not isinstance(BY_NAME[name].apply(case), str)} == {
        *("float64", "float32", "planned", "incoherent", "twice the wavelengths", "every 2nd wavelength"),
        *("1 order", "2 orders", "3 orders", "5 orders", "8 orders"),
    }
    angles = few(pl.Scene(pl.Layer(2.2, 300.0), 1.5, light=pl.Light(angle=70.0, signal="psi-delta")))
    assert "compares s and p" in reason(angles, "normal incidence")
    assert "series of orders" in reason(angles, "incoherent")
    assert answer(angles, "every 2nd wavelength").shape == (3, 27)
    tilted = few(pl.Scene(pl.Layer(pl.Anisotropic(1.6, 1.7, axis=(40, 25)), 300.0), 1.5), draws=1)
    assert "s and p mix have no series" in reason(tilted, "1 order")


@pytest.mark.parametrize("name", ["3 nodes", "smooth faces"])
def test_averages_and_roughness(name):
    """Nodes are cut, faces made smooth: closer to the truth, and exactly smooth."""
    rough = pl.Layer(2.2, 120.0, roughness=6.0 if name == "smooth faces" else 0.0)
    width = 0.0 if name == "smooth faces" else 6.0
    two = [rough, pl.Layer(1.46, 150.0)]
    case = few(pl.Scene(two, 3.9, instrument=Instrument(bandwidth=width)), draws=1)
    full, cut = answer(case, "float64")[0], answer(case, name)[0]
    if name == "smooth faces":
        smooth = np.asarray(pl.reflectance(NM, [120.0, 150.0], [2.2, 1.46], 3.9))
        np.testing.assert_allclose(cut, smooth, atol=1e-13)
    assert 1e-9 < np.abs(full - cut).max() < 0.1
