"""Files that arrive in a folder: taken when they are closed, once, and again when they are written again."""

import os

import pytest

from pellicle.data import arrivals
from pellicle.data.arrivals import Arrivals, is_closed
from pellicle.errors import DataError


def names(arrived):
    return [path.name for path in arrived.finished()]


@pytest.fixture
def always(monkeypatch):
    """The folder is read at every look."""
    monkeypatch.setattr(arrivals, "_EVERY", 0.0)


@pytest.mark.skipif(is_closed(__import__("pathlib").Path(__file__)) is None, reason="no leases here")
def test_a_file_is_taken_when_its_writer_has_closed_it(tmp_path):
    arrived = Arrivals(tmp_path, {})
    with (tmp_path / "a.csv").open("w") as file:
        file.write("half")
        file.flush()
        assert names(arrived) == []
    assert names(arrived) == ["a.csv"]
    assert names(arrived) == []


def test_drafts_wait_for_their_names_and_empty_files_for_content(tmp_path, always):
    arrived = Arrivals(tmp_path, {}, [tmp_path / "film.toml"])
    for name in (".a.csv", "b.csv.part", "c.csv~", "film.toml"):
        (tmp_path / name).write_text("1")
    (tmp_path / "empty.csv").touch()
    (tmp_path / "folder").mkdir()
    assert names(arrived) == []
    os.replace(tmp_path / ".a.csv", tmp_path / "a.csv")
    (tmp_path / "empty.csv").write_text("1")
    assert sorted(names(arrived)) == ["a.csv", "empty.csv"]


def test_a_file_that_is_written_again_comes_again(tmp_path, always):
    arrived = Arrivals(tmp_path, {})
    (tmp_path / "a.csv").write_text("1")
    assert names(arrived) == ["a.csv"]
    (tmp_path / "a.csv").write_text("12")
    assert names(arrived) == ["a.csv"]
    assert names(Arrivals(tmp_path, {"a.csv": 2})) == []
    assert names(Arrivals(tmp_path, {"a.csv": 1})) == ["a.csv"]


def test_without_leases_a_file_is_taken_when_it_changes_no_more(tmp_path, always, monkeypatch):
    monkeypatch.setattr(arrivals, "is_closed", lambda path: None)
    now = [0.0]
    monkeypatch.setattr(arrivals.time, "monotonic", lambda: now[0])
    arrived = Arrivals(tmp_path, {})
    (tmp_path / "a.csv").write_text("1")
    assert names(arrived) == []
    now[0] += 0.4
    (tmp_path / "a.csv").write_text("12")
    assert names(arrived) == []
    now[0] += 0.4
    assert names(arrived) == []
    now[0] += 0.2
    assert names(arrived) == ["a.csv"]


def test_a_folder_that_is_gone_is_said(tmp_path, always):
    arrived = Arrivals(tmp_path, {})
    tmp_path.rmdir()
    with pytest.raises(DataError, match="cannot be read"):
        arrived.finished()
