"""Any spectrum, in any way of writing that the contract allows, comes back; damaged files are refused."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pellicle.data.read_spectrum import read_spectrum
from pellicle.data.tabular.columns import recognise
from pellicle.data.tabular.units import WAVELENGTH_UNITS, to_nm
from pellicle.errors import DataError, UsageError
from tests.data.tables import assert_read

NAMES = {
    "nm": "wavelength (nm)",
    "THz": "frequency (THz)",
    "um": "Wavelength_um",
    "A": "lambda [Å]",
    "eV": "energy",
    "cm-1": "wavenumber",
}


@st.composite
def spectra(draw):
    wavelength = draw(
        st.lists(st.floats(150, 3000), min_size=2, max_size=20, unique_by=lambda w: round(w, 3)).map(sorted)
    )
    fraction = st.floats(-0.009, 1.4)
    values = draw(st.lists(fraction, min_size=len(wavelength), max_size=len(wavelength)))
    return np.array(wavelength), np.array(values)


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return tmp_path_factory.mktemp("spectra") / "film.csv"


@settings(max_examples=50)
@given(
    spectrum=spectra(),
    separator=st.sampled_from([",", ";", "\t", " ", "  ", ", "]),
    unit=st.sampled_from(WAVELENGTH_UNITS),
    percent=st.booleans(),
    falling=st.booleans(),
    header=st.booleans(),
    comma=st.booleans(),
    newline=st.sampled_from(["\n", "\r\n"]),
)
def test_round_trip(path, spectrum, separator, unit, percent, falling, header, comma, newline):
    wavelength, values = spectrum
    # each conversion but Å and µm undoes itself; those two undo each other
    axis = {"um": wavelength / 1e3, "A": wavelength * 10}.get(unit)
    axis = to_nm(wavelength, unit) if axis is None else axis
    rows = [
        f"{a!r}{separator}{v * (100 if percent else 1)!r}"
        for a, v in zip(axis.tolist(), values.tolist(), strict=True)
    ]
    if comma and "," not in separator:
        rows = [row.replace(".", ",") for row in rows]
    if falling:
        rows.reverse()
    names = [f"{NAMES[unit]}{separator}{'R (%)' if percent else 'R'}"] if header else []
    path.write_text(newline.join(names + rows) + newline, newline="")
    flags = {} if header else {"wavelength_unit": unit, "signal_unit": "percent" if percent else "fraction"}
    read = read_spectrum(path, signal="R", **flags)
    assert_read(read, wavelength=wavelength, values=values)
    first = 1 + len(names)
    expected = np.arange(first, first + len(rows))
    np.testing.assert_array_equal(read.lines, expected[::-1] if falling else expected)


@settings(max_examples=50)
@given(
    content=st.one_of(
        st.binary(max_size=80), st.text('0123456789.,;\t \n-+eER#>%"()nmTaf', max_size=80).map(str.encode)
    )
)
def test_any_file_is_read_or_refused_in_one_sentence(path, content):
    path.write_bytes(content)
    for signal in (None, "R"):
        try:
            spectrum = read_spectrum(path, signal=signal)
        except (DataError, UsageError) as error:
            message = str(error)
        else:
            message = f"{path} reads"
            assert np.isfinite(spectrum.values).all()
            assert (spectrum.wavelength > 0).all()
        assert message.startswith(str(path))
        assert "\n" not in message


#: What a column can hold, as the tables of README and the file formats name it.
ROLES = {
    *("wavelength", "R", "T", "intensity", "counts", "sigma", "angle", "azimuth", "contrast"),
    *(
        f"{of}_{ratio}"
        for of in ("psi", "delta", "sigma_psi", "sigma_delta")
        for ratio in ("ane", "aps", "asp")
    ),
    *(f"{of}m{row}{column}" for of in ("", "sigma_") for row in range(1, 5) for column in range(1, 5)),
    *("psi", "delta", "sigma_psi", "sigma_delta", "N", "C", "S", "alpha", "beta", "analyser"),
    *("depolarisation", "sigma_depolarisation", "tan_psi", "cos_delta"),
    *("processed", "sample counts", "reference counts", "dark counts", "foreign"),
    *("theta_i", "phi_i", "theta_o", "phi_o", "value", "G", "B", "sigma_R", "sigma_G", "sigma_B"),
    "other",
}


@settings(max_examples=50)
@given(name=st.text(max_size=30))
def test_any_name_is_a_column_or_other(name):
    column = recognise(name)
    assert column.name == name
    assert column.role in ROLES


@pytest.fixture(scope="module")
def fuzz(load_script):
    return load_script("benchmarks/fuzz_readers.py")


@pytest.mark.slow
def test_every_file_is_read_or_refused_in_one_sentence(fuzz, tmp_path):
    outcomes, failures = fuzz.run(150, tmp_path)
    assert not failures
    assert outcomes["inputs"] == 150
    assert outcomes["read_spectra: read"] > 0  # one in 25: most damaged files are refused


def test_a_reader_that_fails_is_found(fuzz, tmp_path, monkeypatch):
    monkeypatch.setattr(fuzz, "readers", lambda path, words: {"broken": lambda: {}["absent"]})
    outcomes, failures = fuzz.run(3, tmp_path)
    assert outcomes["broken: failed"] == 3
    assert "KeyError" in failures[0]
