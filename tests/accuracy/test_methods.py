"""Each method of simulation leaves out its own effect and nothing else, against independent numbers."""

import jax
import numpy as np
import pytest

import pellicle as pl
from pellicle.accuracy.case import compiled
from pellicle.accuracy.film_methods import METHODS, reference_signal
from pellicle.effects.film_plan import alternatives
from pellicle.errors import UsageError
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


def by_library(case, **changes):
    """Reflectance of the films by `pl.reflectance`, with something of the scene changed."""
    given = {"angle": 60.0, "n": 1.9 + 12000.0 / NM**2, "k": case.draws[:, :1]} | changes
    return np.asarray(
        reflectance(case.draws[:, 1:], given["n"] + 1j * given["k"], 1.5 + 0.4j, given["angle"])
    )


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


@pytest.mark.slow
def test_coarser_wavelengths_are_joined_by_lines(oblique):
    truth = by_library(oblique)
    lines = np.stack([np.interp(NM, NM[::2], row[::2]) for row in truth])
    np.testing.assert_allclose(answer(oblique, "every 2nd wavelength"), lines, atol=1e-14)
    np.testing.assert_allclose(answer(oblique, "twice the wavelengths"), truth, atol=1e-14)
    assert "too few" in reason(oblique, "every 4th wavelength")


@pytest.mark.slow
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


@pytest.mark.parametrize(("name", "roughness", "width"), [("3 nodes", 0.0, 6.0), ("smooth faces", 6.0, 0.0)])
def test_averages_and_roughness(name, roughness, width):
    """Nodes are cut, faces made smooth: closer to the truth, and exactly smooth."""
    two = [pl.Layer(2.2, 120.0, roughness=roughness), pl.Layer(1.46, 150.0)]
    case = few(pl.Scene(two, 3.9, instrument=Instrument(bandwidth=width)), draws=1)
    full, cut = answer(case, "float64")[0], answer(case, name)[0]
    if roughness:
        smooth = np.asarray(pl.reflectance(NM, [120.0, 150.0], [2.2, 1.46], 3.9))
        np.testing.assert_allclose(cut, smooth, atol=1e-13)
    assert 1e-9 < np.abs(full - cut).max() < 0.1


def film(material):
    layer = pl.Layer(material, pl.Free(100.0, 300.0, start=150.0))
    return few(pl.Scene(layer, 1.5, light=pl.Light(angle=60.0)))


def aligned():
    return film(pl.Anisotropic(1.8, 1.95))


def graded():
    return film(pl.Graded(1.5, 2.0, mix="linear"))


def test_isotropic_average_has_the_mean_index():
    case = aligned()
    mean = reflectance(case.draws, (2 * 1.8 + 1.95) / 3, 1.5, 60.0)
    np.testing.assert_allclose(answer(case, "isotropic average"), mean, atol=1e-14)


def test_aligned_axes_are_at_the_next_right_angles():
    tilted = film(pl.Anisotropic(1.8, 1.95, axis=(pl.Free(0.0, 90.0, start=30.0), 20.0)))
    reference = aligned()._replace(draws=tilted.draws[:, 1:])
    assert np.all(reference.draws >= 100)
    np.testing.assert_allclose(answer(tilted, "aligned axes"), answer(reference, "float64"), atol=1e-14)
    assert "the full plan has them" in str(BY_NAME["4×4 matrices"].apply(tilted))
    assert "no optic axis is tilted" in str(BY_NAME["aligned axes"].apply(aligned()))


@pytest.mark.slow  # compiles for 2 s
def test_mean_of_the_depth_has_the_mean_permittivity():
    case = graded()
    mean = reflectance(case.draws, np.sqrt(0.5 * (1.5**2 + 2.0**2)), 1.5, 60.0)
    np.testing.assert_allclose(answer(case, "mean of the depth"), mean, atol=1e-12)


def test_high_precision_computes_aligned_axes():
    """The principal indices reach other axes than for an isotropic film; a tilt is refused by name."""
    case = film(pl.Anisotropic(x=1.8 + 0.1j, y=1.7, z=1.95, axis=(90.0, 0.0, 90.0)))
    exact = reference_signal("mpmath", case)
    assert exact.error(case, answer(case, "float64")) < 1e-14
    assert exact.error(case, answer(film(pl.Anisotropic(1.8 + 0.1j, 1.95)), "float64")) > 0.01
    with pytest.raises(UsageError, match="optic axis is tilted"):
        reference_signal("mpmath", film(pl.Anisotropic(1.8, 1.95, axis=(20.0, 0.0))))


@pytest.mark.slow  # compiles four programs of slices
def test_slices_converge_as_their_orders():
    """Homogeneous slices of a linear permittivity have second order, the others sixth."""
    case = graded()
    edges = np.arange(33) / 32
    middle = np.sqrt(1.5**2 + (2.0**2 - 1.5**2) * 0.5 * (edges[1:] + edges[:-1]))
    by_hand = [
        np.asarray(pl.reflectance(NM, [d / 32] * 32, list(middle), 1.5, angle=60.0)) for d in case.draws[:, 0]
    ]
    np.testing.assert_allclose(answer(case, "32 homogeneous slices"), by_hand, atol=1e-13)
    truth = answer(case, "float64")
    coarse, fine = (np.abs(answer(case, f"{n} homogeneous slices") - truth).max() for n in (8, 32))
    assert 12 < coarse / fine < 20
    assert np.abs(answer(case, "4 slices") - truth).max() < fine


def test_removal_counts_a_free_index_once():
    """Without birefringence the angle of the axis has no gradient: the effect must stay."""
    material = pl.Anisotropic(pl.dispersion.Constant(pl.Free(1.6, 1.9)), 1.95, axis=(pl.Free(0.0, 90.0), 0.0))
    light = pl.Light(wavelength=NM, angle=60.0)
    assert alternatives("anisotropy", pl.Scene(pl.Layer(material, 150.0), 1.5, light=light)) == []
