"""TIFF stacks in the layouts that cameras, ImageJ and OME write."""

import sys

import numpy as np
import tifffile

from pellicle.data.read_cube import is_photograph, read_cube
from pellicle.errors import DataError, UsageError

NM = np.linspace(400.0, 800.0, 9)


def test_larger_tiles_than_blocks(same, tmp_path):
    rng = np.random.default_rng(0)
    large = rng.random((9, 50, 70)).astype("f4")
    path = tmp_path / "tiles.tif"
    tifffile.imwrite(path, large, tile=(16, 32), compression="zlib", photometric="minisblack")
    cube = same(path, expected=large.transpose(1, 2, 0), wavelengths=NM)
    block = cube.pixels((slice(15, 40, 3), slice(30, 66)))["values"]
    np.testing.assert_array_equal(block, large[:, 15:40:3, 30:66].transpose(1, 2, 0).reshape(-1, 9))


def test_a_series_in_time(values, tmp_path):
    series = np.stack([values, values / 2]).transpose(0, 3, 1, 2)
    tifffile.imwrite(tmp_path / "time.tif", series, imagej=True, metadata={"axes": "TCYX"})
    cube = read_cube(tmp_path / "time.tif", wavelengths=NM)
    assert cube.dims == ("time", "y", "x")
    np.testing.assert_allclose(np.asarray(cube.arrays["values"])[1], values / 2)


def test_wavelengths_of_metadata(values, same, tmp_path):
    stack = values.transpose(2, 0, 1)
    channel = {"EmissionWavelength": list(NM), "EmissionWavelengthUnit": ["nm"] * 9}
    described = {"axes": "CYX", "Channel": channel}
    tifffile.imwrite(tmp_path / "ome.tif", stack, ome=True, photometric="minisblack", metadata=described)
    same(tmp_path / "ome.tif")
    labels = {"Labels": [f"band {i}: {nm:g} nm" for i, nm in enumerate(NM)]}
    tifffile.imwrite(tmp_path / "imagej.tif", stack, imagej=True, metadata=labels)
    same(tmp_path / "imagej.tif")


def test_without_wavelengths(values, refused, tmp_path):
    path = tmp_path / "stack.tif"
    tifffile.imwrite(path, values.transpose(2, 0, 1), photometric="minisblack")
    refused(path, "no wavelengths", "9 x 7 x 5", "`wavelengths", error=UsageError)
    refused(path, "8 wavelengths", error=DataError, wavelengths="400:750:50")


def test_a_photograph_is_no_cube(values, refused, tmp_path):
    path = tmp_path / "photo.tif"
    tifffile.imwrite(path, (255 * values[..., :3]).astype("u1"), photometric="rgb")
    assert is_photograph(path)
    refused(path, "three channels", '`signal="srgb"`', error=UsageError)
    tifffile.imwrite(tmp_path / "stack.tif", values.transpose(2, 0, 1), photometric="minisblack")
    assert not is_photograph(tmp_path / "stack.tif")


def test_a_compressed_stack_needs_zarr(values, refused, tmp_path, monkeypatch):
    tifffile.imwrite(
        tmp_path / "a.tif", values.transpose(2, 0, 1), compression="zlib", photometric="minisblack"
    )
    monkeypatch.setitem(sys.modules, "zarr", None)
    refused(tmp_path / "a.tif", "need zarr: pip install 'pellicle[maps]'", error=UsageError, wavelengths=NM)


def test_a_compression_that_needs_another_package(values, refused, tmp_path):
    path = tmp_path / "stack.tif"
    whole = (4000 * values.transpose(2, 0, 1)).astype("u2")
    tifffile.imwrite(path, whole, compression="zlib", photometric="minisblack")
    content = bytearray(path.read_bytes())
    with tifffile.TiffFile(path) as file:
        places = [page.tags["Compression"].valueoffset for page in file.pages]
    for at in places:
        content[at : at + 2] = (34887).to_bytes(2, "little")  # LERC
    path.write_bytes(content)
    refused(path, str(path), "without compression", error=DataError, wavelengths=NM, signal_unit=4000)
