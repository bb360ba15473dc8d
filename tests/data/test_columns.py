"""What a column's name says."""

import pytest

from pellicle.data.tabular.columns import is_header, recognise

ROLES = {
    ("wavelength", "nm"): ("wavelength (nm)", "wavelength_nm", "lambda / nm", "λ (nm)", "nm"),
    ("wavelength", "um"): ("Wavelength [um]", "Wavelength [µm]"),
    ("wavelength", "A"): ("Wavelength (Å)",),
    ("wavelength", None): ("WAVELENGTH", "lambda", "wl"),
    ("wavelength", "eV"): ("energy", "energy (eV)", "photon energy (eV)"),
    ("wavelength", "cm-1"): ("wavenumber (1/cm)", "wavenumber_cm-1", "Wavenumber [cm⁻¹]"),
    ("R", None): ("R", "r"),
    ("R", "percent"): ("R (%)", "%R", "R%", "% Reflectance", "R_percent", "Reflectance (%)"),
    ("R", "fraction"): ("R_fraction", "Reflectance [-]"),
    ("T", None): ("T", "T (Abs)"),
    ("T", "percent"): ("%T", "Transmittance / %"),
    ("intensity", None): ("intensity", "Intensity (a.u.)"),
    ("sigma", None): ("sigma",),
    ("sigma", "percent"): ("sigma (%)",),
    ("angle", "deg"): ("angle_deg", "angle", "AOI (°)", "aoi_deg"),
    ("psi", "deg"): ("psi_deg",),
    ("delta", None): ("delta",),
    ("other", None): ("R_sigma_as_stated", "Rubbish", "temperature", ""),
    ("T", "absorbance"): ("A", "Abs", "Absorbance (AU)"),
    ("R", "absorbance"): ("log(1/R)",),
    ("wavelength", "THz"): ("frequency (THz)",),
}
"""Names of columns by the role and the unit that they state."""


@pytest.mark.parametrize(("role", "unit"), ROLES)
def test_role_and_unit_of_a_name(role, unit):
    for name in ROLES[role, unit]:
        column = recognise(name)
        assert (column.role, column.unit) == (role, unit), name


@pytest.mark.parametrize("name", ["Rs", "Rp (%)", "T_s", "tp", "R", "Reflectance_s"])
def test_polarisation_of_a_name(name):
    column, letters = recognise(name), name.removesuffix(" (%)")
    polarisation = letters[-1] if len(letters) > 1 else None
    assert (column.role, column.polarisation) == (name[0].upper(), polarisation)


def test_a_unit_in_brackets_that_is_not_known_is_kept_for_the_message():
    assert recognise("wavelength (pm)").unknown_unit == "pm"
    assert recognise("R (dB)").unknown_unit == "db"


@pytest.mark.parametrize("names", [["Integration time", "1 ms"], ["energy", "range"], ["380", "0.4"], []])
def test_free_text_is_no_header(names):
    assert not is_header(names)
