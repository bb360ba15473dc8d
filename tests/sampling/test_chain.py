"""Chains on disk: resumed after a kill as if nothing had happened, and refused where they do not belong."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import jax
import numpy as np
import pytest

import pellicle as pl
from pellicle.errors import DataError, UsageError
from pellicle.fitting.progress import quiet
from pellicle.reporting.posterior import write_netcdf
from pellicle.sampling.chain import empty
from pellicle.sampling.density import Modes, Target
from pellicle.sampling.sample import run

HERE = Path(__file__).parent
RUN = """
import runpy, jax
jax.config.update("jax_enable_x64", True)
import pellicle
from pellicle.sampling import chain
chain.LONG_ENOUGH = 1e9  # to the last step
chain._PATIENCE = 0.0
example = runpy.run_path({example!r})
pellicle.sample(example["bands"](), example["film"](), steps=10**6, chain={path!r})
"""


@pytest.mark.slow
def test_a_killed_chain_goes_on_as_if_nothing_had_happened(bands, film, tmp_path, monkeypatch):
    """A real process, killed without warning while it samples, against one that was left alone."""
    path = tmp_path / "chain.h5"
    code = RUN.format(example=str(HERE / "conftest.py"), path=str(path))
    cache = {"JAX_COMPILATION_CACHE_DIR": str(jax.config.jax_compilation_cache_dir)}
    process = subprocess.Popen([sys.executable, "-c", code], env={**os.environ, **cache})
    deadline = time.monotonic() + 120
    while not path.exists() and time.monotonic() < deadline:
        time.sleep(0.05)
    time.sleep(0.2)
    process.send_signal(signal.SIGKILL)
    assert process.wait() == -signal.SIGKILL
    before = _draws(path)
    monkeypatch.setattr("pellicle.sampling.chain.LONG_ENOUGH", 1e9)
    steps = len(before) + 150
    resumed = pl.sample(bands(), film(), steps=steps, chain=path)
    whole = pl.sample(bands(), film(), steps=steps)
    after = _draws(path)
    assert len(after) == steps
    np.testing.assert_array_equal(after[: len(before)], before)
    np.testing.assert_array_equal(resumed.draws, whole.draws)


def _draws(path: os.PathLike[str]) -> np.ndarray:
    """By emcee's own reader: the file is one of its kind."""
    from emcee.backends import HDFBackend

    return HDFBackend(str(path), read_only=True).get_chain()


@pytest.fixture(scope="module")
def kept(bands, film, tmp_path_factory):
    path = tmp_path_factory.mktemp("chain") / "chain.h5"
    pl.sample(bands(), film(), chain=path)
    return path


@pytest.mark.parametrize(
    ("data", "scene"),
    [({"seed": 4}, {}), ({}, {"upper": 1400.0}), ({}, {"prior": pl.priors.Normal(600.0, 200.0)})],
    ids=["data", "bounds", "prior"],
)
def test_a_chain_of_another_problem_is_refused(bands, film, kept, data, scene, refuses):
    before = kept.read_bytes()
    refuses(DataError, "is the chain of another problem", pl.sample, bands(**data), film(**scene), chain=kept)
    assert kept.read_bytes() == before


def test_other_walkers_and_what_is_no_chain_are_refused(bands, film, kept, write, refuses):
    refuses(UsageError, "is a chain of 32 walkers", pl.sample, bands(), film(), walkers=40, chain=kept)
    path = write("notes of mine", "chain.h5")
    refuses(DataError, "is no chain that pellicle wrote", pl.sample, bands(), film(), chain=path)
    assert path.read_text() == "notes of mine"


def test_an_interrupted_chain_keeps_what_it_has(bands, film, tmp_path):
    def impatient(what, done, total):
        if what == "sample" and done >= 200:
            raise KeyboardInterrupt

    path = tmp_path / "chain.h5"
    found = pl.sample(bands(), film(), chain=path, progress=impatient)
    assert found.checks.steps == 200
    assert len(_draws(path)) == 200


def test_an_interrupted_density_prints_nothing(capfd):
    """stdout is the result's."""
    one = Modes(np.array([[0.5]]), np.array([[[0.1]]]), np.array([1.0]))
    calls = iter(range(10))

    def density(units: np.ndarray) -> np.ndarray:
        if next(calls):
            raise KeyboardInterrupt
        return np.zeros(len(units))

    with pytest.raises(KeyboardInterrupt):
        run(Target(density, 8), one, empty(8, 1, 0), 100, lambda chain: None, quiet)
    assert capfd.readouterr().out == ""


@pytest.mark.filterwarnings("ignore:Error writing persistent compilation cache")
def test_a_full_disk_ends_neither_the_chain_nor_python(bands, film, tmp_path, caplog):
    resource = pytest.importorskip("resource")
    before, path = resource.getrlimit(resource.RLIMIT_FSIZE), tmp_path / "chain.h5"
    resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, before[1]))
    try:
        found = pl.sample(bands(), film(), chain=path)
        with pytest.raises(DataError, match=r"posterior\.nc: cannot be written \(File too large\)"):
            write_netcdf(tmp_path / "posterior.nc", found, found.predictions())
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert found.trusted
    assert "chain.h5: cannot be written (File too large)" in caplog.text
    assert not list(tmp_path.iterdir())


def test_a_chain_with_fewer_steps_than_walkers_is_written_without_a_warning(bands, film, tmp_path):
    found = pl.sample(bands(), film(), steps=10)
    assert found.draws.shape[0] < found.draws.shape[1]
    assert write_netcdf(tmp_path / "posterior.nc", found, found.predictions()).exists()
