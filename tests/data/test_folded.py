"""Δ without its sign: folded angles, and α and β of a rotating analyser."""

import numpy as np
import pytest

from pellicle.data.read_spectrum import read_spectrum
from pellicle.errors import DataError, UsageError
from pellicle.optics.ellipsometry import alpha_beta
from tests.data.tables import assert_read

NM = np.array([400.0, 500.0, 600.0])
PSI = np.array([20.0, 45.0, 80.0])
DELTA = np.array([170.0, 90.0, 5.0])
ANALYSER = np.array([45.0, 30.0, 60.0])


def seen(analyser):
    """α and β by the forward formula, from N and C."""
    psi, delta = 2 * np.deg2rad(PSI), np.deg2rad(DELTA)
    return map(np.asarray, alpha_beta(np.cos(psi), np.sin(psi) * np.cos(delta), analyser))


@pytest.mark.parametrize("header", ["wl,alpha,beta,analyser", "nm,α,β,Analyzer (deg)"])
def test_alpha_and_beta_with_their_analyser(write_columns, header):
    spectrum = read_spectrum(write_columns(header, NM, *seen(ANALYSER), ANALYSER))
    assert_read(spectrum, signal="psi-delta", folded=True, sigma=None, values=PSI, delta=DELTA)


def test_one_analyser_for_all(write_columns):
    path = write_columns("wl,aoi,alpha,beta", NM, np.full(3, 70.0), *seen(30.0))
    assert_read(read_spectrum(path, analyser=30.0), values=PSI, delta=DELTA, angle=[70.0] * 3)


def test_noise_may_take_the_contrast_above_one(write_columns):
    """At Δ = 180 it does so every other time; α, and with it Ψ, is kept."""
    path = write_columns("wl,alpha,beta", NM, [0.6, 0.6, 1.0], [-0.81, -0.8, -0.01])
    spectrum = read_spectrum(path, analyser=45)
    np.testing.assert_allclose(spectrum.values, np.rad2deg(np.arctan([2.0, 2.0, np.inf])), rtol=1e-12)
    np.testing.assert_allclose(spectrum.delta, 180.0, atol=1e-5)
    assert any("at 2 points whose contrast is above 1" in note for note in spectrum.notes)


def test_a_folded_delta(write_columns):
    path = write_columns("wl,psi,delta", NM, PSI, DELTA)
    assert not read_spectrum(path).folded
    spectrum = read_spectrum(path, folded=True)
    assert_read(spectrum, folded=True, delta=DELTA)
    assert "delta is known in 0 to 180 only: cos(delta) is fitted" in spectrum.notes


@pytest.mark.parametrize(
    ("header", "columns", "words", "error", "said"),
    [
        ("wl,alpha,beta", (0.1, 0.2), {}, UsageError, "`analyser=45`"),
        ("wl,alpha,beta,analyser", (0.1, 0.2, 45), {"analyser": 45}, UsageError, "leave `analyser` out"),
        ("wl,alpha,beta", (0.1, 0.2), {"analyser": 90}, UsageError, "between 0 and 90 degrees, got 90"),
        ("wl,alpha,beta,analyser", (0.1, 0.2, 0), {}, DataError, "line 2, column 'analyser': 0 is not"),
        ("wl,alpha,beta", (0.9, 0.9), {"analyser": 45}, DataError, "contrast of 1.27"),
        ("wl,alpha", (0.1,), {"signal": "psi-delta", "analyser": 45}, DataError, "are not all among"),
        ("wl,psi,delta", (45, 200), {"folded": True}, DataError, "0 to 180 degrees, as a folded delta is"),
        ("wl,psi,delta", (45, 90), {"analyser": 45}, UsageError, "goes with columns alpha and beta"),
        ("wl,N,C,S", (0, 0, 1), {"folded": True}, UsageError, "contain the sign of delta"),
        ("wl,R", (0.5,), {"folded": True}, UsageError, "`folded` is for ellipsometry"),
        ("wl,R", (0.5,), {"analyser": 45}, UsageError, "`analyser` is for ellipsometry"),
    ],
)
def test_what_makes_no_sense(write_columns, header, columns, words, error, said):
    path = write_columns(header, [500.0, 600.0], *([value, value] for value in columns))
    with pytest.raises(error, match=said) as caught:
        read_spectrum(path, **words)
    assert "\n" not in str(caught.value)
