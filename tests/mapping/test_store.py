"""The store of a map: its variables, killed runs, what it does not continue; and how maps show themselves."""

import dataclasses
import errno
import gc
import itertools
import json
import os
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from time import sleep

import numpy as np
import pytest
import xarray
import zarr

import pellicle as pl
from pellicle.errors import DataError, UsageError
from pellicle.fitting.batch.data import CODES
from pellicle.mapping import run
from pellicle.mapping.locks import held
from pellicle.mapping.map_result import Map
from pellicle.mapping.run import run_map
from pellicle.mapping.store import write_dataset
from pellicle.reporting.map_text import cube_report

pytestmark = pytest.mark.usefixtures("small_blocks")


class Killed(BaseException):
    pass


@pytest.fixture
def mapped(cube, scene, fake_fits, tmp_path):
    """Maps the cube, with changed arguments, into a store of this name."""

    def mapped(name="map.zarr", the_cube=cube, the_scene=scene, **options):
        return run_map(the_cube, the_scene, tmp_path / name, **{"fit": fake_fits.fit, **options})

    return mapped


def counted(fit, die_at=None):
    """A fit that counts its blocks, and dies at one of them."""

    def call(model, cube, where):
        call.blocks += 1
        if call.blocks == die_at:
            raise Killed
        return fit(model, cube, where)

    call.blocks = 0
    return call


def test_values_and_attributes_of_every_pixel(mapped, cube):
    made = mapped()
    data = xarray.open_zarr(made.path)
    mean = 1000 * cube.arrays["values"].mean(axis=2)
    mean[7, 7] = np.nan
    np.testing.assert_allclose(data.thickness, mean)
    np.testing.assert_allclose(data.thickness_stderr_noise, mean / 50, rtol=1e-6)
    assert np.isposinf(data.thickness_stderr[0, 0])
    np.testing.assert_allclose(data.rival_thickness, mean + 200, rtol=1e-6)
    np.testing.assert_allclose(data.order_delta_chi2[0, 0], [0, 9, np.nan, np.nan])
    np.testing.assert_allclose(data.order_thickness[..., 0], mean, rtol=1e-6)
    words = data.status.attrs["flag_meanings"].split()
    assert words[int(data.status[0, 0])] == "converged"
    assert {words[int(data.status[at])] for at in ((3, 5), (7, 7))} == {"no-data"}
    assert data.thickness.attrs["units"] == "nm"
    assert (data.y.attrs["units"], float(data.y[2])) == ("mm", 1.0)
    assert data.attrs["Conventions"].startswith("CF-1")
    assert (data.attrs["path"], data.attrs["notes"]) == ("wafer.npy", ["percent"])

    assert made.status == {"no-data": 2, "converged": 45 * 32 - 2}
    assert (made.shape, made.dims, made.parameters) == ((45, 32), ("y", "x"), {"thickness": "nm"})
    assert (made.converged, made.finished, made.thickness.dims) == (1.0, True, ("y", "x"))
    assert repr(made) == "wafer.npy: map of 45 x 32 pixels, 100 % converged"
    assert (made.run.pixels, made.run.earlier) == (45 * 32, 0)


def test_netcdf_has_the_same_values_and_flags(mapped, tmp_path, refuses):
    made = mapped()
    made.to_netcdf(tmp_path / "map.nc")
    with xarray.open_dataset(tmp_path / "map.nc", engine="h5netcdf") as copy:
        xarray.testing.assert_equal(copy.load(), made.dataset.compute())
        assert copy.status.attrs["flag_values"].dtype == np.uint8
    refuses(UsageError, "is not overwritten", made.to_netcdf, tmp_path / "map.nc")


def test_a_killed_map_goes_on_and_is_equal(mapped, fake_fits, same_files, tmp_path):
    whole = mapped("whole.zarr")
    with pytest.raises(Killed):
        mapped(fit=counted(fake_fits.fit, 7))
    begun = Map(tmp_path / "map.zarr")
    assert not begun.finished
    assert repr(begun).endswith("unfinished")
    rest = counted(fake_fits.fit)
    made = mapped(fit=rest)
    assert rest.blocks == 24 - 7 + 1
    assert made.run.pixels + made.run.earlier == 45 * 32
    same_files(whole.path, made.path)


