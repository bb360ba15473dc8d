"""Nothing a user had is overwritten or lost; nothing half written stays."""

import errno
import os
import stat
import subprocess
import sys

import numpy as np
import pytest

import pellicle as pl
from pellicle.data.brdf_samples import write_brdf_samples
from pellicle.data.colours import write_colours
from pellicle.errors import DataError, UsageError
from pellicle.files import _TEMPORARY, _machine, new_folder, replacing, write_text
from pellicle.reporting.figures import draw_spectrum
from pellicle.reporting.materials import figure
from pellicle.reporting.matplotlib_figure import save_figure


def test_text_arrives_whole_and_readable_as_other_files_are(tmp_path):
    old = os.umask(0o022)
    try:
        write_text(tmp_path / "a.txt", "line é\n")
    finally:
        os.umask(old)
    assert (tmp_path / "a.txt").read_bytes() == "line é\n".encode()
    assert stat.S_IMODE((tmp_path / "a.txt").stat().st_mode) == 0o644
    assert os.listdir(tmp_path) == ["a.txt"]


def test_an_existing_file_is_kept(write):
    target = write("mine", "mine.csv")
    with pytest.raises(UsageError, match=r"mine\.csv: exists and is not overwritten; choose another `path`"):
        write_text(target, "theirs")
    assert target.read_text() == "mine"
    write_text(target, "new", overwrite=True)
    assert target.read_text() == "new"


SCENE = pl.Scene(pl.Layer(1.5, 9.0), "Si", light=pl.Light([500.0, 600.0]))
SAMPLES = pl.BrdfSamples(*np.ones((4, 1)), np.ones((1, 1)), ("value",))
WRITERS = {
    "figure.png": lambda path: save_figure(draw_spectrum(pl.simulate(SCENE)), path),
    "material.png": lambda path: figure("Au", path),
    "film.csv": lambda path: pl.write_spectrum(path, pl.simulate(SCENE)),
    "colours.csv": lambda path: write_colours(path, [pl.simulate(SCENE, space="srgb")]),
    "paint.csv": lambda path: write_brdf_samples(path, SAMPLES),
    "film.toml": lambda path: pl.write_recipe(SCENE, path),
}


@pytest.mark.parametrize("name", WRITERS)
def test_every_writer_keeps_an_existing_file(tmp_path, name, refuses):
    (tmp_path / name).write_text("mine")
    refuses(UsageError, f"{name}: exists", WRITERS[name], tmp_path / name)
    assert (tmp_path / name).read_text() == "mine"
    assert os.listdir(tmp_path) == [name]


def test_a_file_that_appears_meanwhile_is_kept(tmp_path, refuses):
    target = tmp_path / "mine.csv"

    def write_while_another_does():
        with replacing(target) as temporary:
            temporary.write_text("theirs")
            target.write_text("mine")

    refuses(UsageError, "exists", write_while_another_does)
    assert target.read_text() == "mine"
    assert os.listdir(tmp_path) == ["mine.csv"]


def test_a_failure_leaves_the_old_file_and_nothing_else(tmp_path, write, refuses):
    target = write("old", "figure.png")

    def fail_half_way():
        with replacing(target, overwrite=True) as temporary:
            assert (temporary.suffix, temporary.parent) == (".png", tmp_path)
            temporary.write_text("ha")
            raise RuntimeError("half")

    refuses(RuntimeError, "half", fail_half_way)
    assert target.read_text() == "old"
    assert os.listdir(tmp_path) == ["figure.png"]


def test_places_that_cannot_be_written(tmp_path, refuses):
    with pytest.raises(UsageError, match=r"written \(there is no folder .*nowhere\); make it.*`path`"):
        write_text(tmp_path / "nowhere" / "a.txt", "")
    refuses(UsageError, "is a folder, not a file", write_text, tmp_path, "", overwrite=True)


def test_folders_that_are_new_or_empty_or_ours(tmp_path):
    folder = tmp_path / "a" / "b"
    assert new_folder(folder).is_dir()
    assert new_folder(folder) == folder
    (folder / "result.json").write_text('{"schema": "pellicle.fit/1"}')
    (folder / "diary.txt").write_text("mine")
    new_folder(folder)
    assert (folder / "diary.txt").read_text() == "mine"


@pytest.mark.parametrize(
    ("name", "text", "asked", "words"),
    [
        ("diary.txt", "mine", ".", "holds files that pellicle did not write; .*"),
        ("result.json", '{"schema": "other"}', ".", "holds files that pellicle did not write; .*"),
        ("out", "mine", "out", "out: is a file, not a folder; .*"),
        ("out", "mine", "out/deeper", "cannot be made .*"),
    ],
)
def test_files_of_others_are_no_folder(tmp_path, name, text, asked, words, refuses):
    (tmp_path / name).write_text(text)
    refuses(UsageError, words + "`folder`", new_folder, tmp_path / asked)


def _stray(folder, process, name="figure", machine=None):
    """A temporary file as a killed process leaves it."""
    path = folder / f".{name}.{machine or _machine()}-{process}-ab12cd_e.png"
    path.write_text("half")
    return path


@pytest.fixture
def dead():
    """The number of a process that has ended."""
    process = subprocess.Popen([sys.executable, "-c", ""])
    process.wait()
    return process.pid


def test_temporary_files_of_killed_processes_are_removed(tmp_path, write, dead):
    write_text(tmp_path / "result.json", '{"schema": "pellicle.fit/1"}')
    gone = _stray(tmp_path, dead)
    elsewhere, alive = _stray(tmp_path, dead, machine="00000000"), _stray(tmp_path, os.getppid(), "nk")
    mine = write("mine", ".figure.png")
    new_folder(tmp_path)
    assert [path.exists() for path in (gone, elsewhere, alive, mine)] == [False, True, True, True]
    os.utime(elsewhere, (1e9, 1e9))  # of 2001: its process has ended, wherever it ran
    new_folder(tmp_path)
    assert [path.exists() for path in (elsewhere, alive)] == [False, True]


def test_outside_a_result_folder_only_those_of_the_file_are_removed(tmp_path, dead):
    same, other = _stray(tmp_path, dead), _stray(tmp_path, dead, "corner")
    write_text(tmp_path / "figure.png", "whole")
    assert [same.exists(), other.exists()] == [False, True]


def test_a_killed_process_leaves_a_name_that_is_recognised(tmp_path):
    with replacing(tmp_path / "figure.png") as temporary:
        found = _TEMPORARY.fullmatch(temporary.name)
        assert found
        assert (found["stem"], found["process"]) == ("figure", str(os.getpid()))


@pytest.mark.parametrize(
    "error",
    [OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)), OSError("HDF5: " + os.strerror(errno.ENOSPC))],
    ids=["by number", "by text"],
)
def test_a_full_disk_is_one_sentence_and_leaves_the_old_file(tmp_path, write, error):
    target = write("old", "chain.h5")
    words = r"chain\.h5: cannot be written \(.*No space left.*make room"
    with pytest.raises(DataError, match=words), replacing(target, overwrite=True):
        raise error
    assert target.read_text() == "old"
    assert os.listdir(tmp_path) == ["chain.h5"]
