"""NeXus and NetCDF files, written here by h5py: NXdata, NXellipsometry, and files that lead elsewhere."""

import io
import sys

import numpy as np
import pytest

from pellicle.data.formats import isolated
from pellicle.data.formats import nexus as nexus_reader
from pellicle.data.read_spectrum import read_spectrum
from pellicle.errors import DataError
from tests.data.tables import assert_read

h5py = pytest.importorskip("h5py")

ENERGY = np.array([1.0, 2.0, 3.0])
R = np.array([0.1, 0.2, 0.4])
ANGSTROM = np.array([4000.0, 5000.0, 6000.0])
PSI = np.array([[20.0, 21.0, 22.0], [30.0, 31.0, 32.0]])
DELTA = np.array([[170.0, 171.0, 172.0], [160.0, 161.0, 162.0]])


@pytest.fixture(autouse=True)
def in_this_process(request, monkeypatch):
    """Read without a child process, whose start takes 0.25 s; tests/data/test_write_spectrum.py has it."""
    if "in_a_child" not in request.node.name:
        own = lambda reader, content: nexus_reader.read_hdf5(content)  # noqa: E731
        monkeypatch.setattr(isolated, "call", own)


def nexus(fill):
    """The bytes of an HDF5 file that `fill` writes into."""
    buffer = io.BytesIO()
    with h5py.File(buffer, "w") as file:
        fill(file)
    return buffer.getvalue()


def put(group, name, values, units=None):
    group[name] = values
    if units is not None:
        group[name].attrs["units"] = units


def group(parent, name, kind, **attributes):
    made = parent.create_group(name)
    made.attrs.update({"NX_class": kind, **attributes})
    return made


def nxdata(file, axis=("energy", "eV"), signal=("reflectance", ""), values=R):
    data = group(group(file, "entry", "NXentry"), "data", "NXdata", signal=signal[0], axes=[axis[0]])
    put(data, axis[0], ENERGY, axis[1])
    put(data, signal[0], values, signal[1])
    return data


def nxellipsometry(file, kind="Psi/Delta", observables=(PSI, DELTA), angles=(50.0, 60.5), errors=False):
    """The layout of FAIRmat's pynxtools-ellips: measured_data[angle, observable, wavelength]."""
    entry = group(file, "entry", "NXentry")
    entry["definition"] = "NXellipsometry"
    entry["start_time"] = "2022-01-27T03:35:00+00:00"
    put(group(entry, "instrument", "NXinstrument"), "angle_of_incidence", np.array(angles), "degree")
    group(entry, "sample", "NXsample")["sample_name"] = "2nm SiO2 on Si"
    data = group(entry, "data_collection", "NXdata", axes="wavelength")
    if kind:
        data["data_type"] = kind
    put(data, "wavelength_spectrum", ANGSTROM, "angstrom")
    data["wavelength"] = h5py.SoftLink("/entry/data_collection/wavelength_spectrum")
    data["measured_data"] = np.stack(observables, axis=1)
    if errors:
        data["measured_data_errors"] = np.full((2, 2, 3), 0.1)
    return data


SAMPLES = {fill.__name__: nexus(fill) for fill in (nxdata, nxellipsometry)}  # for `make fuzz`


@pytest.mark.parametrize(
    ("axis", "signal", "wavelength", "kind", "factor"),
    [
        (("energy", "eV"), ("reflectance", ""), 1239.8419843320026 / ENERGY, "R", 1.0),
        (("wavelength", "um"), ("transmittance", "%"), 1e3 * ENERGY, "T", 0.01),
        (("wavenumber", "1/cm"), ("reflectance", "1"), 1e7 / ENERGY, "R", 1.0),
    ],
)
def test_nxdata(axis, signal, wavelength, kind, factor, write):
    found = read_spectrum(write(nexus(lambda file: nxdata(file, axis, signal))))
    order = np.argsort(wavelength)
    assert_read(found, signal=kind, wavelength=wavelength[order], values=factor * R[order])


