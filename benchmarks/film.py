"""Points per second of one absorbing film: pellicle against tmm, tmm_fast and plain NumPy, in one run.

Run `python benchmarks/film.py`. A point is one (wavelength, thickness) giving unpolarised R and T at
45°. Competitors take turns in each round, so that a noisy machine is noisy for all; the table gives
medians and the ratio to pellicle in float64. Compilation is timed apart. tmm computes one point at a
time, so it gets fewer points; tmm_fast takes part if it is installed (`pip install tmm_fast`).
"""

from __future__ import annotations

import argparse
import importlib.metadata
import platform
import statistics
import time
from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
import tmm

import pellicle as pl

jax.config.update("jax_enable_x64", True)

ANGLE = 45.0
WAVELENGTH = np.linspace(400.0, 800.0, 401)
LAYER, SUBSTRATE = 2.9 + 0.2j, 1.52 + 0.0j
TMM_POINTS = 20


def numpy_airy(wavelength: np.ndarray, thickness: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The textbook Airy formula in complex NumPy, the transmitted power weighted for each polarisation."""
    q0, a = np.cos(np.deg2rad(ANGLE)), np.sin(np.deg2rad(ANGLE))
    q1, q2 = np.sqrt(LAYER**2 - a**2 + 0j), np.sqrt(SUBSTRATE**2 - a**2 + 0j)
    half = np.exp(2j * np.pi / wavelength * q1 * thickness)
    reflected, transmitted = 0.0, 0.0
    for e0, e1, e2 in ((1, 1, 1), (1.0, LAYER**2, SUBSTRATE**2)):
        r12, r23 = (e1 * q0 - e0 * q1) / (e1 * q0 + e0 * q1), (e2 * q1 - e1 * q2) / (e2 * q1 + e1 * q2)
        t = (1 + r12) * (1 + r23) * half / (1 + r12 * r23 * half**2)
        reflected = reflected + 0.5 * np.abs((r12 + r23 * half**2) / (1 + r12 * r23 * half**2)) ** 2
        transmitted = transmitted + 0.5 * np.abs(t) ** 2 * np.real(q2 / e2) / q0
    return reflected, transmitted


def by_tmm(wavelength: np.ndarray, thickness: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The tmm package, point by point."""
    points = np.broadcast(wavelength, thickness)
    answers = [
        tmm.unpolarized_RT([1.0, LAYER, SUBSTRATE], [np.inf, d, np.inf], np.deg2rad(ANGLE), w)
        for w, d in points
    ]
    shape = points.shape
    return tuple(np.array([p[key] for p in answers]).reshape(shape) for key in "RT")  # type: ignore[return-value]


def by_pellicle(dtype: type) -> Callable:
    """One compiled program for R and T, packed in one complex array as two outputs cost twice."""

    @jax.jit
    def both(wavelength, thickness):
        options = {"angle": jnp.asarray(ANGLE, dtype)}
        layer, substrate = jnp.asarray(LAYER).astype(_complex(dtype)), dtype(SUBSTRATE.real)
        return jax.lax.complex(
            pl.reflectance(wavelength, thickness, layer, substrate, **options),
            pl.transmittance(wavelength, thickness, layer, substrate, **options),
        )

    def run(wavelength, thickness):
        packed = both(wavelength.astype(dtype), thickness.astype(dtype)).block_until_ready()
        return packed.real, packed.imag

    return run


def _complex(dtype: type) -> type:
    return np.complex64 if dtype is np.float32 else np.complex128


def by_tmm_fast() -> Callable | None:
    """tmm_fast on its own broadcasting, or None where it is not installed."""
    try:
        import torch
        from tmm_fast import coh_tmm
    except ImportError:
        return None

    torch.set_num_threads(1)  # two threads on two shared cores are slower

    def run(wavelength, thickness):
        count, size = thickness.size, wavelength.size
        index = torch.tensor([1.0, LAYER, SUBSTRATE], dtype=torch.complex128)
        index = index[None, :, None].expand(count, 3, size).clone()
        depth = torch.tensor(np.stack([np.full(count, np.inf), thickness.ravel(), np.full(count, np.inf)], 1))
        theta, light = torch.tensor([np.deg2rad(ANGLE)]), torch.tensor(wavelength.ravel())
        both = [coh_tmm(p, index, depth, theta, light) for p in "sp"]
        return tuple(np.asarray(0.5 * (both[0][k] + both[1][k]))[:, 0, :] for k in "RT")

    return run


def main(rounds: int, thicknesses: int) -> None:
    thickness = np.linspace(0.0, 1000.0, thicknesses)[:, None]
    wavelength = WAVELENGTH[None, :]
    few = thickness[:: max(1, thicknesses // 2)][:1] + 123.0, WAVELENGTH[None, ::21][:, :TMM_POINTS]
    runners: dict[str, tuple[Callable, tuple]] = {
        "pellicle float64": (by_pellicle(np.float64), (wavelength, thickness)),
        "pellicle float32": (by_pellicle(np.float32), (wavelength, thickness)),
        "NumPy complex Airy": (numpy_airy, (wavelength, thickness)),
        "tmm": (by_tmm, (few[1], few[0])),
    }
    fast = by_tmm_fast()
    if fast is None:
        print("tmm_fast is not installed: left out")
    else:
        runners["tmm_fast"] = fast, (wavelength, thickness[: max(1, thicknesses // 10)])
    truth = numpy_airy(wavelength, thickness)
    first: dict[str, float] = {}
    for name, (run, arguments) in runners.items():
        began = time.perf_counter()
        answer = run(*arguments)
        first[name] = time.perf_counter() - began
        expected = truth if np.shape(answer[0]) == truth[0].shape else numpy_airy(*arguments)
        error = max(float(np.max(np.abs(np.asarray(a) - b))) for a, b in zip(answer, expected, strict=True))
        assert error < (1e-5 if "float32" in name else 1e-12), (name, error)
    times: dict[str, list[float]] = {name: [] for name in runners}
    for _ in range(rounds):
        for name, (run, arguments) in runners.items():
            began = time.perf_counter()
            run(*arguments)
            times[name].append((time.perf_counter() - began) / np.broadcast(*arguments).size)
    _table(times, first)


def _table(times: dict[str, list[float]], first: dict[str, float]) -> None:
    versions = ", ".join(f"{p} {importlib.metadata.version(p)}" for p in ("pellicle", "jax", "numpy", "tmm"))
    print(f"{versions}, Python {platform.python_version()}, {platform.machine()}")
    reference = statistics.median(times["pellicle float64"])
    print(f"{'':<20}{'ns per point':>14}{'points per s':>16}{'ratio':>10}{'first call s':>14}")
    for name, values in sorted(times.items(), key=lambda item: statistics.median(item[1])):
        each = statistics.median(values)
        print(f"{name:<20}{each * 1e9:>14.1f}{1 / each:>16.3g}{each / reference:>10.2f}{first[name]:>14.2f}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=15)
    parser.add_argument("--thicknesses", type=int, default=1000)
    given = parser.parse_args()
    main(given.rounds, given.thicknesses)
