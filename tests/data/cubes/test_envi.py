"""ENVI headers as cameras and remote sensing write them, and their files of numbers."""

import numpy as np
import pytest

from pellicle.data.read_cube import read_cube
from pellicle.errors import DataError, UsageError

NM = np.linspace(400.0, 800.0, 9)
HEADER = """ENVI
description = {{
  pushbroom camera, exposure = 5 ms}}
samples = 5
lines   = 7
bands   = 9
header offset = {offset}
file type = ENVI Standard
data type = {code}
interleave = {interleave}
sensor type = Unknown
byte order = {order}
default bands = {{3, 2, 1}}
{more}wavelength units = Nanometers
wavelength = {{
 400.0, 450.0, 500.0,
 550.0, 600.0, 650.0,
 700.0, 750.0, 800.0}}
"""


@pytest.fixture
def envi(tmp_path, values):
    """Write a header and a file of numbers; returns the header."""

    def write(interleave="bip", code=4, kind="f4", more="", scale=1.0, suffix=".dat", header="cube.hdr"):
        order = {"bsq": (2, 0, 1), "bil": (0, 2, 1), "bip": (0, 1, 2)}[interleave]
        content = values.transpose(order) * scale
        content = (content if kind[0] == "f" else np.round(content)).astype(f"<{kind}")
        (tmp_path / f"cube{suffix}").write_bytes(content.tobytes())
        path = tmp_path / header
        path.write_text(HEADER.format(offset=0, code=code, interleave=interleave, order=0, more=more))
        return path

    return write


@pytest.mark.parametrize(
    ("code", "kind"),
    [(1, "u1"), (2, "i2"), (3, "i4"), (5, "f8"), (12, "u2"), (13, "u4"), (14, "i8"), (15, "u8")],
)
def test_data_types(envi, values, code, kind):
    scale = 200.0 if kind == "u1" else 10000.0
    header = envi("bil", code, kind, scale=scale, more=f"reflectance scale factor = {scale}\n")
    cube = read_cube(header)
    assert cube.signal == "R"
    np.testing.assert_allclose(np.asarray(cube.arrays["values"]), values, atol=0.51 / scale)


@pytest.mark.parametrize("suffix", ["", ".img", ".raw", ".bsq", ".HYSPEX"])
def test_data_file_beside_the_header(envi, same, suffix):
    same(envi("bsq", suffix=suffix))


def test_header_named_after_the_whole_file(envi, same, tmp_path):
    same(envi("bsq", suffix=".img", header="cube.img.hdr"))
    same(tmp_path / "cube.img")


def test_bad_bands_and_missing_values(envi, values):
    missing = float(values[3, 2, 4])
    more = "bbl = {1, 1, 0, 1, 1, 1, 1, 1, 0}\nfwhm = {5, 5, 5, 5, 5, 5, 5, 5, 5}\n"
    more += f"data ignore value = {missing!r}\n"
    cube = read_cube(envi(more=more))
    good = [0, 1, 3, 4, 5, 6, 7]
    np.testing.assert_array_equal(cube.wavelength, NM[good])
    read = np.asarray(cube.arrays["values"])
    assert np.isnan(read[3, 2, 3])
    assert np.isnan(read).sum() == 1
    np.testing.assert_allclose(read[6], values[6][:, good])
    assert any("5 nm wide" in note for note in cube.notes)
    assert any("2 bands left out" in note for note in cube.notes)


def test_micrometres_and_no_unit(envi, same, refused):
    header = envi()
    text = header.read_text()
    small = text.replace("Nanometers", "Micrometers")
    for nm in NM:
        small = small.replace(f"{nm:.1f}", f"{nm / 1000:.5f}")
    header.write_text(small)
    same(header)
    wide = small.rstrip() + "\nfwhm = {0.005, 0.005, 0.005, 0.005, 0.005, 0.005, 0.005, 0.005, 0.005}\n"
    header.write_text(wide)
    assert any("5 nm wide" in note for note in same(header).notes)
    header.write_text(small.replace("Micrometers", "Unknown"))
    refused(header, "0.4 to 0.8", "µm", "`wavelength_unit`")
    same(header, wavelength_unit="um")


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("bands   = 9", "bands   = 8", ("9 wavelengths for 8 bands",)),
        ("lines   = 7", "lines   = 70", ("incomplete", "1,260 bytes")),
        ("lines   = 7\n", "", ("`lines`", "'missing'")),
        ("data type = 4", "data type = 7", ("`data type` is 7",)),
        ("data type = 4", "data type = four", ("`data type` is 'four'",)),
        ("interleave = bip", "interleave = bqs", ("'bqs'",)),
        ("ENVI Standard", "ENVI Spectral Library", ("spectral library",)),
        ("sensor type", "file compression = 1\nsensor type", ("compressed",)),
        ("sensor type", "bbl = {1, 0}\nsensor type", ("`bbl` has 2 numbers for 9 bands",)),
        ("400.0,", "fourhundred,", ("`wavelength` is no list of numbers",)),
    ],
)
def test_damaged_headers(envi, refused, old, new, words):
    header = envi()
    text = header.read_text()
    assert old in text
    header.write_text(text.replace(old, new))
    refused(header, str(header.parent), *words, error=DataError)


def test_without_wavelengths_or_data(envi, refused, same):
    header = envi()
    header.write_text(header.read_text().split("wavelength units")[0])
    refused(header, "no wavelengths", "`wavelengths", error=UsageError)
    same(header, wavelengths="400:800:50")
    refused(header, "9 bands", error=DataError, wavelengths="400:750:50")
    header.with_suffix(".dat").unlink()
    refused(header, "not beside it", "cube.img", error=DataError)
