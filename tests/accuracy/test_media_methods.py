"""Methods that simplify birefringent and graded media, against films that are computed directly."""

import jax
import numpy as np
import pytest

import pellicle as pl
from pellicle.accuracy.case import compiled
from pellicle.accuracy.film_methods import METHODS, reference_signal
from pellicle.effects.film_plan import alternatives
from pellicle.errors import UsageError

from .conftest import NM, few

BY_NAME = {method.name: method for method in METHODS}
reflectance = jax.jit(lambda d, n: pl.reflectance(NM, d, n, 1.5, angle=60.0))


def film(material):
    layer = pl.Layer(material, pl.Free(100.0, 300.0, start=150.0))
    return few(pl.Scene(layer, 1.5, light=pl.Light(angle=60.0)))


def answer(case, name):
    """Signal of a method, (draws, wavelengths)."""
    return compiled(case, BY_NAME[name].apply(case)).run()


def aligned():
    return film(pl.Anisotropic(1.8, 1.95))


def graded():
    return film(pl.Graded(1.5, 2.0, mix="linear"))


def test_isotropic_average_has_the_mean_index():
    case = aligned()
    np.testing.assert_allclose(
        answer(case, "isotropic average"), reflectance(case.draws, (2 * 1.8 + 1.95) / 3), atol=1e-14
    )


def test_aligned_axes_are_at_the_next_right_angles():
    tilted = film(pl.Anisotropic(1.8, 1.95, axis=(pl.Free(0.0, 90.0, start=30.0), 20.0)))
    reference = aligned()._replace(draws=tilted.draws[:, 1:])
    assert np.all(reference.draws >= 100)
    np.testing.assert_allclose(answer(tilted, "aligned axes"), answer(reference, "float64"), atol=1e-14)
    assert "the full plan has them" in str(BY_NAME["4×4 matrices"].apply(tilted))
    assert "no optic axis is tilted" in str(BY_NAME["aligned axes"].apply(aligned()))


def test_mean_of_the_depth_has_the_mean_permittivity():
    case = graded()
    mean = np.sqrt(0.5 * (1.5**2 + 2.0**2))
    np.testing.assert_allclose(answer(case, "mean of the depth"), reflectance(case.draws, mean), atol=1e-12)


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
