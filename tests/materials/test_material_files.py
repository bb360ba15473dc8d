"""One material in every format of material files, whole and damaged."""

import re
from pathlib import Path

import mpmath
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from pellicle.errors import DataError
from pellicle.materials import material
from pellicle.materials.formats.detect import read_material_file
from pellicle.materials.formats.optical_constants import nk_from_dielectric
from pellicle.optics.pair import imag, is_real, real
from pellicle.recipes.media import medium as recipe_medium
from pellicle.scene.layers import Layer

# n + ik = 1.5 + 0.1i at 400 nm and 1.4 + 0.05i at 600 nm: ε = n² − k² + 2nki, E = 1239.8419844 eV nm / λ
SAMPLES = sorted(Path(__file__).with_name("samples").iterdir())
FORMATS = {path.stem: (path.suffix, path.read_bytes().decode("utf-8")) for path in SAMPLES}
UNIT = {"WVASE nm": "nm", "WVASE eV": "eV", "WVASE Angstroms": "Angstroms", "SpectraRay nm": "Wavelength,nm"}
UNIT |= {"refellips": "µm", "Filmetrics": "nm", "table of eps": "eV"}
"""The unit that a format states, which the test of a wrong one replaces."""


@pytest.fixture
def write(tmp_path):
    def written(text, suffix=".csv", encoding="utf-8"):
        path = tmp_path / f"resin{suffix}"
        path.write_bytes(text if isinstance(text, bytes) else text.encode(encoding))
        return str(path)

    return written


def refused(path):
    with pytest.raises(DataError, match="resin") as caught:
        read_material_file(path)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def check(path, name=""):
    source = material(path)
    low, high = source.wavelength_range
    assert (low, high) == pytest.approx((400, 600), abs=1e-6)
    value = source.index(np.array([low, high]))
    np.testing.assert_allclose(real(value), [1.5, 1.4], rtol=1e-8, err_msg=name)
    # the text of refractiveindex.info has k at other wavelengths: (0.125, 0.05) at 350 and 600 nm
    k = 0.11 if name == "refractiveindex.info text" else 0.1
    np.testing.assert_allclose(imag(value), [k, 0.05], rtol=1e-8, err_msg=name)
    return source


@pytest.mark.parametrize("name", FORMATS)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
@pytest.mark.parametrize("ending", ["\n", "\r\n"])
def test_every_format_in_every_encoding(write, name, encoding, ending):
    suffix, text = FORMATS[name]
    check(write(text.replace("\n", ending), suffix, encoding), name)


@pytest.mark.parametrize("name", [name for name in FORMATS if "eps" not in name])
def test_latin_1(write, name):
    suffix, text = FORMATS[name]
    check(write(text, suffix, "latin-1"), name)


@pytest.mark.parametrize(
    "name", [n for n, (_, text) in FORMATS.items() if "csv" not in _ and "YAML" not in n] + ["table of eps"]
)
def test_decimal_commas(write, name):
    suffix, text = FORMATS[name]
    number = re.compile(r"[\d ]")
    rows = [row.replace(".", ",") if number.match(row) else row for row in text.split("\n")]
    check(write("\n".join(rows), suffix), name)


@pytest.mark.parametrize("name", FORMATS)
def test_a_file_cut_off_within_its_last_row_is_refused(write, name):
    suffix, text = FORMATS[name]
    last = max(text.rfind(cell) for cell in ("0.05", "1.4", "1.9575"))
    refused(write(text[:last], suffix))


@pytest.mark.parametrize("name", FORMATS)
def test_a_file_without_rows_is_refused(write, name):
    suffix, text = FORMATS[name]
    row = re.compile(r"\s*\d|DATA1")
    head = [line for line in text.split("\n") if not row.match(line)]
    refused(write("\n".join(head), suffix))


@pytest.mark.parametrize("name", UNIT)
def test_an_unknown_unit_is_refused(write, name):
    suffix, text = FORMATS[name]
    message = refused(write(text.replace(UNIT[name], "furlong"), suffix))
    assert "unit" in message


LARGEST_K = dict.fromkeys(("SpectraRay nm", "WVASE eV", "table of eps", "commented names"), "0.3")
LARGEST_K["refractiveindex.info text"] = "0.125"


@pytest.mark.parametrize("name", [n for n in FORMATS if "YAML" not in n])  # the database drops such rows
def test_absorption_of_the_other_sign_is_refused(write, name):
    suffix, text = FORMATS[name]
    wrong = re.sub(rf"(?<![\d.]){LARGEST_K.get(name, '0.1')}(?!\d)", lambda k: "-" + k[0], text)
    assert "turn its sign" in refused(write(wrong, suffix))


