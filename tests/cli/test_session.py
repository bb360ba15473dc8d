"""Ctrl-C, SIGTERM, and fits of several files in worker processes."""

import gc
import os
import re
import signal
import subprocess
import sys
import time
from concurrent.futures import BrokenExecutor
from pathlib import Path

import pytest

from pellicle.cli.session import in_order, interruptible


class _Callback:
    """Python ignores what is raised in `__del__`, as in JAX's callback of the garbage collector."""

    def __init__(self):
        self.itself = self

    def __del__(self):
        os.kill(os.getpid(), signal.SIGINT)
        for _ in range(1000):  # the signal is handled here
            pass


def _interrupted_in_a_callback():
    _Callback()
    gc.collect(0)  # the youngest objects; all of them take seconds
    time.sleep(20)


def _terminated():
    os.kill(os.getpid(), signal.SIGTERM)
    time.sleep(20)


def test_ctrl_c_in_a_callback_is_not_lost():
    before = sys.unraisablehook
    with pytest.raises(KeyboardInterrupt), interruptible():
        _interrupted_in_a_callback()
    assert sys.unraisablehook is before


@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
def test_sigterm_is_as_ctrl_c():
    before = signal.getsignal(signal.SIGTERM)
    with pytest.raises(KeyboardInterrupt), interruptible():
        _terminated()
    assert signal.getsignal(signal.SIGTERM) == before


@pytest.fixture(autouse=True)
def no_cache(monkeypatch):
    monkeypatch.setenv("PELLICLE_CACHE", "off")


def flat(record, path=""):
    """Every value of a JSON object by its path."""
    if isinstance(record, dict | list):
        items = record.items() if isinstance(record, dict) else enumerate(record)
        return {k: v for key, each in items for k, v in flat(each, f"{path}/{key}").items()}
    return {path: record}


def _slowest_first(seconds):
    time.sleep(seconds)
    return seconds, os.environ["NPROC"], os.getpid()


@pytest.mark.slow
def test_results_come_in_order_from_several_processes():
    before = dict(os.environ)
    results = list(in_order(_slowest_first, [4.0, 0.0, 0.1], 2))
    assert [task for task, *_ in results] == [4.0, 0.0, 0.1]
    assert {threads for _, threads, _ in results} == {"1"}
    assert len({process for *_, process in results}) == 2
    assert os.getpid() not in {process for *_, process in results}
    assert dict(os.environ) == before


def _dies_at_two(task):
    if task == 2:
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(60)
    return task


def test_a_dead_worker_is_an_error_after_the_finished_results():
    results = in_order(_dies_at_two, range(5), 1)
    assert [next(results), next(results)] == [0, 1]
    with pytest.raises(BrokenExecutor):
        next(results)


def _interrupts_its_parent(task):
    if task == 1:
        for process in (os.getppid(), os.getpid()):  # as a terminal does
            os.kill(process, signal.SIGINT)
        time.sleep(60)
    return task


def test_after_ctrl_c_finished_results_are_kept_and_no_task_is_begun():
    began, results = time.monotonic(), in_order(_interrupts_its_parent, range(5), 1)
    assert next(results) == 0
    with pytest.raises(KeyboardInterrupt):
        next(results)
    assert time.monotonic() - began < 50  # nobody waits for the sleeper


_PARENT = """
import os, sys, time
from pellicle.cli.session import in_order

if __name__ == "__main__":
    for process in in_order(sleeper.process, range(4), 2):
        print(process, flush=True)
"""
_SLEEPER = """
import os, time

def process(task):
    time.sleep(60 * (task > 1))
    return os.getpid()
"""


@pytest.mark.slow  # starts processes
@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
def test_workers_end_with_a_parent_that_is_killed(tmp_path):
    (tmp_path / "sleeper.py").write_text(_SLEEPER)
    (tmp_path / "parent.py").write_text("import sleeper\n" + _PARENT)
    parent = subprocess.Popen([sys.executable, tmp_path / "parent.py"], stdout=subprocess.PIPE, text=True)
    with parent, parent.stdout or pytest.fail("no pipe") as printed:
        workers = {int(printed.readline()) for _ in range(2)}
        parent.kill()
    deadline = time.monotonic() + 30  # seconds, of the 60 that they would sleep
    while running := [process for process in workers if _runs(process)]:
        assert time.monotonic() < deadline, running
        time.sleep(0.1)


def _runs(process):
    """True unless the process has ended, or waits for somebody to ask how."""
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    status = Path(f"/proc/{process}/stat")
    return not (status.exists() and status.read_text().rpartition(")")[2].split()[0] == "Z")


@pytest.mark.slow
def test_two_processes_find_what_one_finds(pellicle, spectrum_file, scene, tmp_path):
    one, two, gone = spectrum_file("one.csv", 250.0), spectrum_file("two.csv", 420.0), tmp_path / "gone.csv"
    arguments = ("fit", one, gone, two, *scene, "--json", "--out")
    together = pellicle(*arguments, tmp_path / "b", "--jobs", "2")
    alone = pellicle(*arguments, tmp_path / "a")
    assert together.code == alone.code == 3
    for ran in (together, alone):
        assert [found["data"]["path"] for found in ran.objects] == [str(one), str(gone), str(two)]
    for a, b in zip(alone.objects, together.objects, strict=True):
        # one of the processes compiles earlier, and one with fewer threads adds in another order
        pairs = [flat(x | {"seconds": None}) for x in (a, b)]
        assert pairs[0].keys() == pairs[1].keys()
        for key, one_value in pairs[0].items():
            # effects that nearly imitate each other share an error: a part moves by 8e-6 (found)
            near = {"rel": 5e-5, "abs": 1e-7} if key.startswith("/budget") else {"rel": 1e-6, "abs": 1e-9}
            exact = not isinstance(one_value, float)
            assert one_value == (pairs[1][key] if exact else pytest.approx(pairs[1][key], **near)), key
    talk = [line for line in alone.err.splitlines() if "written" not in line]
    assert [line for line in together.err.splitlines() if "written" not in line] == talk
    a, b = (re.split("[,\n]", (tmp_path / name / "summary.csv").read_text()) for name in "ab")
    for cell, other in zip(a, b, strict=True):
        assert cell == other or float(cell) == pytest.approx(float(other), rel=1e-6)
    assert (tmp_path / "b" / "two" / "figure.png").exists()


def test_a_worker_that_dies_is_one_sentence(pellicle, spectrum_file, scene, monkeypatch):
    def dies(function, tasks, workers):
        raise BrokenExecutor
        yield

    monkeypatch.setattr("pellicle.cli.session.in_order", dies)
    pellicle("fit", spectrum_file(), spectrum_file("b.csv"), *scene, "--jobs", "2").refused(
        3, "worker process", "0 of 2 files", "--jobs"
    )


def test_no_worker_for_a_single_file(pellicle, tmp_path, scene, monkeypatch):
    monkeypatch.delattr("pellicle.cli.session.in_order")
    assert pellicle("fit", tmp_path / "gone.csv", *scene, "--jobs", "2").code == 3


def test_jobs_are_at_least_one(pellicle, scene):
    pellicle("fit", "oxide.csv", *scene, "--jobs", "0").refused(2, "--jobs")
