"""Tables of cameras and lamps: read in any unit and order, refused in one sentence where damaged."""

import numpy as np
import pytest

from pellicle.data.cameras import read_lamp, read_sensitivities
from pellicle.errors import DataError
from tests.data.tables import rows

NM = [500.0, 600.0, 700.0]
BANDS = np.array([[0.1, 0.8, 0.4], [0.9, 0.3, 0.0], [0.2, 0.0, 0.05]])


@pytest.mark.parametrize(
    "text",
    [
        "wavelength_nm,R,G,B\n" + rows(NM, *BANDS.T),
        "# a camera\nB;wavelength_um;G;R\n"
        + rows(BANDS[:, 2], np.divide(NM, 1000), *BANDS.T[[1, 0]], mark=";"),
        "wavelength,red,green,blue\n" + rows(NM[::-1], *BANDS[::-1].T),
        "lambda,L,M,S\n" + rows(NM, *BANDS.T),
        rows(NM, *BANDS.T),
    ],
)
def test_sensitivities_of_any_layout(write, text):
    nm, seen = read_sensitivities(write(text))
    np.testing.assert_allclose(nm, NM)
    np.testing.assert_allclose(seen, BANDS)


def test_a_lamp_in_energies_rises_in_wavelength(write):
    nm, power = read_lamp(write("energy_eV,power\n2.0,3.0\n2.5,1.0\n"))
    np.testing.assert_allclose(nm, [1239.841984 / 2.5, 1239.841984 / 2], rtol=1e-9)
    assert power.tolist() == [1.0, 3.0]


@pytest.mark.parametrize(
    ("read", "text", "reasons"),
    [
        (read_sensitivities, "wavelength_nm,R,G\n500,1,2\n600,1,2\n", ("2 columns beside",)),
        (read_sensitivities, "angle,R,G,B\n5,1,2,3\n6,1,2,3\n", ("0 wavelength columns",)),
        (read_sensitivities, "wavelength_nm,R,G,B\n500,1,2,3\n600,1,,3\n", ("line 3", "empty")),
        (read_sensitivities, "wavelength_nm,R,G,B\n500,1,2,3\n600,1,-2,3\n", ("line 3", "below zero")),
        (read_sensitivities, "wavelength_nm,R,G,B\n500,1,0,3\n600,1,0,3\n", ("'G' is nowhere above zero",)),
        (read_lamp, "wavelength_nm,power\n500,1\n500,2\n600,1\n", ("repeats",)),
        (read_lamp, "wavelength_nm,power\n500,1\n", ("two or more wavelengths",)),
        (read_lamp, "wavelength_nm,a lamp,another\n500,1,2\n600,1,2\n", ("one lamp",)),
        (read_lamp, "wavelength,power\n0.5,1\n0.6,1\n", ("unlike nm; name the unit", "wavelength_um")),
        (read_lamp, "", ("is empty",)),
        (read_lamp, "\x89PNG\r\n", ("without any row",)),
    ],
)
def test_damage_is_refused(write, refusal, read, text, reasons):
    refusal(read, write(text), DataError, *reasons)
