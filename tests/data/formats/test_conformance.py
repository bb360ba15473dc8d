"""What every reader of text exports must do with the samples in `samples/READER/`."""

import re
from pathlib import Path

import numpy as np
import pytest

from pellicle.data.formats import accurion
from pellicle.data.formats.detect import TEXT_READERS
from pellicle.data.read_spectrum import read_spectra
from pellicle.data.tabular.text import read_bytes, text_file
from pellicle.errors import DataError, UsageError

FOLDER = Path(__file__).with_name("samples")
SAMPLES = {path.relative_to(FOLDER).as_posix(): path for path in sorted(FOLDER.glob("*/*"))}
READERS = {
    "accurion": accurion.read,
    **{r.__module__.split(".")[-1] if r.__name__ == "read" else r.__name__: r for r in TEXT_READERS},
}
READING = {
    "numbered_columns": {"signal": "R"},
    "ocean_optics": {"signal": "R", "signal_unit": "percent"},
    "stellarnet": {"signal": "R"},
    "jcamp/affn.txt": {"calibrated": False},
    "bruker_dpt": {"signal": "R", "signal_unit": "fraction", "wavelength_unit": "cm-1"},
}
"""What the samples of a reader, or one of them, do not state."""
COMMAS = {"avantes", "horiba", "jasco", "ocean_optics", "perkin_elmer", "spectraray", "stellarnet", "woollam"}
"""Readers of formats that some instruments write with decimal commas."""
ENCODINGS = {
    "CRLF": lambda text: text.replace("\n", "\r\n").encode(),
    "CR": lambda text: text.replace("\n", "\r").encode(),
    "BOM": lambda text: b"\xef\xbb\xbf" + text.encode(),
    "UTF-16": lambda text: text.encode("utf-16"),
    "UTF-16 without a mark": lambda text: text.encode("utf-16-le"),
    "Latin-1": lambda text: text.encode("latin-1"),
    "no line end": lambda text: text.rstrip("\n").encode(),
}
ROW = re.compile(r"(?m)^(?=[^,\n]*\d\.\d)(?=[^,\n]*\d[;\t ]+-?\d)[A-Za-z]{0,5}[\d.eE+;\t -]+$")
"""A line of two or more numbers, one of them with a decimal point, and none with a comma."""


@pytest.fixture(params=SAMPLES)
def sample(request):
    return request.param


@pytest.fixture
def read(write, sample):
    """Read a text or bytes in place of the sample."""
    reading = {"spectrum": "all"} | READING.get(sample, READING.get(sample.partition("/")[0], {}))
    return lambda content: read_spectra(write(content, Path(sample).name), **reading)


@pytest.fixture
def text(sample):
    return SAMPLES[sample].read_text(encoding="utf-8")


def assert_same(found, expected, case):
    assert [one.name for one in found] == [one.name for one in expected], case
    for one, other in zip(found, expected, strict=True):
        for name in ("wavelength", "values", "sigma", "angle", "delta", "lines"):
            ours, theirs = getattr(one, name), getattr(other, name)
            assert (ours is None) == (theirs is None), (case, name)
            if ours is not None:
                np.testing.assert_array_equal(ours, theirs, err_msg=f"{case}: {name}")


def test_every_reader_has_a_sample():
    assert {name.partition("/")[0] for name in SAMPLES} == set(READERS)


def test_a_sample_is_recognised_by_its_reader_alone(sample):
    file = text_file(*read_bytes(SAMPLES[sample]), SAMPLES[sample])
    claimed = [name for name, reader in READERS.items() if reader(file)]
    assert claimed == [sample.partition("/")[0]]


def test_a_sample_is_read_the_same_in_every_encoding(read, text):
    expected = read(text)
    assert expected
    for name, encode in ENCODINGS.items():
        assert_same(read(encode(text)), expected, name)


@pytest.mark.parametrize("sample", [s for s in SAMPLES if s.partition("/")[0] in COMMAS], indirect=True)
def test_decimal_commas_are_read_as_points(read, text):
    with_commas = ROW.sub(lambda row: row[0].replace(".", ","), text)
    assert with_commas != text or "," in text
    assert_same(read(with_commas), read(text), "decimal commas")


@pytest.mark.slow
def test_a_sample_with_a_damaged_line_is_read_or_refused_in_one_sentence(read, text, tmp_path):
    lines, messages = text.splitlines(keepends=True), []
    for i, line in enumerate(lines):
        for damaged in ("x\n", line[: len(line) // 2] + "\n"):
            try:
                assert read("".join([*lines[:i], damaged, *lines[i + 1 :]]))
            except (DataError, UsageError) as error:
                messages.append(str(error))
    assert messages
    assert not [message for message in messages if not message.startswith(f"{tmp_path}") or "\n" in message]