def test_a_block_that_was_being_written_is_written_again(mapped, same_files, monkeypatch):
    whole = mapped("whole.zarr")
    write = zarr.Array.__setitem__

    def die(array, where, values):
        if array.name == "/rms":
            raise Killed
        write(array, where, values)

    monkeypatch.setattr(zarr.Array, "__setitem__", die)
    with pytest.raises(Killed):
        mapped()
    monkeypatch.undo()
    stray = whole.path.parent / "map.zarr/thickness/c/0/0.00ff.partial"
    stray.write_bytes(b"half")  # as zarr leaves it where the process is killed while it writes
    monkeypatch.setattr("pellicle.mapping.store.PIXELS", 64)
    same_files(whole.path, mapped().path)


def test_a_finished_map_is_not_fitted_again(mapped, fake_fits, refuses):
    mapped()
    again = counted(fake_fits.fit)
    made = mapped(fit=again)
    assert again.blocks == 0
    assert (made.run.pixels, made.run.earlier) == (0, 45 * 32)
    refuses(UsageError, "exists; leave `resume=False` out", mapped, resume=False)


@pytest.mark.slow
def test_another_input_scene_or_option_is_not_mixed_in(mapped, cube, refuses):
    mapped()
    other = dataclasses.replace(cube, arrays={"values": cube.arrays["values"] + 1e-9})
    masked = dataclasses.replace(cube, mask=None)
    scene = pl.Scene(pl.Layer(1.46, pl.Free(10, 801)), 3.9)
    for word, changes in {
        "is of another input": {"the_cube": other},
        "is of another scene": {"the_scene": scene},
    }.items():
        refuses(UsageError, rf"{word}.*`overwrite=True`", mapped, **changes)
    refuses(UsageError, "another input", mapped, the_cube=masked)
    assert mapped(the_cube=other, overwrite=True).run.pixels == 45 * 32


@pytest.mark.slow
def test_a_map_that_another_run_writes_is_left_alone(mapped, fake_fits):
    """The run is within its first block; the other one would remove its store."""

    def meanwhile(model, cube, where):
        with pytest.raises(UsageError, match="another run is writing there"):
            mapped(fit=fake_fits.refusing, overwrite=True)
        return fake_fits.fit(model, cube, where)

    assert mapped(fit=meanwhile).finished
    assert mapped(overwrite=True).finished


def test_a_full_disk_is_one_sentence_and_loses_nothing(mapped, same_files, monkeypatch, refuses):
    whole, write, blocks = mapped("whole.zarr"), zarr.Array.__setitem__, itertools.count()

    def full(array, where, values):
        if array.name == "/rms" and next(blocks) == 5:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "c/0/0")
        write(array, where, values)

    monkeypatch.setattr(zarr.Array, "__setitem__", full)
    refuses(DataError, r"map.zarr: cannot be written \(No space left.*make room", mapped)
    monkeypatch.setattr(zarr.Array, "__setitem__", write)
    same_files(whole.path, mapped().path)


def test_files_of_a_user_stay(mapped, tmp_path, refuses):
    (tmp_path / "notes").mkdir()
    (tmp_path / "notes/notes.txt").write_text("mine")
    zarr.create_group(tmp_path / "group.zarr", attributes={"title": "mine"})
    for name in ("notes", "group.zarr"):
        refuses(UsageError, "is no map of pellicle", mapped, name, overwrite=True)
    refuses(DataError, "holds no map", Map, tmp_path / "group.zarr")


def test_a_cube_with_a_fingerprint_is_not_read_for_it(mapped, cube):
    class Counting:
        shape, dtype = cube.arrays["values"].shape, np.dtype(float)
        values = 0

        def __getitem__(self, where):
            found = cube.arrays["values"][where]
            self.values += found.size
            return found

    counting = Counting()
    named = dataclasses.replace(cube, arrays={"values": counting}, fingerprint="sha256:1")
    mapped(the_cube=named)
    whole = cube.arrays["values"].size
    assert whole <= counting.values < 1.1 * whole  # each block once, and a few examples


def test_sites_of_a_table_have_their_coordinates(mapped, cube):
    coords = {"site": np.array([f"die {i}" for i in range(45)]), "x": np.arange(45.0), "y": np.zeros(45)}
    line = {"values": cube.arrays["values"][:, 0]}
    made = mapped(the_cube=dataclasses.replace(cube, arrays=line, dims=("site",), coords=coords, mask=None))
    assert set(made.dataset.coords) == {"site", "x", "y"}
    assert made.dataset.x.dims == ("site",)
    assert str(made.dataset.site.values[3]) == "die 3"
    made.to_netcdf(made.path.with_name("sites.nc"))


