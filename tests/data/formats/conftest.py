"""What the tests of all readers share: refusals of texts."""

import pytest

from pellicle.data.read_spectrum import read_spectra
from pellicle.errors import DataError, UsageError


@pytest.fixture
def refused(write, refusal):
    """Check that a text is refused by one sentence with these words, and return it."""

    def refused(text, *words, error=(DataError, UsageError), **reading):
        return refusal(read_spectra, write(text), error, *words, **reading)

    return refused
