"""Compared packages, their installation and notes for the table."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Package:
    """Column of the table: the module in `adapters`, the head, and the packages for pip.

    Pellicle itself needs no installation: it runs in the Python that runs the comparison.
    """

    adapter: str
    head: str
    install: tuple[str, ...]
    note: str


PYELLI = "pyElli", "packaging"
"""pyElli 0.23.1 needs packaging but does not declare it."""

OURS = (
    Package("pellicle64", "pellicle", (), "float64"),
    Package("pellicle32", "pellicle float32", (), "the same functions on float32 input"),
)
PEERS = (
    # tmm 0.2.0 needs NumPy but does not declare it
    Package("tmm", "tmm", ("tmm", "numpy"), "float64; clamps layers below T = 1e-30, with a warning"),
    Package("tmm_fast", "tmm_fast", ("tmm_fast",), "float64; requires real indices outside the stack"),
    Package(
        "tmmax",
        "tmmax",
        ("tmmax",),
        "float32: under x64 its scan raises TypeError; called below its function `tmm`, which accepts media "
        "only by name and refuses d = 0",
    ),
    Package("tmm_faster", "tmm_faster", ("tmm_faster",), "float64"),
    Package("pyelli2x2", "pyElli 2×2", PYELLI, "float64, its solver for isotropic stacks"),
    Package("pyelli4x4", "pyElli 4×4", PYELLI, "float64, its default solver"),
    Package("refellips", "refellips", ("refellips", "refnx"), "float64, R only: written for Ψ and Δ"),
    Package(
        "differentiable_tmm",
        "differentiable_tmm",
        ("differentiable_tmm",),
        "float64; takes the real part of the substrate's index, as documented, and warns",
    ),
    Package(
        "difftmm",
        "difftmm",
        ("difftmm",),
        "complex64 by construction, R only: returns amplitudes; called with n − ik, because n + ik amplifies",
    ),
)
