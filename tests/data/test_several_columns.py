"""What Mueller elements and generalised ratios have in common, as columns beside others."""

import numpy as np
import pytest

from pellicle.data.read_spectrum import read_spectra, read_spectrum
from pellicle.errors import DataError, UsageError

NM = np.linspace(400.0, 800.0, 6)
ELEMENTS = np.linspace(-0.9, 0.8, 6), np.linspace(0.3, -0.4, 6)
RATIOS = np.linspace(20, 30, 6), np.linspace(80, 120, 6), np.linspace(0, 2, 6), np.linspace(200, 350, 6)
SIGNALS = {
    "mueller": ("m12,m33", ELEMENTS, "m33", ("m33",)),
    "generalised-psi-delta": ("psi_ane,delta_ane,psi_aps,delta_aps", RATIOS, "aps", ("aps",)),
}
"""Names and columns, one of the parts, and how a spectrum names it."""


@pytest.fixture(params=SIGNALS)
def signal(request):
    return request.param


@pytest.fixture
def file(write_columns, signal):
    """Write these columns with others, and return the path."""
    names, columns, *_ = SIGNALS[signal]
    return lambda more="", *others: write_columns(f"nm,{names}{more}", NM, *columns, *others)


def test_psi_and_delta_come_first(file, signal):
    path = file(",psi_deg,delta_deg", 45.0, np.linspace(100, 170, 6))
    assert read_spectrum(path).signal == "psi-delta"
    assert read_spectrum(path, signal=signal).signal == signal
    part, parts = SIGNALS[signal][2:]
    one = read_spectrum(path, elements=[part])
    assert (one.elements or one.ratios) == parts


def test_a_reflectance_beside_them_is_of_the_same_film(file, signal):
    path = file(",R", 0.3)
    with pytest.raises(UsageError, match="as well as R; choose one with `signal`"):
        read_spectrum(path)
    assert [one.signal for one in read_spectra(path)] == [signal, "R"]
    assert read_spectrum(path, signal="R").signal == "R"
    with pytest.raises(UsageError, match='contradicts `signal="R"`'):
        read_spectrum(file(), signal="R")


def test_one_standard_deviation_is_that_of_every_column(file, signal):
    both = read_spectrum(file(",sigma", 0.01))
    assert both.sigma.shape == (6, 2)
    assert np.all(both.sigma == 0.01)
    assert np.all(read_spectrum(file(",sigma", 0.01), noise=0.002).sigma == 0.002)
    first = SIGNALS[signal][0].split(",")[0]
    with pytest.raises(DataError, match=r"of some of the (columns|elements) only"):
        read_spectrum(file(f",sigma_{first}", 0.01))
    with pytest.raises(DataError, match="is a standard deviation not above zero"):
        read_spectrum(file(",sigma", 0.0))
