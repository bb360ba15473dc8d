"""Nothing a user had is overwritten or lost; nothing half written stays."""

import os
import stat

import pytest

from pellicle.errors import UsageError
from pellicle.files import new_folder, replacing, write_text


def test_text_arrives_whole_and_readable_as_other_files_are(tmp_path):
    old = os.umask(0o022)
    try:
        write_text(tmp_path / "a.txt", "line é\n")
    finally:
        os.umask(old)
    assert (tmp_path / "a.txt").read_bytes() == "line é\n".encode()
    assert stat.S_IMODE((tmp_path / "a.txt").stat().st_mode) == 0o644
    assert os.listdir(tmp_path) == ["a.txt"]


def test_an_existing_file_is_kept(tmp_path):
    target = tmp_path / "mine.csv"
    target.write_text("mine")
    with pytest.raises(UsageError, match=r"mine\.csv: exists and is not overwritten; choose another `path`"):
        write_text(target, "theirs")
    assert target.read_text() == "mine"
    write_text(target, "new", overwrite=True)
    assert target.read_text() == "new"


def test_a_file_that_appears_meanwhile_is_kept(tmp_path):
    target = tmp_path / "mine.csv"

    def write_while_another_does():
        with replacing(target) as temporary:
            temporary.write_text("theirs")
            target.write_text("mine")

    with pytest.raises(UsageError, match="exists"):
        write_while_another_does()
    assert target.read_text() == "mine"
    assert os.listdir(tmp_path) == ["mine.csv"]


def test_a_failure_leaves_the_old_file_and_nothing_else(tmp_path):
    target = tmp_path / "figure.png"
    target.write_text("old")

    def fail_half_way():
        with replacing(target, overwrite=True) as temporary:
            assert temporary.suffix == ".png"
            assert temporary.parent == tmp_path
            temporary.write_text("ha")
            raise RuntimeError("half")

    with pytest.raises(RuntimeError, match="half"):
        fail_half_way()
    assert target.read_text() == "old"
    assert os.listdir(tmp_path) == ["figure.png"]


def test_places_that_cannot_be_written(tmp_path):
    with pytest.raises(
        UsageError,
        match=r"written \(there is no folder .*nowhere\); make it.*`path`",
    ):
        write_text(tmp_path / "nowhere" / "a.txt", "")
    with pytest.raises(UsageError, match="is a folder, not a file"):
        write_text(tmp_path, "", overwrite=True)


def test_folders_that_are_new_or_empty_or_ours(tmp_path):
    assert new_folder(tmp_path / "a" / "b").is_dir()
    assert new_folder(tmp_path / "a" / "b") == tmp_path / "a" / "b"
    (tmp_path / "a" / "b" / "result.json").write_text('{"schema": "pellicle.fit/1"}')
    (tmp_path / "a" / "b" / "diary.txt").write_text("mine")
    new_folder(tmp_path / "a" / "b")
    assert (tmp_path / "a" / "b" / "diary.txt").read_text() == "mine"


@pytest.mark.parametrize(("name", "text"), [("diary.txt", "mine"), ("result.json", '{"schema": "other"}')])
def test_a_folder_with_files_of_others_is_refused(tmp_path, name, text):
    (tmp_path / name).write_text(text)
    with pytest.raises(UsageError, match=r"holds files that pellicle did not write; .* `folder`"):
        new_folder(tmp_path)


def test_a_file_is_no_folder(tmp_path):
    (tmp_path / "out").write_text("mine")
    with pytest.raises(UsageError, match=r"out: is a file, not a folder; .*`folder`"):
        new_folder(tmp_path / "out")
    with pytest.raises(UsageError, match=r"cannot be made .*`folder`"):
        new_folder(tmp_path / "out" / "deeper")
