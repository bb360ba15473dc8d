"""What the tests of readers share."""

import numpy as np
import pytest


@pytest.fixture
def write_columns(write):
    """Write columns of numbers, or of one number each, below a header, and return the path."""

    def write_columns(header, *columns):
        rows = np.stack(np.broadcast_arrays(*columns), axis=1)
        return write("\n".join([header, *(",".join(f"{x:.15g}" for x in row) for row in rows), ""]))

    return write_columns
