"""Maps by worker processes, and maps that are killed: equal to undisturbed maps of one process."""

import dataclasses
import os
import pickle
import subprocess
import sys
import time

import dask.array
import numpy as np
import pytest
import xarray
from distributed import Client, LocalCluster

from pellicle.errors import DataError, UsageError
from pellicle.mapping.cluster import local_cluster
from pellicle.mapping.map_result import Map
from pellicle.mapping.run import run_map


@pytest.fixture(scope="module")
def workers():
    """Address of a scheduler with two worker processes here; this process keeps its environment."""
    before = dict(os.environ)
    with local_cluster(2) as client:
        yield client.scheduler.address
    changed = {x for x in {*before, *os.environ} if before.get(x) != os.environ.get(x)}
    assert not changed - {"PYTEST_CURRENT_TEST"}


@pytest.mark.slow  # starts workers and kills one
@pytest.mark.usefixtures("small_blocks")
def test_a_worker_that_dies_loses_nothing(workers, cube, scene, fake_fits, tmp_path):
    """The process that fits the brightest corner is killed; a cube in memory goes there by blocks."""
    whole = run_map(cube, scene, tmp_path / "whole.zarr", fit=fake_fits.fit)
    steps = []
    marked = dataclasses.replace(cube, path=str(tmp_path / "died"))
    cluster = {"scheduler": workers, "progress": lambda stage, done, total: steps.append(done)}
    made = run_map(marked, scene, tmp_path / "map.zarr", fit=fake_fits.dying, **cluster)
    assert (tmp_path / "died").exists()
    assert steps == sorted(steps)
    assert (steps[0], steps[-1]) == (0, 45 * 32)
    xarray.testing.assert_equal(made.dataset.compute(), whole.dataset.compute())
    assert made.dataset.attrs["path"] != whole.dataset.attrs["path"]


@pytest.mark.slow  # starts worker processes
@pytest.mark.usefixtures("small_blocks")
def test_workers_read_a_cube_on_disk_themselves(workers, cube, scene, fake_fits, same_files, tmp_path):
    values = tmp_path / "cube.npy"
    np.save(values, cube.arrays["values"])
    shape = (45, 32, 20)
    on_disk = dataclasses.replace(cube, arrays={"values": fake_fits.OnDisk(values, shape)})
    here = run_map(on_disk, scene, tmp_path / "here.zarr", fit=fake_fits.fit)
    there = run_map(on_disk, scene, tmp_path / "there.zarr", scheduler=workers, fit=fake_fits.fit)
    same_files(here.path, there.path)
    assert here.run is not None
    assert there.run is not None
    assert here.run.workers == 1
    assert there.run.workers <= 2  # processes, not blocks
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


@pytest.mark.slow  # starts worker processes
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


TIME_OUT = 120.0

PROGRAM = """
import sys
import fake_fits
from pellicle.mapping import store as stores
from pellicle.mapping.run import run_map

if __name__ == "__main__":
    stores.PIXELS = 64
    cube, scene, store, workers = fake_fits.load(sys.argv[1])
    run_map(cube, scene, store, workers=workers, fit=fake_fits.slow)
"""


@pytest.fixture
def start(cube, scene, fake_fits, tmp_path, write):
    """Starts a process that maps the cube into a store, 20 ms a block."""
    program = write(PROGRAM, "program.py")

    def start(store, workers=1):
        fake_fits.save(tmp_path / "job", (cube, scene, store, workers))
        paths = [os.path.dirname(fake_fits.__file__), *sys.path]
        environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, paths))}
        return subprocess.Popen([sys.executable, program, tmp_path / "job"], env=environment)

    return start


def wait_for(condition):
    end = time.monotonic() + TIME_OUT
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.002)


def finished_blocks(store):
    return sum(len(files) for _, _, files in os.walk(store / "progress/done/c"))


@pytest.mark.slow
@pytest.mark.usefixtures("small_blocks")
@pytest.mark.parametrize(("kills", "workers"), [(5, 1), (2, 2)])
def test_kills_at_random_moments_change_nothing(
    start, cube, scene, fake_fits, same_files, tmp_path, kills, workers
):
    scene = pickle.loads(
        pickle.dumps(scene)
    )  # as the process has it: a scene prints its defaults by identity
    whole = run_map(cube, scene, tmp_path / "whole.zarr", fit=fake_fits.fit)
    store, random = tmp_path / "map.zarr", np.random.default_rng(0)
    for kill in range(kills):
        before = finished_blocks(store)
        process = start(store, workers)
        # after the first block of this run, as the start takes most of the time, and before the last
        wait_for(lambda: finished_blocks(store) > before or process.poll() is not None)  # noqa: B023
        time.sleep(random.uniform(0, 0.5 * (24 - before) / (kills - kill) * 0.03))
        process.kill()
        process.wait()
        done = finished_blocks(store)
        assert before < done <= 24
        assert Map(store).finished == (done == 24)
    made = run_map(cube, scene, store, fit=fake_fits.fit)
    assert made.finished
    same_files(whole.path, made.path)
