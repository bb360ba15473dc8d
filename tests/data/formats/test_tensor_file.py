"""Tensor files: fields written come back, damaged files end in one sentence."""

import struct
from contextlib import suppress

import numpy as np
import pytest

from pellicle.data.formats.rgl import MAGIC, is_tensor_file, read_tensors, write_tensors
from pellicle.errors import DataError, UsageError

FIELDS = {
    "description": np.frombuffer(b"steel", np.uint8),
    "one": np.array([7], np.uint8),
    "grid": np.arange(24, dtype=np.float32).reshape(2, 3, 4) / 7,
    "double": np.array([[1e-300, np.pi]]),
    "counts": np.array([-5, 2**40], np.int64),
}


@pytest.fixture
def path(tmp_path):
    write_tensors(tmp_path / "made.bsdf", FIELDS)
    return tmp_path / "made.bsdf"


def test_what_is_written_is_read(path):
    assert is_tensor_file(path)
    read = read_tensors(path)
    assert list(read) == list(FIELDS)
    for name, field in FIELDS.items():
        assert read[name].dtype == field.dtype
        np.testing.assert_array_equal(read[name], field)


def test_bytes_of_a_file_as_the_format_states_them(tmp_path):
    """One field, byte by byte: header, version, count, name, axes, type 10 (float32), position, shape."""
    write_tensors(tmp_path / "x", {"ab": np.array([1.5, -2.0], np.float32)})
    head = MAGIC + bytes([1, 0, 1, 0, 0, 0, 2, 0]) + b"ab" + bytes([1, 0, 10])
    position = len(head) + 16
    padding = -position % 8
    expected = head + struct.pack("<QQ", position + padding, 2) + b"\0" * padding
    assert (tmp_path / "x").read_bytes() == expected + struct.pack("<2f", 1.5, -2.0)


def test_mitsuba_reads_it_and_writes_what_is_read(path, tmp_path, capsys):
    tensor_io = pytest.importorskip("mitsuba.python.tensor_io")
    theirs = tensor_io.read(str(path))
    tensor_io.write(str(tmp_path / "theirs.bsdf"), **FIELDS)
    ours = read_tensors(tmp_path / "theirs.bsdf")
    for name, field in FIELDS.items():
        np.testing.assert_array_equal(theirs[name], field)
        np.testing.assert_array_equal(ours[name], field)


def test_every_cut_and_every_wrong_byte_of_the_header(path):
    content = path.read_bytes()
    first = min(content.find(FIELDS["description"].tobytes()), 300)
    for end in range(len(MAGIC), len(content), 3):
        path.write_bytes(content[:end])
        with pytest.raises(DataError, match=f"^{path}: "):
            read_tensors(path)
    for at in range(len(MAGIC), first):
        path.write_bytes(content[:at] + bytes([content[at] ^ 0xFF]) + content[at + 1 :])
        with suppress(DataError):  # any other error fails
            read_tensors(path)


def test_other_versions_and_types_are_named(path, tmp_path):
    content = bytearray(path.read_bytes())
    content[12] = 2
    path.write_bytes(content)
    with pytest.raises(DataError, match=r"of version 2\.0, 1\.0 is expected"):
        read_tensors(path)
    with pytest.raises(ValueError, match="`z`: tensor files have no numbers of type complex128"):
        write_tensors(tmp_path / "z", {"z": np.array([1j])})
    with pytest.raises(UsageError, match="exists"):
        write_tensors(path, FIELDS)
