"""Texts of tables and samples, and comparison of what was read with what they state."""

from pathlib import Path
from typing import Any

import numpy as np


def assert_read(data: Any, rtol: float = 1e-12, **expected: Any) -> None:
    """Check attributes of what was read by their names: numbers to `rtol`, everything else exactly.

    `declared` are some of the facts of the file.
    """
    for name, value in expected.items():
        read = getattr(data, name)
        if name == "declared":
            read = {key: dict(read).get(key) for key in value}
        if value is None or np.asarray(value).dtype.kind not in "iufc":
            assert read == value, name
        else:
            np.testing.assert_allclose(read, value, rtol=rtol, err_msg=name)


def sample(name: str) -> str:
    """Text of a file of `formats/samples`."""
    return (Path(__file__).with_name("formats") / "samples" / name).read_text(encoding="utf-8")


def rows(*columns: Any, mark: str = ",") -> str:
    """Lines of the numbers of these columns."""
    return "".join(mark.join(f"{x:.12g}" for x in row) + "\n" for row in zip(*columns, strict=True))
