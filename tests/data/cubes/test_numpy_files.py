"""NumPy files, and lists of wavelengths."""

import numpy as np
import pytest

from pellicle.data.read_cube import read_cube
from pellicle.errors import DataError, UsageError

NM = np.linspace(400.0, 800.0, 9)


def test_sites_and_time(values, tmp_path):
    np.save(tmp_path / "sites.npy", values.reshape(35, 9))
    assert read_cube(tmp_path / "sites.npy", wavelengths=NM).dims == ("site",)
    np.save(tmp_path / "time.npy", np.stack([values, values]))
    assert read_cube(tmp_path / "time.npy", wavelengths=NM).dims == ("time", "y", "x")


@pytest.mark.parametrize(
    "written",
    [
        "400\n450\n500\n550\n600\n650\n700\n750\n800\n",
        "wavelength_um\n0.4\n0.45\n0.5\n0.55\n0.6\n0.65\n0.7\n0.75\n0.8",
        "400, 450, 500, 550, 600, 650, 700, 750, 800",
        "band,wavelength_nm,fwhm\n" + "".join(f"{i},{nm:g},3\n" for i, nm in enumerate(NM)),
        "Band;Wavelength (nm)\n" + "".join(f"{i};{nm:g}\n" for i, nm in enumerate(NM)),
        "band;wl (um)\n" + "".join(f"{i};{nm / 1000:.4f}\n".replace(".", ",") for i, nm in enumerate(NM)),
        "Wavelength (nm)\n" + "".join(f"{nm:.1f}\n".replace(".", ",") for nm in NM),
    ],
)
def test_file_of_wavelengths(values, same, tmp_path, written):
    (tmp_path / "bands.txt").write_text(written)
    same(values, wavelengths=tmp_path / "bands.txt")


def test_file_of_other_columns(values, refused, tmp_path):
    (tmp_path / "bands.csv").write_text("band,gain\n1,2\n2,2\n")
    refused(values, "band, gain", error=UsageError, wavelengths=tmp_path / "bands.csv")


@pytest.mark.parametrize("wrong", ["400:800", "400:800:45", "800:400:50", "blue", "400:800:0", ""])
def test_wrong_lists_of_wavelengths(values, refused, wrong):
    refused(values, "`wavelengths`", error=UsageError, wavelengths=wrong)


def test_refusals(values, refused, tmp_path):
    np.save(tmp_path / "a.npy", values)
    refused(tmp_path / "a.npy", "no wavelengths", "7 x 5 x 9", error=UsageError)
    refused(tmp_path / "a.npy", "4 wavelengths", error=DataError, wavelengths="400,500,600,700")
    np.save(tmp_path / "flat.npy", values[0, 0])
    refused(tmp_path / "flat.npy", "no array of pixels", error=DataError, wavelengths=NM)
    np.save(tmp_path / "objects.npy", np.array([{}]), allow_pickle=True)
    refused(tmp_path / "objects.npy", "damaged", error=DataError, wavelengths=NM)
    (tmp_path / "text.md").write_text("# notes\n")
    refused(tmp_path / "text.md", "is no cube", "zarr, NetCDF, ENVI", error=DataError)
    refused(tmp_path / "absent.npy", "no such file", error=DataError)
    refused(tmp_path, "without a table of positions", error=DataError)
    refused(42, "must be a path", error=UsageError)
