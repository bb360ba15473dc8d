"""Texts of tables, and comparison of what was read with what they state."""

from typing import Any

import numpy as np


def assert_read(data: Any, rtol: float = 1e-12, **expected: Any) -> None:
    """Check attributes of what was read by their names: numbers to `rtol`, everything else exactly."""
    for name, value in expected.items():
        read = getattr(data, name)
        if value is None or np.asarray(value).dtype.kind not in "iufc":
            assert read == value, name
        else:
            np.testing.assert_allclose(read, value, rtol=rtol, err_msg=name)


def rows(*columns: Any, mark: str = ",") -> str:
    """Lines of the numbers of these columns."""
    return "".join(mark.join(f"{x:.12g}" for x in row) + "\n" for row in zip(*columns, strict=True))
