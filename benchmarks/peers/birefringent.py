"""Hard birefringent films of `tests/hard`, with their reference values and derivatives to 50 digits."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from packages import PYELLI, Package

TABLE = Path(__file__).resolve().parents[2] / "tests" / "hard" / "anisotropic.json"
PACKAGES = (
    Package("birefringent_pellicle64", "pellicle", (), "`pl.jones`, float64"),
    Package("birefringent_pellicle32", "pellicle float32", (), "the same function on float32 input"),
    Package(
        "birefringent_pyelli",
        "pyElli 4×4",
        PYELLI,
        "float64, its default solver and propagator; it has no derivatives",
    ),
    Package(
        "birefringent_difftmm",
        "difftmm",
        ("difftmm",),
        "complex64 by construction; isotropic substrates only, so its derivatives are not compared",
    ),
)
ELEMENTS = 8
"""Numbers of a case that are compared: real and imaginary parts of r_pp, r_ps, r_sp and r_ss."""


def cases_and_truths() -> tuple[dict[str, Any], dict[str, Any]]:
    """Return {case: {name of a parameter: number}} and {case: values and slopes}."""
    table = json.loads(TABLE.read_text(encoding="utf-8"))
    cases, truths = {}, {}
    for name, row in table["cases"].items():
        cases[name] = dict(zip(table["parameters"], row["at"], strict=True))
        slopes = [slope for each in row["slope"] for slope in each[:ELEMENTS]]
        truths[name] = {"values": {"r": row["value"][:ELEMENTS]}, "slopes": {"r": slopes}}
    return cases, truths
