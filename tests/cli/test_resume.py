"""Batches that are killed, or whose disk is full: nothing finished is lost, and nothing is fitted twice."""

import csv
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from pellicle.api import fits
from pellicle.cli.batch import fingerprint
from pellicle.dispersion import Cauchy
from pellicle.scene.film import Scene
from pellicle.scene.free import Free
from pellicle.scene.layers import Layer


class Fitted:
    """Counts real fits, by the names of their files; that of a name in `stop` raises."""

    def __init__(self, real):
        self.real, self.names, self.stop = real, [], {}

    def fit(self, data, scene, **options):
        name = Path(data.path).stem
        if name in self.stop:
            raise self.stop.pop(name)
        self.names.append(name)
        return self.real(data, scene, **options)

    def __call__(self):
        """The names since the last call."""
        names, self.names = self.names, []
        return names


@pytest.fixture
def fitted(monkeypatch):
    counter = Fitted(fits.fit)
    monkeypatch.setattr(fits, "fit", counter.fit)
    return counter


@pytest.fixture
def batch(pellicle, spectrum_file, scene, tmp_path):
    """Fits two files into one folder."""
    files = [spectrum_file(f"{name}.csv", nm) for name, nm in (("a", 450.0), ("b", 300.0))]

    def run(*more, flags=scene):
        return pellicle("fit", *files, *flags, "--json", "--out", tmp_path / "out", *more)

    return run


def rows(tmp_path):
    """The summary by file name."""
    lines = (tmp_path / "out" / "summary.csv").read_text("utf-8-sig").splitlines()
    return {Path(row["path"]).stem: row for row in csv.DictReader(lines)}


def test_a_batch_goes_on_where_it_was_interrupted(batch, fitted, tmp_path):
    fitted.stop["b"] = KeyboardInterrupt()
    ran = batch()
    assert (ran.code, fitted()) == (130, ["a"])
    assert "interrupted after 1 of 2 files; finished results are kept: the same command" in ran.err
    assert list(rows(tmp_path)) == ["a"]
    first = (tmp_path / "out" / "a" / "figure.png").stat().st_mtime_ns
    again = batch()
    assert (again.code, fitted()) == (0, ["b"])
    assert "1 of 2 files were not fitted again" in again.err
    assert again.objects[0] == ran.objects[0]
    assert (tmp_path / "out" / "a" / "figure.png").stat().st_mtime_ns == first
    assert [float(row["thickness"]) for row in rows(tmp_path).values()] == pytest.approx([450, 300], abs=3)


def test_the_report_and_the_code_of_an_earlier_run_are_repeated(batch, fitted, scene):
    # the true 300 nm of b lie below all that is allowed: its best value is at a bound, code 4
    flags = (*scene[:-1], "300.3:800")
    first = batch(flags=flags)
    assert (first.code, len(fitted())) == (4, 2)
    again = batch(flags=flags)
    assert (again.code, again.out, fitted()) == (4, first.out, [])


@pytest.mark.slow
def test_what_changed_is_fitted_again(batch, fitted, scene, tmp_path):
    assert batch().code == 0
    assert batch().code == 0
    assert fitted() == ["a", "b"]
    text = (tmp_path / "b.csv").read_text()
    (tmp_path / "b.csv").write_text(text.replace("400,0.", "400,0.0", 1))
    batch()
    assert fitted() == ["b"]
    batch(flags=(*scene[:-1], "10:700"))
    assert fitted() == ["a", "b"]
    batch("--refit", flags=(*scene[:-1], "10:700"))
    assert fitted() == ["a", "b"]
    marker = tmp_path / "out" / "b" / "result.json"
    marker.write_text(marker.read_text()[:500])  # as a power failure may leave it
    batch(flags=(*scene[:-1], "10:700"))
    assert fitted() == ["b"]


@pytest.mark.slow
def test_worker_processes_go_on_too(batch, fitted, monkeypatch, tmp_path):
    # in this process: test_session.py starts others
    monkeypatch.setattr("pellicle.cli.session.in_order", lambda function, tasks, jobs: map(function, tasks))
    fitted.stop["b"] = ValueError("b is bad")
    first = batch("--jobs", "2")
    assert (first.code, fitted()) == (3, ["a"])
    again = batch("--jobs", "2")
    assert (again.code, fitted()) == (0, ["b"])
    assert "1 of 2 files were not fitted again" in again.err
    assert list(rows(tmp_path)) == ["a", "b"]