def test_without_zarr_the_message_names_the_extra(monkeypatch, tmp_path, refuses):
    """`pl.Map` loads without the packages of the extra `maps`, as every public name does."""
    monkeypatch.setitem(sys.modules, "zarr", None)
    refuses(UsageError, r"need zarr: pip install 'pellicle\[maps\]'", Map, tmp_path / "map.zarr")


@pytest.mark.slow
def test_a_map_is_reported_drawn_and_saved(cube, scene, fake_fits, tmp_path):
    made = run_map(cube, scene, tmp_path / "map.zarr", fit=fake_fits.fit)
    text = pl.report(made)
    assert text == made.report() == cube_report(made)
    assert "100 % converged." in text
    assert "no data  2 pixels (0.1 %) at x = 5, y = 1.5 mm and at x = 7, y = 3.5 mm" in text
    assert "read     percent" in text
    assert "pixels/s" in text
    assert "dispersion" not in text.split("left out")[0].split("[[Plan")[1]
    assert len(made.plot().axes) >= 4
    made.save(tmp_path / "out")
    assert {path.name for path in (tmp_path / "out").iterdir()} == {
        *("result.json", "report.txt", "report.html", "map.png", "rival.png")
    }
    record = json.loads((tmp_path / "out" / "result.json").read_text())
    assert record["schema"] == "pellicle.cube-map/1"
    assert record["status"] == {"converged": 45 * 32 - 2, "no-data": 2}
    assert {row["effect"] for row in record["plan"]} > {"absorption", "dispersion"}


@pytest.mark.slow
def test_arrays_of_a_map_in_a_temporary_folder_outlive_it(cube, scene, fake_fits, monkeypatch):
    """Zarr takes a chunk whose file is absent as one without values, and says nothing."""
    monkeypatch.setattr("pellicle.mapping.run.fit_pixels", fake_fits.fit)
    monkeypatch.setattr("pellicle.mapping.run.bands_off", lambda model, cube: [])
    dataset = pl.map(cube, scene).dataset
    gc.collect()
    assert int((dataset["status"] == CODES["converged"]).sum()) == 45 * 32 - 2


def test_two_runs_that_replace_a_map_at_once_do_not_share_its_store(mapped, fake_fits, monkeypatch, refuses):
    """The second run comes while the first has removed the old store and not made the new one."""
    mapped()
    begin = run.begin

    def meanwhile(*arguments, **options):
        refuses(UsageError, "another run is writing there", mapped, fit=fake_fits.refusing, overwrite=True)
        return begin(*arguments, **options)

    monkeypatch.setattr(run, "begin", meanwhile)
    made = mapped(overwrite=True)
    assert made.finished
    assert not list(made.path.parent.glob(".*"))  # the lock is removed


@pytest.mark.skipif(os.name == "nt", reason="is tried by the test above")
def test_a_place_is_held_without_fcntl(monkeypatch, tmp_path, refuses):
    """As on Windows: another module locks, with another error, and no open file can be removed."""
    import fcntl

    class Msvcrt:
        LK_NBLCK = 2

        @staticmethod
        def locking(handle, mode, count):
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise PermissionError(13, "Permission denied") from None

    unlink, opened, close = Path.unlink, set(), os.close

    def refused(path, **options):
        if opened:
            raise PermissionError(13, "used by another process")
        unlink(path, **options)

    monkeypatch.setitem(sys.modules, "msvcrt", Msvcrt)
    monkeypatch.setitem(sys.modules, "fcntl", None)
    monkeypatch.setattr(Path, "unlink", refused)
    monkeypatch.setattr(os, "close", lambda handle: (close(handle), opened.clear()))
    with held(tmp_path / "map.zarr"):
        refuses(UsageError, "another run is writing there", held(tmp_path / "map.zarr").__enter__)
        opened.add("lock")
    assert not list(tmp_path.iterdir())


def test_threads_write_stores_without_a_warning(tmp_path, monkeypatch):
    """Threads share the filters of warnings; those of the tests turn each warning into an error."""
    consolidate, ends = zarr.consolidate_metadata, iter([0.2, 0.4])

    def slow(*arguments, **named):
        sleep(next(ends))  # the second thread is inside when the first leaves
        return consolidate(*arguments, **named)

    monkeypatch.setattr(zarr, "consolidate_metadata", slow)
    dataset = xarray.Dataset({"a": ("x", np.arange(3.0))})
    with ThreadPoolExecutor() as threads:
        list(threads.map(lambda name: write_dataset(tmp_path / name, dataset), ["a.zarr", "b.zarr"]))
