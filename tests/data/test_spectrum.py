"""Spectra and BRDF samples made in Python: the same limits as for files, in one sentence."""

import numpy as np
import pytest

import pellicle as pl
from pellicle.errors import DataError, UsageError

NM = np.array([500.0, 600.0, 700.0])
ANGLES = {"signal": "psi-delta", "delta": NM / 10}


@pytest.mark.parametrize(
    ("values", "changes", "message"),
    [
        (30.0, {}, "`values` at 500 nm: 30 is above 1.5 for a reflectance; divide percent by 100, or give"),
        (-0.1, {}, "`values` at 500 nm: -0.1 is a reflectance below zero by more than noise"),
        (np.nan, {}, "`values` at 500 nm: nan is not finite"),
        (0.3, {"sigma": np.zeros(3)}, "`sigma` at 500 nm: 0 is not above zero"),
        (0.3, {"angle": np.full(3, 95.0)}, "`angle` at 500 nm: 95 is not from 0 to 90 degrees"),
        (0.3, {"wavelength": NM - 500}, "`wavelength` at 0 nm: 0 is not above zero"),
        (0.3, {"wavelength": NM.clip(600)}, "`wavelength` at 600 nm: 600 comes twice at one angle"),
        (95.0, ANGLES, "`values` at 500 nm: 95 is not from 0 to 90"),
        (45.0, {"signal": "psi-delta", "delta": NM}, "`delta` at 500 nm: 500 is not from -180 to 360"),
        (45.0, ANGLES | {"depolarisation": np.full(3, 2.3)}, "`depolarisation` at 500 nm: 2.3 is not from"),
        (30.0, {"path": "a.csv", "name": "Rp"}, "a.csv [Rp]: `values` at 500 nm: 30 is"),
        (30.0, {"path": "a.csv", "lines": np.arange(3)}, "a.csv: line 0, `values` at 500 nm: 30 is"),
    ],
)
def test_impossible_values(values, changes, message):
    arguments = {"wavelength": NM, "values": np.full(3, values), "signal": "R"} | changes
    with pytest.raises(DataError) as caught:
        pl.Spectrum(**arguments)
    assert str(caught.value).startswith(message) or message in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"signal": "Rs"}, "`signal` must be one of R, T, .*, not 'Rs'"),
        ({"polarisation": "x"}, "`polarisation` must be one of s, p, unpolarised, not 'x'"),
        ({"signal": "psi-delta"}, "`delta` goes with `signal"),
        ({"delta": NM}, "`delta` goes with `signal"),
        ({"depolarisation": NM / 1e4}, "`depolarisation` goes with `signal"),
        (ANGLES | {"depolarisation_sigma": NM}, "`depolarisation_sigma` goes with `depolarisation`"),
    ],
)
def test_unknown_words(changes, message):
    with pytest.raises(UsageError, match=message):
        pl.Spectrum(**({"wavelength": NM, "values": np.full(3, 0.3), "signal": "R"} | changes))


def test_any_scale_if_it_is_not_calibrated():
    assert pl.Spectrum(NM, np.full(3, 900.0), "R", calibrated=False).values[0] == 900
    assert pl.Spectrum(NM, np.full(3, 900.0), "counts").values[0] == 900
    noisy = pl.Spectrum(NM, np.full(3, -0.2), "R", sigma=np.full(3, 0.1))
    assert noisy.values[0] == -0.2


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"theta_i": np.array([30.0, 91.0])}, "sample 1: theta_i: 91 degrees is below the horizon"),
        ({"values": np.full((2, 1), -0.1)}, "sample 0: value: -0.1 is a BRDF below zero"),
        ({"values": np.full((2, 1), np.inf)}, "sample 0: value: inf is not finite"),
        ({"phi_o": np.full(2, np.nan)}, "sample 0: phi_o: nan is not finite"),
        ({"sigma": np.zeros((2, 1))}, "sample 0: the standard deviation of value: 0 is not above zero"),
    ],
)
def test_impossible_samples(changes, message):
    angles = dict.fromkeys(("theta_i", "phi_i", "theta_o", "phi_o"), np.full(2, 30.0))
    with pytest.raises(DataError, match=message):
        pl.BrdfSamples(**(angles | {"values": np.ones((2, 1)), "channels": ("value",)} | changes))
