"""What the tests of readers share."""

from pathlib import Path

import numpy as np
import pytest

from pellicle.data.read_spectrum import read_spectra
from pellicle.errors import DataError, UsageError


@pytest.fixture
def write_columns(write):
    """Write columns of numbers, or of one number each, below a header, and return the path."""

    def write_columns(header, *columns):
        rows = np.stack(np.broadcast_arrays(*columns), axis=1)
        return write("\n".join([header, *(",".join(f"{x:.15g}" for x in row) for row in rows), ""]))

    return write_columns


@pytest.fixture
def refused(write, refusal):
    """Check that a file, or one of this text, is refused by one sentence with these words, and return it."""

    def refused(source, *words, read=read_spectra, error=(DataError, UsageError), **reading):
        path = source if isinstance(source, Path) else write(source)
        return refusal(read, path, error, *words, **reading)

    return refused
