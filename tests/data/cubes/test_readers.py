"""Readers of cubes on the same cube: axes in any order, blocks, errors, copies, damage; NumPy and TIFF."""

import itertools
import pickle
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest
import tifffile
import xarray as xr
import zarr

from pellicle.data.read_cube import is_photograph, read_cube
from pellicle.errors import DataError, UsageError

NM = np.linspace(400.0, 800.0, 9)
GIVEN = {"wavelengths": NM}
ORDERS = list(itertools.permutations(("y", "x", "wavelength")))


def array(values, order=ORDERS[0], name="R"):
    coords = {"wavelength": NM, "y": ("y", np.arange(7) * 0.1, {"units": "mm"})}
    return xr.DataArray(values, coords, ORDERS[0], name=name).transpose(*order)


def place(order):
    return [ORDERS[0].index(axis) for axis in order]


def npy(values, folder, *, order=ORDERS[0], memory="C"):
    np.save(folder / "a.npy", np.array(values.transpose(place(order)), order=memory))
    return folder / "a.npy"


def npz(values, folder, save):
    save(folder / "a.npz", R=values, sigma=values * 0 + 0.01, wavelength_um=NM / 1000)
    return folder / "a.npz"


def netcdf(values, folder, engine):
    both = xr.Dataset({"R": array(values), "R_sigma": array(values * 0 + 0.01)})
    both.to_netcdf(folder / "a.nc", engine=engine)
    return folder / "a.nc"


def group(values, folder, version, consolidated):
    both = xr.Dataset({"R": array(values), "uncertainty": array(values * 0 + 0.01)})
    both.to_zarr(folder / "a.zarr", zarr_format=version, consolidated=consolidated)
    return folder / "a.zarr"


def zarr_array(values, folder, names=None):
    order = place(names) if names else [0, 1, 2]
    zarr.create_array(folder / "a.zarr", data=values.transpose(order), dimension_names=names)
    return folder / "a.zarr"


def envi(values, folder, interleave, byte_order, *, data=False):
    order = {"bsq": (2, 0, 1), "bil": (0, 2, 1), "bip": (0, 1, 2)}[interleave]
    content = values.transpose(order).astype("<>"[byte_order] + "f4").tobytes()
    (folder / "a.dat").write_bytes(bytes(12) + content)
    (folder / "a.hdr").write_text(
        "ENVI\nsamples = 5\nlines = 7\nbands = 9\nheader offset = 12\ndata type = 4\n"
        f"interleave = {interleave}\nbyte order = {byte_order}\nwavelength units = Nanometers\n"
        f"wavelength = {{\n {', '.join(map(str, NM))}}}\n"
    )
    return folder / ("a.dat" if data else "a.hdr")


def stack(values, folder, **options):
    kind = {} if "imagej" in options else {"photometric": "minisblack"}
    tifffile.imwrite(folder / "a.tif", values.transpose(2, 0, 1), **kind, **options)
    return folder / "a.tif"


def pages(values, folder):
    with tifffile.TiffWriter(folder / "a.tif") as writer:
        for page in values.transpose(2, 0, 1):
            writer.write(page, contiguous=False)
    return folder / "a.tif"


def samples(values, folder, compression):
    contiguous = {"planarconfig": "contig", "photometric": "minisblack"}
    tifffile.imwrite(folder / "a.tif", values, compression=compression, **contiguous)
    return folder / "a.tif"


def case(name, write, *more, given=False, **options):
    return pytest.param(lambda v, folder: write(v, folder, *more, **options), GIVEN if given else {}, id=name)


FILES = [
    *(
        case(f"npy {'-'.join(o)} {m}", npy, given=True, order=o, memory=m)
        for o in ORDERS
        if o.index("y") < o.index("x")
        for m in "CF"
    ),
    case("npz", npz, np.savez),
    case("npz, compressed", npz, np.savez_compressed),
    *(case(f"NetCDF by {engine}", netcdf, engine) for engine in ("h5netcdf", "scipy")),
    *(case(f"zarr {v}, {c}", group, v, c) for v in (2, 3) for c in (False, True)),
    case("zarr array", zarr_array, given=True),
    case("zarr array with names", zarr_array, ["wavelength", "y", "x"], given=True),
    *(case(f"ENVI {i} {o}", envi, i, o) for i in ("bsq", "bil", "bip") for o in (0, 1)),
    case("ENVI by its data", envi, "bsq", 0, data=True),
    case("TIFF", stack, given=True),
    case("TIFF, big-endian", stack, given=True, byteorder=">"),
    case("BigTIFF", stack, given=True, bigtiff=True),
    case("ImageJ", stack, given=True, imagej=True),
    case("TIFF in strips", stack, given=True, compression="zlib", rowsperstrip=3),
    case("TIFF in tiles", stack, given=True, compression="zlib", tile=(16, 16)),
    case("TIFF page by page", pages, given=True),
    *(case(f"TIFF of samples, {c}", samples, c, given=True) for c in (None, "zlib")),
]
WITH_ERRORS = ("npz", "NetCDF", "zarr 2", "zarr 3")


