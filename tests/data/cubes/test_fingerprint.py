"""Fingerprints, copies sent to other processes, and what is read of a large cube."""

import os
import pickle
import subprocess
import sys

import numpy as np
import pytest
import xarray as xr

from pellicle.data.cube import Cube
from pellicle.data.read_cube import read_cube

NM = np.linspace(400.0, 800.0, 9)


@pytest.fixture
def path(values, tmp_path):
    np.save(tmp_path / "a.npy", values)
    return tmp_path / "a.npy"


def test_content_and_options_change_it(path, values, tmp_path):
    first = read_cube(path, wavelengths=NM).fingerprint
    assert read_cube(path, wavelengths=NM).fingerprint == first
    os.utime(path, (1, 1))  # the date of a small file does not count
    assert read_cube(path, wavelengths=NM).fingerprint == first
    mask = np.ones((7, 5), bool)
    mask[0, 0] = False
    options = [{"signal": "T"}, {"range": (450, 800)}, {"noise": 0.01}, {"mask": mask}, {"angle": 60.0}]
    others = [read_cube(path, **{"wavelengths": NM} | each) for each in ({"wavelengths": NM + 1}, *options)]
    others.append(read_cube(path, wavelengths=NM).coarse(2))
    values = values.copy()
    values[3, 4, 5] += 1e-6
    np.save(path, values)
    others.append(read_cube(path, wavelengths=NM))
    assert len({first, *(cube.fingerprint for cube in others)}) == 1 + len(others)


def test_a_cube_without_a_fingerprint_gets_none(values):
    """A map then hashes its values; one made of the places of the pixels would be that of any cube."""
    cube = Cube({"values": values}, NM)
    assert cube.coarse(2).fingerprint == cube.divided(np.ones(9), "lamp").fingerprint == ""


def test_arrays_in_memory_and_of_dask(values):
    array = xr.DataArray(values, dims=("y", "x", "wavelength"), coords={"wavelength": NM}, name="R")
    first = read_cube(array).fingerprint
    assert read_cube(array.copy()).fingerprint == first
    assert read_cube(array + 1e-3).fingerprint != first
    lazy = array.chunk({"y": 3})
    assert read_cube(lazy).fingerprint == read_cube(array.chunk({"y": 3})).fingerprint
    assert read_cube(lazy).fingerprint != read_cube(lazy + 1e-3).fingerprint


def test_a_pixel_of_dask_outside_the_sample():
    """The blocks that are read are the same; the name of the array is a digest of its graph."""
    nm = np.linspace(400, 800, 20)
    large = xr.DataArray(
        np.full((300, 300, 20), 0.3, "f4"), dims=("y", "x", "wavelength"), coords={"wavelength": nm}, name="R"
    )
    other = large.copy()
    other[30, 30] = 0.4
    one, two = (read_cube(array.chunk({"y": 50})).fingerprint for array in (large, other))
    assert one != two


def test_a_large_file_by_size_date_and_samples(path, monkeypatch):
    monkeypatch.setattr("pellicle.data.fingerprint.WHOLE", 100)
    monkeypatch.setattr("pellicle.data.read_cube.WHOLE", 100)
    cube = read_cube(path, wavelengths=NM)
    assert any("size, date and samples" in note for note in cube.notes)
    assert read_cube(path, wavelengths=NM).fingerprint == cube.fingerprint
    os.utime(path, (1, 1))
    assert read_cube(path, wavelengths=NM).fingerprint != cube.fingerprint


def test_a_copy_for_another_process_is_small(values, same, tmp_path):
    large = np.zeros((200, 200, 9), "f4") + 0.5
    np.save(tmp_path / "large.npy", large)
    xr.DataArray(large, dims=("y", "x", "wavelength"), coords={"wavelength": NM}, name="R").to_netcdf(
        tmp_path / "large.nc", engine="h5netcdf"
    )
    for cube in (read_cube(tmp_path / "large.npy", wavelengths=NM), read_cube(tmp_path / "large.nc")):
        packed = pickle.dumps(cube)
        assert len(packed) < 10_000  # the values are 1.4 MB
        copied = pickle.loads(packed)
        assert np.all(copied.pixels((slice(50, 60), slice(0, 5)))["values"] == 0.5)


SCRIPT = """
import resource, sys
import numpy as np
from pellicle.data.read_cube import read_cube
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
cube = read_cube(sys.argv[1], signal="R")
total = 0.0
for row in range(0, cube.shape[0], 16):
    total += cube.pixels((slice(row, row + 16), slice(None)))["values"].sum()
print(total, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
"""


def test_memory_is_that_of_blocks(tmp_path):
    header = "ENVI\nsamples = 1024\nlines = 1024\nbands = 64\ndata type = 4\ninterleave = bsq\nbyte order = 0"
    nm = ", ".join(str(400 + 5 * i) for i in range(64))
    (tmp_path / "cube.hdr").write_text(f"{header}\nwavelength = {{{nm}}}\n")
    # 268 MB of float32 in a sparse file that takes no disk
    mapped = np.memmap(tmp_path / "cube.dat", "f4", "w+", shape=(64, 1024, 1024))
    mapped[:, :8, :8] = 0.25
    mapped[:, 512, 512] = 0.25
    mapped.flush()
    command = [sys.executable, "-c", SCRIPT, str(tmp_path / "cube.hdr")]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    total, kilobytes = (float(word) for word in done.stdout.split())
    assert total == 0.25 * 64 * 65
    # a block of 16 rows has 8 MB as float64 and some copies; pages of an open map would be all 268 MB
    unit = 1 if sys.platform != "darwin" else 1024
    assert kilobytes / unit < 100_000
