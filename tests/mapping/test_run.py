"""Maps by worker processes of a dask cluster: equal to maps of one process, whatever happens to them."""

import dataclasses
import os

import dask.array
import numpy as np
import pytest
import xarray
from distributed import Client, LocalCluster

from pellicle.errors import DataError, UsageError
from pellicle.mapping.cluster import local_cluster
from pellicle.mapping.run import run_map


@pytest.fixture(scope="module")
def workers():
    """Address of a scheduler with two worker processes here; this process keeps its environment."""
    before = dict(os.environ)
    with local_cluster(2) as client:
        yield client.scheduler.address
    changed = {x for x in {*before, *os.environ} if before.get(x) != os.environ.get(x)}
    assert not changed - {"PYTEST_CURRENT_TEST"}


@pytest.mark.slow  # starts workers and kills one; test_killed_runs.py kills a run without workers
@pytest.mark.usefixtures("small_blocks")
def test_a_worker_that_dies_loses_nothing(workers, cube, scene, fake_fits, tmp_path):
    """The process that fits the brightest corner is killed; a cube in memory goes there by blocks."""
    whole = run_map(cube, scene, tmp_path / "whole.zarr", fit=fake_fits.fit)
    steps = []
    marked = dataclasses.replace(cube, path=str(tmp_path / "died"))
    made = run_map(
        marked,
        scene,
        tmp_path / "map.zarr",
        scheduler=workers,
        fit=fake_fits.dying,
        progress=lambda stage, done, total: steps.append(done),
    )
    assert (tmp_path / "died").exists()
    assert steps == sorted(steps)
    assert (steps[0], steps[-1]) == (0, 45 * 32)
    xarray.testing.assert_equal(made.dataset.compute(), whole.dataset.compute())
    assert made.dataset.attrs["path"] != whole.dataset.attrs["path"]


@pytest.mark.usefixtures("small_blocks")
def test_workers_read_a_cube_on_disk_themselves(workers, cube, scene, fake_fits, same_files, tmp_path):
    values = tmp_path / "cube.npy"
    np.save(values, cube.arrays["values"])
    shape = (45, 32, 20)
    on_disk = dataclasses.replace(cube, arrays={"values": fake_fits.OnDisk(values, shape)})
    here = run_map(on_disk, scene, tmp_path / "here.zarr", fit=fake_fits.fit)
    there = run_map(on_disk, scene, tmp_path / "there.zarr", scheduler=workers, fit=fake_fits.fit)
    same_files(here.path, there.path)
    mean = 1000 * np.where(cube.mask[..., None], cube.arrays["values"], np.nan).mean(axis=2)
    np.testing.assert_allclose(there.thickness, mean)


@pytest.mark.slow  # starts worker processes
@pytest.mark.usefixtures("small_blocks")
def test_a_large_cube_in_memory_is_sent_by_blocks(
    workers, cube, scene, fake_fits, same_files, tmp_path, monkeypatch
):
    monkeypatch.setattr("pellicle.mapping.cluster.LARGEST", 1000)
    lazy = dataclasses.replace(cube, arrays={"values": dask.array.from_array(cube.arrays["values"])})
    for name, own in {"array": cube, "dask": lazy}.items():
        here = run_map(own, scene, tmp_path / f"{name}-here.zarr", fit=fake_fits.fit)
        there = run_map(own, scene, tmp_path / f"{name}-there.zarr", scheduler=workers, fit=fake_fits.fit)
        same_files(here.path, there.path)


def test_an_error_of_a_fit_comes_back_as_it_is(workers, cube, scene, fake_fits, tmp_path):
    with pytest.raises(UsageError, match="no such pixel"):
        run_map(cube, scene, tmp_path / "map.zarr", scheduler=workers, fit=fake_fits.refusing)


@pytest.mark.slow
@pytest.mark.usefixtures("small_blocks")
def test_pixels_that_end_every_worker_are_an_error(cube, scene, fake_fits, tmp_path):
    with pytest.raises(DataError, match="fewer `workers`"):
        run_map(cube, scene, tmp_path / "map.zarr", workers=2, fit=fake_fits.deadly)


@pytest.mark.slow
@pytest.mark.usefixtures("small_blocks")
def test_workers_that_do_not_come_back_are_an_error(cube, scene, fake_fits, tmp_path, monkeypatch):
    monkeypatch.setattr("pellicle.mapping.cluster.WAIT", 0.1)
    monkeypatch.setattr(Client, "wait_for_workers", lambda *_, **__: None)  # there was one
    with (
        LocalCluster(n_workers=0, processes=False, dashboard_address=":0") as cluster,
        pytest.raises(DataError, match="all worker processes have ended"),
    ):
        run_map(cube, scene, tmp_path / "map.zarr", scheduler=cluster.scheduler_address, fit=fake_fits.deadly)


@pytest.mark.slow
def test_a_scheduler_that_is_not_there(cube, scene, tmp_path, monkeypatch):
    monkeypatch.setattr("pellicle.mapping.cluster.ANSWER", 0.2)
    with pytest.raises(UsageError, match="no dask scheduler answers at tcp://"):
        run_map(cube, scene, tmp_path / "map.zarr", scheduler="tcp://127.0.0.1:1")
