"""What the tests of all readers share: writing files, encodings of them, and refusals."""

import numpy as np
import pytest

from pellicle.data.read_spectrum import read_spectra
from pellicle.errors import DataError, UsageError

ENCODINGS = {
    "CRLF": lambda text: text.replace("\n", "\r\n").encode(),
    "CR": lambda text: text.replace("\n", "\r").encode(),
    "BOM": lambda text: b"\xef\xbb\xbf" + text.encode(),
    "UTF-16": lambda text: text.encode("utf-16"),
    "UTF-16 without a mark": lambda text: text.encode("utf-16-le"),
    "Latin-1": lambda text: text.encode("latin-1"),
    "no line end": lambda text: text.rstrip("\n").encode(),
}


@pytest.fixture
def write(tmp_path):
    """Write text or bytes to a file, and return its path."""

    def write(content, name="export.dat"):
        path = tmp_path / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    return write


@pytest.fixture
def same_in_every_encoding(write):
    """Check that a text is read to the same spectra however it is encoded."""

    def check(text, **reading):
        def read(content):
            return read_spectra(write(content), **({"spectrum": "all"} | reading))

        expected = read(text)
        for name, encode in ENCODINGS.items():
            found = read(encode(text))
            assert [one.name for one in found] == [one.name for one in expected], name
            for one, other in zip(found, expected, strict=True):
                np.testing.assert_array_equal(one.wavelength, other.wavelength, err_msg=name)
                np.testing.assert_array_equal(one.values, other.values, err_msg=name)

    return check


@pytest.fixture
def refused(write):
    """Check that a text is refused by one sentence with these words, and return it."""

    def refused(text, *words, error=(DataError, UsageError), **reading):
        path = write(text)
        with pytest.raises(error) as caught:
            read_spectra(path, **reading)
        message = str(caught.value)
        assert message.startswith(f"{path}: "), message
        assert "\n" not in message
        for word in words:
            assert word in message.removeprefix(str(path)), message
        return message

    return refused