def test_errors_and_an_absorbance(write):
    def fill(file):
        data = nxdata(file, signal=("absorbance", ""), axis=("wavelength", "um"))
        data["absorbance_errors"] = [0.01, 0.02, 0.03]

    assert_read(read_spectrum(write(nexus(fill))), signal="T", values=10**-R)


def test_a_unit_that_is_missing_is_asked_for(refused):
    refused(nexus(lambda file: nxdata(file, axis=("wavelength", None))), "'not stated'", "`wavelength_unit`")


def test_other_units_are_refused(refused):
    refused(nexus(lambda file: nxdata(file, axis=("wavelength", "parsec"))), "'parsec'")

    def radians(file):
        nxellipsometry(file)
        file["entry/instrument/angle_of_incidence"].attrs["units"] = "radian"

    refused(nexus(radians), "'radian'", "write angles in degrees")


def test_nxellipsometry(write):
    found = read_spectrum(write(nexus(lambda file: nxellipsometry(file, errors=True))))
    at = found.angle == 60.5
    np.testing.assert_allclose(found.wavelength[at], [400, 500, 600])
    np.testing.assert_allclose(found.values[at], PSI[1])
    np.testing.assert_allclose(found.delta[at], DELTA[1])
    np.testing.assert_allclose(found.values[~at], PSI[0])
    np.testing.assert_allclose(found.sigma, 0.1)
    facts = dict(found.declared)
    assert facts["date"].startswith("2022-01-27")
    assert facts["sample"] == "2nm SiO2 on Si"


def in_the_wild(target):
    """Fill a file as public ones are: axes of environment and time, units elsewhere, other names."""

    def fill(file):
        data = nxellipsometry(file, kind="NOT_PROVIDED")
        del data["measured_data"], data["wavelength"], data["wavelength_spectrum"]
        data["psi_50deg"], data["delta_50deg"] = 0.0, 0.0
        values = np.stack((PSI, DELTA), axis=1)[None, None]
        data["measured_data"], data["data_error"] = values, np.full(values.shape, 0.1)
        spectrometer = group(file["entry/instrument"], "spectrometer", "NXmonochromator")
        if target:
            put(spectrometer, "axis", ANGSTROM, "Angstroms")
            data["wavelength"] = ANGSTROM
            of_axis = {"units": "NOT_PROVIDED", "target": "/entry/instrument/spectrometer/axis"}
            data["wavelength"].attrs.update(of_axis)
        else:
            put(spectrometer, "wavelength", ANGSTROM)
            put(spectrometer, "wavelength_spectrum", ANGSTROM, "Angstroms")

    return fill


@pytest.mark.parametrize("target", [True, False])
def test_nxellipsometry_in_the_wild(write, target):
    found = read_spectrum(write(nexus(in_the_wild(target))))
    at = found.angle == 60.5
    np.testing.assert_allclose(found.wavelength[at], [400, 500, 600])
    np.testing.assert_allclose(found.delta[at], DELTA[1])
    np.testing.assert_allclose(found.delta_sigma, 0.1)


def test_nxellipsometry_of_n_c_s(write):
    psi, delta = np.deg2rad(PSI), np.deg2rad(DELTA)
    ncs = np.cos(2 * psi), np.sin(2 * psi) * np.cos(delta), np.sin(2 * psi) * np.sin(delta)
    found = read_spectrum(write(nexus(lambda file: nxellipsometry(file, "N/C/S", ncs))))
    at = found.angle == 50.0
    np.testing.assert_allclose(found.values[at], PSI[0])
    np.testing.assert_allclose(found.delta[at], DELTA[0])


@pytest.mark.parametrize("kind", ["Mueller matrix", "tan(Psi)/cos(Delta)", "Jones matrix", None])
def test_other_data_types_are_named(kind, refused):
    refused(nexus(lambda file: nxellipsometry(file, kind)), repr(kind or "not stated"), "as CSV")


def test_measurements_without_their_angles_are_refused(refused):
    refused(nexus(lambda file: nxellipsometry(file, angles=(50.0,))), "2 measurements", "angle of incidence")


