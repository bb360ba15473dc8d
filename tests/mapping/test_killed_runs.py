"""Maps whose process is killed at random moments: the final store is that of an undisturbed run."""

import os
import pickle
import subprocess
import sys
import time

import numpy as np
import pytest

from pellicle.mapping.map_result import Map
from pellicle.mapping.run import run_map

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
