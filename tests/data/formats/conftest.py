"""What the tests of all readers share: writing files, and refusals."""

import pytest

from pellicle.data.read_spectrum import read_spectra
from pellicle.errors import DataError, UsageError


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
