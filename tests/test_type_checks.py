"""Types and sizes of the package's arguments and results are checked in tests (`conftest.py`)."""

import jaxtyping
import numpy as np
import pytest
from beartype import beartype
from jaxtyping import Float

from pellicle.data.spectrum import Spectrum
from pellicle.reporting.page.document import picture
from pellicle.signals.sphere import ncs


def test_the_package_is_checked():
    """A function, sizes that two arguments share, and a class."""
    for wrong in (
        lambda: picture("text", "a figure"),
        lambda: ncs(np.ones(3), np.ones(4)),
        lambda: Spectrum(np.ones(2), np.ones(2), 3),
    ):
        with pytest.raises(TypeError, match=r"violates type hint|Type-check error"):
            wrong()
    assert ncs(np.ones(3), np.ones(3)).shape == (3, 3)


@pytest.mark.parametrize("count", [3, 2])
def test_a_result_has_the_sizes_of_the_arguments(count):
    @jaxtyping.jaxtyped(typechecker=beartype)
    def first(x: Float[np.ndarray, " points"], n: int) -> Float[np.ndarray, " points"]:
        return x[:n]

    if count == 3:
        assert first(np.ones(3), count).shape == (3,)
    else:
        with pytest.raises(Exception, match="violates type hint"):
            first(np.ones(3), count)
