"""The mpmath reference against the tmm package, and the cases that it refuses."""

import numpy as np
import pytest

import pellicle as pl
from pellicle.accuracy.film_methods import reference_signal
from pellicle.accuracy.high_precision import signal
from pellicle.errors import UsageError
from pellicle.scene.instrument import Instrument

from ..by_tmm import films, ncs
from .conftest import NM, few

AT = np.array([0, 4, 8])
STACK = [pl.Layer(pl.dispersion.Constant(2.1, 0.05), 120.0), pl.Layer(pl.dispersion.Constant(0.2, 3.4), 15.0)]
INDICES, DEPTHS = [1.0, 2.1 + 0.05j, 0.2 + 3.4j, 1.5], [120.0, 15.0]


def seen(light, layers=STACK, substrate: object = 1.5):
    case = few(pl.Scene(layers, substrate, light=light))
    return signal(case, case.draws[0], AT)


@pytest.mark.parametrize("letter", ["s", "p"])
@pytest.mark.parametrize("kind", ["R", "T"])
def test_powers(kind, letter):
    found = seen(pl.Light(angle=50.0, signal=kind, polarisation=letter))[:, 0]
    np.testing.assert_allclose(found, films(letter, NM[AT], INDICES, DEPTHS, 50.0, kind), atol=1e-14)


def test_ellipsometry():
    found = seen(pl.Light(angle=50.0, signal="psi-delta"))
    np.testing.assert_allclose(found, ncs(NM[AT], INDICES, DEPTHS, 50.0), atol=1e-13)


@pytest.mark.parametrize("kind", ["R", "T"])
def test_a_plate_adds_intensities(kind):
    glass = pl.Substrate(pl.dispersion.Constant(1.5, 1e-5), back=1.0, plate_mm=0.5)
    found = seen(pl.Light(angle=50.0, signal=kind, polarisation="p"), substrate=glass)[:, 0]
    indices = [*INDICES[:3], 1.5 + 1e-5j, 1.0]
    truth = films("p", NM[AT], indices, [*DEPTHS, 5e5], 50.0, kind, "iccii")
    np.testing.assert_allclose(found, truth, atol=1e-8)  # tmm leaves the plate's k out at its faces


def test_ellipsometry_through_a_plate():
    """The forward model takes the plate as transparent at its faces; Mueller matrices test it elsewhere."""
    plate = pl.Substrate(pl.dispersion.Constant(1.5, 1e-8), back=1.0, plate_mm=0.5)
    case = few(pl.Scene(STACK[:1], plate, light=pl.Light(angle=50.0, signal="psi-delta")))
    truth = signal(case, case.draws[0], np.arange(9)).ravel()
    np.testing.assert_allclose(reference_signal("float64", case).values[0].ravel(), truth, atol=1e-7)


def test_the_model_is_within_rounding(oblique):
    truth = reference_signal("mpmath", oblique)
    assert truth.values.shape == (3, 9, 1)
    assert reference_signal("float64", oblique).error(oblique, truth.values[:, :, 0]) < 1e-14


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"instrument": Instrument(bandwidth=2.0)}, "bandwidth"),
        ({"instrument": Instrument(angle_spread=2.0)}, "cone"),
        ({"layers": pl.Layer(2.0, 100.0, roughness=2.0)}, "rough"),
        ({"layers": pl.Layer(2.0, 100.0, thickness_spread=2.0)}, "uneven"),
        ({"layers": pl.Layer(2.0, 250e3)}, "narrower than the sampling"),
    ],
)
def test_what_it_cannot_compute_is_refused(changes, message, refuses):
    case = few(pl.Scene(**({"layers": pl.Layer(2.0, 100.0), "substrate": 1.5} | changes)))
    with pytest.raises(UsageError, match=message) as refused:
        reference_signal("mpmath", case)
    assert '`reference="float64"`' in str(refused.value)
    refuses(UsageError, "float64 or mpmath", reference_signal, "tmm", case)
