"""Spectra written as CSV are read back unchanged; NetCDF and NeXus hold the same numbers."""

import dataclasses

import numpy as np
import pytest

import pellicle as pl
from pellicle.data.read_spectrum import read_spectrum
from pellicle.data.repeated_sweeps import mean_spectrum
from pellicle.errors import UsageError

NM = np.linspace(400, 700, 7)
ARRAYS = ("wavelength", "values", "sigma", "angle", "delta", "delta_sigma", "depolarisation", "azimuth")


def reflectance(**changes):
    values = 0.3 + 0.1 * np.sin(NM / 37)
    return pl.Spectrum(**{"wavelength": NM, "values": values, "signal": "R", "path": "a, b.txt", **changes})


def angles(**changes):
    count = NM.size
    psi, delta = np.linspace(10, 40, 2 * count), np.linspace(5, 355, 2 * count)
    errors = {"sigma": np.full(2 * count, 0.05), "delta_sigma": np.full(2 * count, 0.1)}
    about = {"depolarisation": np.linspace(0, 0.1, 2 * count), "angle": np.repeat([65.0, 75.0], count)}
    return pl.Spectrum(np.tile(NM, 2), psi, "psi-delta", delta=delta, **errors, **about, **changes)


def elements():
    random, angle = np.random.default_rng(0), np.repeat([60.0, 70.0], 3)
    about = {"sigma": random.uniform(0.001, 0.01, (6, 3)), "elements": ("m12", "m23", "m44")}
    return pl.Spectrum(np.tile(NM[:3], 2), random.uniform(-1, 1, (6, 3)), "mueller", angle=angle, **about)


def ratios():
    psi, sigma = np.linspace(0, 60, 21).reshape(7, 3), np.linspace(0.01, 0.2, 21).reshape(7, 3)
    about = {"delta": 5 * psi, "delta_sigma": 2 * sigma, "ratios": ("ane", "aps", "asp")}
    place = {"angle": np.full(7, 65.0), "azimuth": np.full(7, 30.0)}
    return pl.Spectrum(NM, psi, "generalised-psi-delta", sigma=sigma, **about, **place)


CASES = {
    "R": reflectance(),
    "T with errors": reflectance(signal="T", sigma=np.full(7, 1 / 3)),
    "p light": reflectance(polarisation="p", angle=np.full(7, 60.0)),
    "sweeps": mean_spectrum([reflectance(values=0.3 + 0.01 * np.cos(NM + k)) for k in range(3)]),
    "declared": reflectance(declared=(("instrument", "A # 1"), ("date", "2024-01-01"))),
    "ellipsometry": angles(),
    "Mueller": elements(),
    "contrast": reflectance(signal="contrast", values=0.2 * np.sin(NM / 37), sigma=np.full(7, 0.01)),
    "generalised": ratios(),
    "folded": dataclasses.replace(angles(), delta=np.linspace(5, 175, 14), folded=True),
}


FILES = [(name, ".csv") for name in CASES]
FILES += [
    (name, suffix)
    for name in ("ellipsometry", "Mueller", "generalised", "contrast")
    for suffix in (".nc", ".nxs")
]


@pytest.mark.parametrize(("name", "suffix"), FILES)
def test_a_written_spectrum_is_read_back_unchanged(tmp_path, name, suffix):
    if suffix != ".csv":
        pytest.importorskip("h5netcdf")
    spectrum = CASES[name]
    again = read_spectrum(pl.write_spectrum(tmp_path / f"out{suffix}", spectrum))
    for name in ARRAYS:
        np.testing.assert_array_equal(getattr(again, name), getattr(spectrum, name), err_msg=name)
    for name in ("signal", "polarisation", "calibrated", "folded", "elements", "ratios"):
        assert getattr(again, name) == getattr(spectrum, name)
    assert len(again.sweeps) == len(spectrum.sweeps)
    assert dict(again.declared).items() >= dict(spectrum.declared).items()


def test_an_unknown_scale_stays_unknown(tmp_path, refused):
    path = pl.write_spectrum(tmp_path / "out.csv", reflectance(calibrated=False))
    refused(path, "uncalibrated; ", '`signal="R"`', error=UsageError)
    assert not read_spectrum(path, signal="R").calibrated


def test_netcdf(tmp_path):
    xarray = pytest.importorskip("xarray")
    path = pl.write_spectrum(tmp_path / "out.nc", angles(name="spot 2"))
    with xarray.open_dataset(path, engine="h5netcdf") as found:
        np.testing.assert_array_equal(found["psi"], angles().values)
        np.testing.assert_array_equal(found["angle_of_incidence"], angles().angle)
        np.testing.assert_array_equal(found["delta_errors"], angles().delta_sigma)
        assert found["wavelength"].attrs["units"] == "nm"
        assert found.attrs["name"] == "spot 2"


def test_nexus(tmp_path):
    h5py = pytest.importorskip("h5py")
    path = pl.write_spectrum(tmp_path / "out.nxs", angles())
    with h5py.File(path) as file:
        entry = file["entry"]
        data = entry[entry.attrs["default"]]
        assert entry["definition"][()].decode() == "NXellipsometry"
        assert (data.attrs["NX_class"], data.attrs["signal"]) == ("NXdata", "psi")
        np.testing.assert_array_equal(data["delta"], angles().delta)
        assert data["delta"].attrs["units"] == "degree"


@pytest.mark.parametrize("name", ["out.csv", "out.xlsx", "absent/out.csv"])
def test_what_cannot_be_written(tmp_path, name):
    (tmp_path / "out.csv").write_text("mine")
    with pytest.raises(UsageError, match=r"is not overwritten|expected a name ending in \.csv|no folder"):
        pl.write_spectrum(tmp_path / name, reflectance())
    assert (tmp_path / "out.csv").read_text() == "mine"
