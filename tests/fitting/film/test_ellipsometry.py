"""Thicknesses from Ψ and Δ."""

from dataclasses import replace

import numpy as np
import pytest

import pellicle as pl
from pellicle.errors import UsageError

from ...differences import derivative

WAVELENGTH = np.linspace(300.0, 900.0, 64)
NOISE = 0.02
"""Degrees of Ψ."""


def measured(thickness: float, angle: float = 70.0) -> pl.Spectrum:
    """Noisy Ψ and Δ of an oxide on silicon."""
    light = pl.Light(angle=angle, signal="psi-delta")
    film = pl.Scene(pl.Layer("SiO2", thickness), "Si", light=light)
    return replace(pl.simulate(film, WAVELENGTH, noise=NOISE), path="oxide.csv")


def scene(**options) -> pl.Scene:
    return pl.Scene(pl.Layer("SiO2", pl.Free(0, 1000)), "Si", **options)


@pytest.mark.slow
def test_a_thin_oxide():
    thickness = 2.0
    found = pl.fit(measured(thickness), scene())
    assert found.status == "converged"
    assert found["thickness"].value == pytest.approx(thickness, abs=0.2)
    assert abs(found["thickness"].value - thickness) < 4 * found["thickness"].stderr
    assert 0.7 < found.chi2_reduced < 1.4
    assert found.rms < 0.05  # degrees
    assert np.max(np.abs(found.curve.delta_residual / found.spectrum.delta_sigma)) < 6


NOISES = [(0.2, 0.02), *(pytest.param(*x, marks=pytest.mark.slow) for x in ((0.02, 0.05), (0.002, 0.5)))]


@pytest.mark.slow
@pytest.mark.parametrize(("psi_sigma", "delta_sigma"), NOISES)
def test_the_error_is_that_of_both_angles_with_their_own_noise(psi_sigma, delta_sigma):
    """Cramér and Rao's bound from differences of Ψ and Δ themselves: neither noise is spread over the other.

    Residuals of alternating sign, which no correlation widens.
    """
    psi, delta = (np.asarray(x) for x in pl.ellipsometry(WAVELENGTH, 100.0, "SiO2", "Si", angle=70.0))
    sign = (-1.0) ** np.arange(WAVELENGTH.size)
    spectrum = replace(
        measured(100.0),
        values=psi + psi_sigma * sign,
        delta=(delta + delta_sigma * sign) % 360,
        sigma=np.full(64, psi_sigma),
        delta_sigma=np.full(64, delta_sigma),
    )
    slopes = derivative(
        lambda d: np.array(pl.ellipsometry(WAVELENGTH, d, "SiO2", "Si", angle=70.0)), 100.0, 0.01
    )
    information = np.sum((slopes / np.array([[psi_sigma], [delta_sigma]])) ** 2)
    assert pl.fit(spectrum, scene())["thickness"].stderr_noise == pytest.approx(information**-0.5, rel=0.03)


def test_wrap_around_does_not_matter():
    """Δ of 359.9 and 0.1 are neighbours."""
    spectrum = measured(140.0, 75.0)
    assert np.ptp(spectrum.delta) > 300
    fit = pl.fit(spectrum, scene())
    assert fit.status == "converged"
    # components in the frame of each point are whole numbers, which nobody has rounded
    assert not any("rounded" in w for w in fit.warnings)


def test_what_ellipsometry_cannot_have(refuses):
    spectrum = measured(100.0)
    refuses(UsageError, "no scale and no offset", pl.fit, spectrum, scene(instrument=pl.Instrument("free")))
    with pytest.raises(UsageError, match=r"oxide.csv: ellipsometry needs its angle of incidence"):
        pl.fit(replace(spectrum, angle=None), scene())
    with pytest.raises(UsageError, match=r"own angles of incidence, 70 degrees, .*`angle=60`"):
        pl.fit(spectrum, scene(light=pl.Light(angle=60.0, signal="psi-delta")))


@pytest.mark.slow  # compiles a scene of its own
def test_hafnia(shared_data):
    """109 nm with its index free, as an independent fit found (../shared/data, SOURCE.md)."""
    path = shared_data / "thinfilmstools_oxides" / "hafnia_psi_delta.csv"
    spectrum = pl.read_spectrum(path, range=(300.1, 1999.9))
    layer = pl.dispersion.Cauchy(pl.Free(1.2, 3.0), pl.Free(0, 1e5))
    found = pl.fit(spectrum, pl.Scene(pl.Layer(layer, pl.Free(1, 1000)), "SiO2"))
    assert found.status == "converged"
    assert found["thickness"].value == pytest.approx(109.0, abs=2.0)


@pytest.mark.slow  # compiles a scene of its own
def test_a_free_angle_goes_before_the_one_that_the_file_tells():
    """The stage stood at 70.4 degrees where the file says 70."""
    light = pl.Light(angle=pl.Free(69.0, 71.0), signal="psi-delta")
    fit = pl.fit(replace(measured(100.0, 70.4), angle=np.full(64, 70.0)), scene(light=light))
    for name, truth in (("angle", 70.4), ("thickness", 100.0)):
        assert abs(fit[name].value - truth) < 4 * fit[name].stderr_noise < 0.2
