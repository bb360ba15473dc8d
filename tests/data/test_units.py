"""Units of files."""

import numpy as np
import pytest

from pellicle.data.tabular.units import HC_EV_NM, to_nm, wavelength_unit


def test_product_of_the_constants():
    # CODATA 2018: hc = 1.239841984... eV µm, exact
    assert pytest.approx(1239.8419843320026, rel=1e-15) == HC_EV_NM


@pytest.mark.parametrize("unit", ["nm", "um", "A", "eV", "cm-1"])
def test_one_wavelength_in_every_unit(unit):
    value = {"nm": 500.0, "um": 0.5, "A": 5000.0, "eV": HC_EV_NM / 500, "cm-1": 20000.0}[unit]
    assert to_nm(np.array([value]), unit)[0] == pytest.approx(500, rel=1e-15)


def test_an_unknown_unit_is_none_as_text_and_an_error_as_a_unit():
    assert wavelength_unit("furlong") is None
    with pytest.raises(ValueError, match="expected one of nm, um, A, eV, cm-1, THz, got 'furlong'"):
        to_nm(np.ones(1), "furlong")