@pytest.mark.filterwarnings("ignore:Consolidated metadata")  # zarr 3 has no specification of it yet
@pytest.mark.parametrize(("write", "options"), FILES)
def test_a_file_is_read_to_the_same_cube(write, options, values, same, tmp_path, request):
    cube = same(write(values, tmp_path), **options)
    assert (cube.dims, cube.signal) == (("y", "x"), "R")
    if request.node.callspec.id.startswith(WITH_ERRORS):
        np.testing.assert_allclose(cube.pixels((slice(0, 3), slice(1, 2)))["sigma"], 0.01, rtol=1e-6)
    copy = pickle.loads(pickle.dumps(cube))  # as it is sent to another process
    where = slice(1, 6, 2), slice(3, None)
    np.testing.assert_allclose(copy.pixels(where)["values"], values[where].reshape(-1, 9), rtol=1e-6)
    part = cube.coarse(2)
    np.testing.assert_allclose(np.asarray(part.arrays["values"]), values[1::2, 1::2], rtol=1e-6)


@pytest.mark.parametrize("order", ORDERS)
def test_arrays_of_xarray(order, values, same):
    for source in (array(values, order), array(values, order).chunk({"y": 3}), array(values, order, None)):
        cube = same(source)
        np.testing.assert_allclose(cube.coords["y"], np.arange(7) * 0.1)
        assert cube.units == {"y": "mm"}
    same(values, **GIVEN)


def _cut(path: Path, length: int) -> Path:
    path.write_bytes(path.read_bytes()[:length])
    return path


@pytest.mark.parametrize(
    ("write", "words"),
    [
        (lambda v, p: _cut(npy(v, p), -4), "ends before"),
        (lambda v, p: _cut(npz(v, p, np.savez), 200), "damaged"),
        (lambda v, p: _cut(netcdf(v, p, "h5netcdf"), 100), "cannot be opened"),
        (lambda v, p: _cut(envi(v, p, "bsq", 0, data=True), -4), "incomplete"),
        (lambda v, p: _cut(stack(v, p), 20), "save it again"),
        (lambda v, p: _cut(group(v, p, 3, False) / "zarr.json", 20).parent, "damaged"),
    ],
)
def test_damaged_files_are_named(write, words, values, refused, tmp_path):
    path = write(values, tmp_path)
    refused(path, str(tmp_path), words, error=DataError, **GIVEN)


@pytest.mark.parametrize("shape", [(0, 5, 9), (4, 0, 9)])
def test_a_cube_without_pixels(shape, refused):
    refused(np.zeros(shape), "no pixels", f"y {shape[0]}, x {shape[1]}", error=DataError, **GIVEN)


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
    refused(values, "one array without a name", error=UsageError, wavelengths=NM, variable="R")
    refused(tmp_path / "gone.npy", "no such file", signal="srgb")
    refused(values, "`signal` of a cube must be one of", error=UsageError, wavelengths=NM, signal="srgb")


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


def test_a_table_with_a_column_for_each_time_says_of_none_that_it_is_ignored(write):
    rows = "\n".join(f"{nm:g},0.{i}1,0.{i}2,0.{i}3" for i, nm in enumerate(NM))
    cube = read_cube([Path(write(f"wavelength_nm,0 s,2 s,4 s\n{rows}\n"))], signal="R")
    assert cube.coords["time"].tolist() == [0.0, 2.0, 4.0]
    assert "wavelength unit: nm" in cube.notes
    assert not any("ignored" in note or "'0 s'" in note for note in cube.notes)


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


def test_the_declared_size_of_a_packed_array_is_checked_before_it_is_unpacked(refused, tmp_path):
    """A head that declares 4 GB, whose content is not there: nothing is unpacked."""
    with zipfile.ZipFile(tmp_path / "bomb.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("cube.npy", b"\x93NUMPY\x01\x00")
    content = (tmp_path / "bomb.npz").read_bytes()
    place = content.index(b"PK\x01\x02") + 24  # the size in the directory
    (tmp_path / "bomb.npz").write_bytes(
        content[:place] + (4 * 10**9).to_bytes(4, "little") + content[place + 4 :]
    )
    refused(tmp_path / "bomb.npz", "4.0 GB", "np.savez", error=DataError)