@pytest.mark.slow
def test_processes_share_a_batch_that_takes_long(
    pellicle, spectrum_file, scene, fitted, monkeypatch, tmp_path
):
    # where more than nothing is left after two files, the first of which compiles
    monkeypatch.setattr("pellicle.cli.batch.workers_for", lambda seconds: 2 if seconds > 0 else 1)
    shared = []

    def in_order(function, tasks, workers):
        tasks = list(tasks)
        shared.append((len(tasks), workers))
        return map(function, tasks)

    monkeypatch.setattr("pellicle.cli.session.in_order", in_order)
    files = [spectrum_file(f"{name}.csv", 300.0) for name in "abcd"]
    command = ("fit", *files, *scene, "--json", "--out", tmp_path / "out")
    first = pellicle(*command)
    assert (first.code, shared, fitted()) == (0, [(2, 2)], list("abcd"))
    assert [Path(x["data"]["path"]).stem for x in first.objects] == list("abcd") == list(rows(tmp_path))
    again = pellicle(*command)
    assert (again.objects, fitted()) == (first.objects, [])
    assert "4 of 4 files were not fitted again" in again.err


@pytest.fixture
def small_files():
    """No file may be larger than 20 kB, as on a disk that is nearly full: figures are, reports are not."""
    resource = pytest.importorskip("resource")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, before[1]))
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.fixture
def full(request):
    """Fills the disk when it is called, until the end of the test."""
    return lambda: request.getfixturevalue("small_files")


@pytest.mark.slow
def test_a_full_disk_costs_no_result(batch, full, fitted, tmp_path):
    full()
    ran = batch()
    complaints = [line for line in ran.err.splitlines() if line.startswith("pellicle: ")]
    assert (ran.code, [x["status"] for x in ran.objects]) == (3, ["converged"] * 2)
    names = "a/figure.png", "b/figure.png", "out/report.html"
    for name, complaint in zip(names, complaints, strict=True):
        assert f"{name}: cannot be written (File too large); make room" in complaint.replace(os.sep, "/")
    assert "Traceback" not in ran.err
    assert list(rows(tmp_path)) == ["a", "b"]
    assert not list((tmp_path / "out").rglob(".*"))  # no temporary files


@pytest.mark.slow
def test_results_without_all_their_files_are_computed_again(batch, full, fitted, tmp_path, request):
    full()
    assert batch().code == 3
    assert len(fitted()) == 2
    import resource

    resource.setrlimit(resource.RLIMIT_FSIZE, (-1, resource.getrlimit(resource.RLIMIT_FSIZE)[1]))
    assert batch().code == 0
    assert len(fitted()) == 2
    assert (tmp_path / "out" / "b" / "figure.png").exists()


@pytest.mark.slow
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="a device of Linux")
def test_results_that_cannot_be_printed():
    with open("/dev/full", "w") as full_disk:
        code = "from pellicle.cli import main; raise SystemExit(main())"
        command = [sys.executable, "-c", code, "materials"]
        ran = subprocess.run(command, stdout=full_disk, stderr=subprocess.PIPE, text=True)
    assert ran.returncode == 3
    assert ran.stderr == "pellicle: the result cannot be printed (No space left on device)\n"


def test_a_fingerprint_covers_bounds_tables_settings_and_version(monkeypatch):
    def scene(upper=100.0, name="SiO2", index=1.45):
        return Scene(Layer(Cauchy(index, 3000.0), Free(1.0, upper)), name)

    table = np.linspace(0, 1, 1000)
    other = table.copy()
    other[500] += 1e-12
    scenes = [scene(), scene(200.0), scene(name="Si"), scene(index=1.46)]
    others = [(scene(), 1e-4), (table,), (other,), (("ab", "c"),), (("a", "bc"),), (("a",), "bc")]
    known = [*map(fingerprint, scenes), *(fingerprint(*each) for each in others)]
    assert len(set(known)) == len(known)
    assert fingerprint(scene()) == known[0]
    monkeypatch.setattr("pellicle.reporting.json_record.versions", lambda: {"pellicle": "9.9"})
    assert fingerprint(scene()) not in known