def test_what_a_file_says_of_itself_is_kept(write):
    page = material(write(FORMATS["refractiveindex.info YAML"][1], ".yml"))
    assert page.citation == "A. Éditor. Resins. (1999)"
    assert "refractiveindex.info page" in page.note
    assert "a resin" in page.note
    mat = material(write(FORMATS["WVASE eV"][1], ".mat"))
    assert mat.note.endswith("material file; energy in eV, eps1, eps2; 3 rows; Resin made by me")
    assert mat.warnings() == []


def test_a_page_without_k_and_a_formula(write):
    text = "DATA:\n  - type: formula 5\n    wavelength_range: 0.4 0.7\n    coefficients: 1.4 0.01 -2\n"
    source = material(write(text, ".yaml"))
    assert source(500.0) == pytest.approx(1.4 + 0.01 * 0.5**-2)
    assert "no data for k" in source.warnings()[0]


def test_a_download_of_n_alone_is_in_micrometres_and_a_table_of_ones_own_in_nm(write):
    download = material(write("wl,n\n0.4,1.5\n0.6,1.4\n"))
    assert download.wavelength_range == (400, 600)
    assert download.warnings() == [w for w in download.warnings() if "no data for k" in w]
    own = material(write("wl,n\n400,1.5\n600,1.4\n"))
    assert own.wavelength_range == (400, 600)
    assert "read as nm" in own.warnings()[0]


def test_a_column_k_without_cells_is_none(write):
    source = material(write('"Wavelength, µm","n","k"\n0.4,1.5\n0.6,1.4\n'))
    assert not source.has_extinction
    assert source.wavelength_range == (400, 600)
    source = material(write("Resin\nnm\nN\n400 1.5\n600 1.4\n", ".mat"))
    assert is_real(source.index(500.0))


@pytest.mark.parametrize("text", ["400 1.5 0.1\n600 1.4 0.05\n", "wl,n,k\n400,1.5,0.1\n600,1.4,0.05\n"])
def test_nm_that_no_unit_states_is_said_with_every_result(write, text):
    assert "read as nm" in check(write(text)).warnings()[0]


REFUSED = [
    (".txt", "4.96\t-11.96\t10.93\n4.77\t-12.85\t13.04\n", "energy_eV,eps1,eps2"),
    (".csv", "Wavelength,n,k\n0.4,1.5\n0.6,1.4\n", "wavelength_um,n,k"),
    (".nk", "4000 1.5 0.1\n6000 1.4 0.05\n", "Å as in files of IMD"),
    (".nk", "1 0.6 6.6 120\n1.0 14\n0.9 13\n", "announces 120 intervals"),
    (".csv", "wavelength_nm,n\n400,1.5\n1e300,1.4\n", "line 3, column 'wavelength_nm'"),
    (".csv", "wavelength_nm,n\n400,1.5\n600,1e99\n", "line 3, column 'n'"),
    (".nk", "1 0.6 inf 1\n1.0 14\n0.9 13\n", "no finite range"),
    (".csv", "wavelength_nm,n,k\n400,1.5,0.1\n600,1.4,0.05\n\nmeasured by me\n", "line 5 is no row"),
    (".txt", "Resin\nmic,NK\n0.[a &a 6 1.4 0.05eV\n", "header right above the rows"),
    (".mat", "400 1.5 0.1\n600 1.4 0.05\n", "unit of its first column"),
    (".mat", "Resin\nnm\n2\n400 1.5 0.1\n600 1.4 0.05\n", "NK or E1E2"),
    (".mat", "Resin\nnm\nNK\n400 x 0.1\n600 1.4 0.05\n", "line 4, column 'n'"),
    (".mat", "Resin\nnm\nNK\n3\n400 1.5 0.1\n600 1.4 0.05\n", "announces 3 rows but has 2"),
    (".mat", "Resin\nnm\nE1E2\n400 2.2\n600 2.1\n", "eps2"),
    (".mat", "Resin\nnm\nE1E2\n400 -2 0\n600 -3 0\n", "an index n above 0"),
    (".mat", "Resin\neV\nNK\n0 1.5 0.1\n2 1.4 0.05\n", "above 0"),
    (".mat", "Resin\neV\nNK\n1e-320 1.5 0.1\n2 1.4 0.05\n", "wavelength of light"),
    (".mat", b"MATLAB 5.0 MAT-file, Platform: GLNXA64" + b"\x00" * 90, "MATLAB file"),
    (".MAT", "POINTS*3*$\nDATA1*1*4e2*1.5*0.1*$\nDATA1*2*6e2*1.4*0.05*$\n", "announces 3 rows"),
    (".mat", "Begin of array\n400 2.24 0.3\n600 1.9 0.1\nEnd of array\n", "Units="),
    (".mat", "Units=Frequency\nBegin of array\n400 2.24 0.3\n600 1.9 0.1\nEnd of array\n", "unknown unit"),
    (".csv", "wl,n\n400,1.5\n600,1.4\nwl,k\n400,0.1\n600,0.05\n", "in µm, but begins at 400"),
    (".csv", "wl,n\n0.4,1.5\n0.6,1.4\nwl,k\n0.7,0.1\n0.8,0.05\n", "do not overlap"),
    (".yml", "DATA:\n  - type: tabulated k\n    data: |\n        0.4 0.1\n        0.6 0.2\n", "k without n"),
    (
        ".yml",
        "DATA:\n  - type: tabulated nk\n    data: |\n        0.4 1.5 nan\n        0.6 1.4 0\n",
        "finite",
    ),
    (".yml", "DATA: [", "not YAML"),
    (".yml", "DATA: " + "[" * 100_000, "page"),
    (".csv", "", "empty"),
    (".csv", "wavelength_nm,n,k\n", "numbers"),
    (".csv", "wavelength_nm,n,k\n400,1.5,0.1\n500,abc,0.1\n600,1.4,0.1\n", ("line 3", "'abc'")),
    (".csv", "wavelength_nm,n,k\n400,1.5,0.1\n500,1.4,-0.1\n", ("line 3", "turn its sign")),
    (".csv", "wavelength_nm,n,k\n400,1.5,0.1\n500,0,0.1\n", ("line 3", "above 0")),
    (".csv", "wavelength_nm,n,k\n400,1.5,0.1\n500,1.4,0.1\n500,1.3,0.1\n", ("line 4", "sort the rows")),
    (".csv", "wavelength_nm,n,k\n-400,1.5,0.1\n500,1.4,0.1\n", ("line 2", "above 0")),
    (".csv", "wavelength_nm,n,k\n400,1.5,0.1\n", "two rows"),
    (".csv", "wavelength_nm,eps,k\n400,1.5,0.1\n500,1.5,0.1\n", "column named n"),
    (".csv", "wavelength_nm,n,n\n400,1.5,0.1\n500,1.5,0.1\n", "two columns are named n"),
    (".csv", "wavelength,n\n0.4,1.5\n0.5,1.5\n", "wavelength_um"),
    (".csv", "400,1.5,0.1,3\n500,1.5,0.1,3\n", "2 or 3 columns"),
    (".csv", "my film of 1999\n\n400 1.5\n500 1.5\n", "header"),
    (".csv", b"\x00\x01\x02\x03", "binary"),
]


