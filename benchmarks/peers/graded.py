"""Graded films of `tests/hard` by pellicle and by homogeneous slices in other packages: error and time."""

from __future__ import annotations

import json
import os
import subprocess
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

os.environ.setdefault("XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1")

import jax
import jax.numpy as jnp
import numpy as np
from packages import PYELLI, Package

from pellicle.dispersion.profiles import AbstractProfile, Exponential, Linear, Power
from pellicle.optics import coherent, response
from pellicle.optics.gradient import Gradient, gauss_points
from pellicle.optics.pair import Pair

HERE = Path(__file__).resolve().parent
TABLE = HERE.parents[1] / "tests" / "hard" / "gradient.json"
PACKAGES = (
    Package("tmm", "tmm", ("tmm", "numpy"), "one wavelength at a time, float64"),
    Package("pyelli", "pyElli 2×2", PYELLI, "its solver for isotropic stacks, float64"),
    Package(
        "difftmm",
        "difftmm",
        ("difftmm",),
        "complex64 by construction, R only; given the layers from the substrate up, the order of its product",
    ),
)
OURS = "pellicle, sixth order"
SLICES = (8, 32, 128, 512)
OUR_SLICES = (4, 8, 16, 32, 64)
POINTS, REPEATS = 400, 20


class Row(NamedTuple):
    """Error and time of a method with a number of slices."""

    method: str
    slices: int
    microseconds: float  # of processor time per wavelength, R and T of s and p
    errors: np.ndarray  # of each film


def profile(row: dict[str, Any]) -> AbstractProfile:
    """Return the profile of a film of the table."""
    _, top, bottom, shape, _ = row["at"]
    kind = row["profile"]
    if kind == "linear":
        return Linear(top, bottom)
    return Exponential(top, bottom, shape) if kind == "exponential" else Power(top, bottom, shape)


def index_at(row: dict[str, Any], depth: Any) -> Any:
    """Return the complex index at relative depths: the permittivity is that of a linear mixture."""
    first, second = (complex(*x) ** 2 for x in row["media"][:2])
    return np.sqrt(first + (second - first) * np.asarray(profile(row).fraction(np.asarray(depth))))


def truths() -> dict[str, np.ndarray]:
    """Return {film: [R_s, R_p, T_s, T_p]}, to 14 digits."""
    rows = json.loads(TABLE.read_text(encoding="utf-8"))["rows"]
    return {name: np.array(row["values"][:4], dtype=float) for name, row in rows.items()}


def ours(rows: dict[str, dict[str, Any]], nm: float) -> Iterator[Row]:
    """Yield the rows of slices of sixth order."""

    def signals(points: Any, media: Any, ambient: Any, depth: Any, angle: Any, wavelength: Any) -> Any:
        gradient = Gradient(*(Pair(x.real[:, None], x.imag[:, None]) for x in points))
        phase = 2 * jnp.pi / wavelength * depth
        found = coherent.responses(ambient, [gradient], Pair(media.real, media.imag), [phase], angle)
        return jnp.stack([f(x) for f in (response.reflectance, response.transmittance) for x in found])

    compiled = jax.jit(signals)
    for count in OUR_SLICES:
        values, least = [], np.inf
        for row in rows.values():
            arguments = (
                tuple(jnp.asarray(index_at(row, z)) for z in gauss_points(count)),
                jnp.asarray(complex(*row["media"][2])),
                row["ambient"],
                row["at"][0],
                np.deg2rad(row["at"][-1]),
            )
            values.append(np.asarray(compiled(*arguments, jnp.array([nm])))[:, 0])
            if len(values) == 1:
                many = jnp.linspace(500.0, 600.0, POINTS)
                jax.block_until_ready(compiled(*arguments, many))
                for _ in range(REPEATS):
                    start = time.process_time()
                    jax.block_until_ready(compiled(*arguments, many))
                    least = min(least, time.process_time() - start)
        yield Row(OURS, count, 1e6 * least / POINTS, errors(values))


def errors(values: Any) -> np.ndarray:
    """Return the largest error of each film; a package without T has that of R."""
    return np.nanmax(np.abs(np.array(values) - np.array([*truths().values()])), axis=1)


def theirs(rows: dict[str, dict[str, Any]], nm: float, package: Package, python: Path) -> Iterator[Row]:
    """Yield the rows of homogeneous slices in another package."""
    for count in SLICES:
        films = [
            {
                "index": [(n.real, n.imag) for n in index_at(row, (np.arange(count) + 0.5) / count)],
                "depths": [row["at"][0] / count] * count,
                "substrate": row["media"][2],
                "ambient": row["ambient"],
                "angle": row["at"][-1],
                "wavelength": nm,
            }
            for row in rows.values()
        ]
        command = [str(python), str(HERE / "graded_slices.py"), package.adapter]
        done = subprocess.run(command, input=json.dumps({"films": films}), capture_output=True, text=True)
        if done.returncode:
            raise ImportError(done.stderr.strip().rpartition("\n")[2])
        found = json.loads(done.stdout)
        yield Row(package.head, count, found["microseconds"], errors(found["values"]))


def compared(pythons: dict[str, Path | str]) -> str:
    """Return the table. `pythons`: for each package's adapter its Python, or why it is not installed."""
    jax.config.update("jax_enable_x64", True)
    table = json.loads(TABLE.read_text(encoding="utf-8"))
    rows, nm = table["rows"], float(table["nm"])
    found, notes = [*ours(rows, nm)], []
    for package in PACKAGES:
        python = pythons[package.adapter]
        try:
            if isinstance(python, str):
                raise ImportError(python)
            found += theirs(rows, nm, package, python)
            notes.append(f"- {package.head}: {package.note}.")
        except ImportError as why:
            notes.append(f"- {package.head}: not installed: {why}")
    return "\n\n".join([tabulated(found), "\n".join(notes)])


def tabulated(found: Sequence[Row]) -> str:
    """Return the table: beside each row of another package the error of ours in no more time."""
    lines = [
        "| method | slices | µs per point | largest error of R and T | median | pellicle in that time |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for row in found:
        least = [np.max(x.errors) for x in found if x.method == OURS and x.microseconds <= row.microseconds]
        beside = "" if row.method == OURS else f"{min(least):.0e}" if least else "slower"
        cells = row.method, row.slices, f"{row.microseconds:.2g}", f"{np.max(row.errors):.0e}"
        lines.append("| " + " | ".join(map(str, (*cells, f"{np.median(row.errors):.0e}", beside))) + " |")
    return "\n".join(lines)