def test_two_groups_are_chosen_by_name(write, refused):
    def fill(file):
        nxdata(file)
        other = group(file["entry"], "other", "NXdata")
        put(other, "wavelength", ENERGY, "um")
        put(other, "transmittance", R / 2, "")

    content = nexus(fill)
    refused(content, 'signal="T"')
    np.testing.assert_allclose(read_spectrum(write(content), spectrum="/entry/other").values, R / 2)


def linked(link):
    def fill(file):
        data = nxdata(file)
        del data["reflectance"]
        data["reflectance"] = link

    return nexus(fill)


def test_links_out_of_the_file_are_refused(refused):
    refused(linked(h5py.ExternalLink("/etc/hostname", "/x")), "link to another file", "'/etc/hostname'")


def test_a_soft_link_through_an_external_one_is_refused(refused):
    def fill(file):
        data = nxdata(file)
        file["entry/away"] = h5py.ExternalLink("/etc/hostname", "/x")
        del data["reflectance"]
        data["reflectance"] = h5py.SoftLink("/entry/away/reflectance")

    refused(nexus(fill), "link to another file")


def test_links_in_a_circle_are_refused(refused):
    refused(linked(h5py.SoftLink("/entry/data/reflectance")), "link to itself")


def test_groups_in_a_circle_are_read_once(write):
    def fill(file):
        data = nxdata(file)
        data["up"] = file["entry"]

    np.testing.assert_allclose(read_spectrum(write(nexus(fill))).values[::-1], R)


def test_virtual_and_external_datasets_are_refused(refused, tmp_path):
    def virtual(file):
        data = nxdata(file)
        layout = h5py.VirtualLayout(shape=(3,), dtype="f8")
        layout[:] = h5py.VirtualSource("/etc/hostname", "x", shape=(3,))
        del data["reflectance"]
        data.create_virtual_dataset("reflectance", layout)

    refused(nexus(virtual), "stored in another dataset or file")

    def external(file):
        data = nxdata(file)
        del data["reflectance"]
        data.create_dataset("reflectance", (3,), "f8", external=[(str(tmp_path / "raw"), 0, 24)])

    refused(nexus(external), "stored in another dataset or file")


def test_huge_datasets_are_refused_before_they_are_read(refused):
    """10^9 values that take no room in the file, and a chunk of 800 MB."""

    def huge(file):
        data = nxdata(file)
        del data["reflectance"]
        data.create_dataset("reflectance", (1_000_000_000,), "f8", chunks=(1000,))

    def chunk(file):
        data = nxdata(file)
        del data["reflectance"]
        data.create_dataset("reflectance", (3,), "f8", chunks=(100_000_000,), maxshape=(None,))

    refused(nexus(huge), "more than a spectrum")
    refused(nexus(chunk), "more than a spectrum")


def test_the_number_of_groups_is_bounded(refused, monkeypatch):
    monkeypatch.setattr(nexus_reader, "_MOST_GROUPS", 1)
    refused(nexus(nxdata), "more than 1 groups")


def test_other_hdf5_files_are_refused(refused):
    refused(nexus(lambda file: put(file, "image", np.ones((3, 3)))), "without a wavelength")
    refused(nexus(lambda file: nxdata(file, values=np.ones(4))), "does not match 3 points")
    refused(nexus(nxdata)[:1500], "cannot be read", "export it as CSV")
    refused(nexus(nxdata)[:8], "cannot be read")


def test_the_extra_is_named(refused, monkeypatch):
    content = nexus(nxdata)
    monkeypatch.setitem(sys.modules, "h5py", None)
    refused(content, "h5py", "pip install 'pellicle[formats]'")


READERS = """
import ctypes, time
def crash(content):
    ctypes.string_at(0)
def hang(content):
    time.sleep(100)
"""


@pytest.mark.parametrize(("function", "words"), [("crash", "crashes"), ("hang", "does not end")])
def test_a_reader_that_fails_in_a_child_is_stopped(function, words, tmp_path, monkeypatch):
    (tmp_path / "fragile_readers.py").write_text(READERS)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(isolated, "TIMEOUT", 1.0 if function == "hang" else 60.0)
    with pytest.raises(DataError, match=f"^is a damaged file, on which its reader {words}"):
        isolated.call(f"fragile_readers:{function}", b"")