@pytest.mark.parametrize(("suffix", "text", "words"), REFUSED)
def test_what_is_missing_or_doubtful_is_one_sentence(write, suffix, text, words):
    message = refused(write(text, suffix))
    assert all(word in message for word in ((words,) if isinstance(words, str) else words)), message


def test_missing_files_and_folders(tmp_path):
    with pytest.raises(DataError, match="no such file"):
        material(str(tmp_path / "none.csv"))
    with pytest.raises(DataError, match="folder"):
        material(str(tmp_path))


def test_a_layer_and_a_recipe_take_a_file(write, tmp_path):
    path = Path(write(FORMATS["WVASE eV"][1], ".mat"))
    assert Layer(path, 100.0).material.wavelength_range == pytest.approx((400, 600), abs=1e-6)
    assert recipe_medium("resin.mat", folder=tmp_path).wavelength_range == pytest.approx((400, 600), abs=1e-6)


@pytest.mark.parametrize("eps1", [-1e4, -7.3, -1e-9, 0.0, 1e-9, 2.2, 180.0])
@pytest.mark.parametrize("eps2", [1e-300, 1e-18, 1e-9, 0.4, 75.0])
def test_the_root_of_a_dielectric_function_keeps_all_digits(eps1, eps2):
    n, k = nk_from_dielectric(np.array([eps1]), np.array([eps2]))
    with mpmath.workdps(50):
        root = mpmath.sqrt(mpmath.mpc(eps1, eps2))
    assert n[0] == pytest.approx(float(root.real), rel=4e-16)
    assert k[0] == pytest.approx(float(root.imag), rel=4e-16)


@given(st.data())
@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_damage_is_read_or_refused(tmp_path, data):
    suffix, text = data.draw(st.sampled_from(list(FORMATS.values())))
    content = bytearray(text.encode())
    for _ in range(data.draw(st.integers(1, 5))):
        at = data.draw(st.integers(0, len(content)))
        content[at : at + data.draw(st.integers(0, 6))] = data.draw(
            st.binary(max_size=4) | st.sampled_from([b"\n", b",", b"1e999", b"-", b"nan", b"[", b"#"])
        )
    path = tmp_path / f"resin{suffix}"
    path.write_bytes(content)
    message = ""
    try:
        found = read_material_file(path)
        assert np.isfinite(np.asarray(found.dispersion(np.array(found.wavelength_range)))).all()
    except DataError as error:
        message = str(error)
    assert "\n" not in message
