"""Time per point of one film: pellicle compared with a lower bound, other packages and plain NumPy.

Run `python benchmarks/film.py`. A point is one (wavelength, thickness) with unpolarised R and T at
45°. Times are processor times, so that other processes have little influence. The lower bound ("floor") is
the minimum for any film formula: one exponential, and one sine and cosine by the same polynomial, at
every point, written to one array as large as pellicle's. Competitors take turns in each round; the
table gives medians, and the median of each round's ratio to the floor of the same precision.
Compilation is timed separately. A second table compares a Bragg mirror of 200 layers at 401 wavelengths
with a film times 200, and with tmm, in turns. Packages take part if they are installed (`pip install
tmm_fast tmmax tmm-faster`); slow ones compute fewer points. `gpu.py` measures films on a GPU.
"""

from __future__ import annotations

import argparse
import ctypes
import importlib.metadata
import os
import platform
import statistics
import time
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

os.environ.setdefault("XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1")
os.environ.setdefault("OMP_NUM_THREADS", "1")

import jax
import jax.numpy as jnp
import numpy as np
import tmm
from film_packages import (
    ABSORBING,
    ANGLE,
    SUBSTRATE,
    Run,
    by_tmm,
    by_tmm_fast,
    by_tmm_faster,
    by_tmmax,
)

import pellicle as pl
from pellicle.effects.film_plan import exact
from pellicle.forward_model.film_signal import build, tabulated
from pellicle.optics.special import sincos
from pellicle.scene.film import with_wavelength

jax.config.update("jax_enable_x64", True)

WAVELENGTH = np.linspace(400.0, 800.0, 401)
TRANSPARENT = 1.46
DISPERSING = ABSORBING + (0.3 + 0.1j) * (550.0 / WAVELENGTH[None, :]) ** 2
TMM_POINTS = 20


class Runner(NamedTuple):
    """A competitor, its thicknesses, its tolerance, and the floor of its precision."""

    run: Run
    thickness: np.ndarray
    layer: complex | np.ndarray
    tolerance: float
    floor: str = "floor float64"


def numpy_airy(
    layer: complex | np.ndarray, wavelength: np.ndarray, thickness: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The textbook Airy formula in complex NumPy, the transmitted power weighted for each polarisation."""
    q0, a = np.cos(np.deg2rad(ANGLE)), np.sin(np.deg2rad(ANGLE))
    q1, q2 = np.sqrt(layer**2 - a**2 + 0j), np.sqrt(SUBSTRATE**2 - a**2 + 0j)
    half = np.exp(2j * np.pi / wavelength * q1 * thickness)
    reflected, transmitted = 0.0, 0.0
    for e0, e1, e2 in ((1, 1, 1), (1.0, layer**2, SUBSTRATE**2)):
        r12, r23 = (e1 * q0 - e0 * q1) / (e1 * q0 + e0 * q1), (e2 * q1 - e1 * q2) / (e2 * q1 + e1 * q2)
        t = (1 + r12) * (1 + r23) * half / (1 + r12 * r23 * half**2)
        reflected = reflected + 0.5 * np.abs((r12 + r23 * half**2) / (1 + r12 * r23 * half**2)) ** 2
        transmitted = transmitted + 0.5 * np.abs(t) ** 2 * np.real(q2 / e2) / q0
    return reflected, transmitted


def _compiled(both: Callable, dtype: type, *media: np.ndarray) -> Run:
    """Compile a program that packs R and T in one complex array, because two outputs take twice the time."""
    program = jax.jit(both)

    def run(wavelength, thickness):
        return program(wavelength.astype(dtype), thickness.astype(dtype), *media).block_until_ready()

    return run


def by_pellicle_table(layer: np.ndarray, dtype: type) -> Run:
    """Return pellicle with an index for each wavelength, as an argument of the compiled program."""
    return _compiled(partial(_both, dtype), dtype, layer.astype(np.result_type(dtype, np.complex64)))


def by_pellicle(layer: complex, dtype: type) -> Run:
    """Return pellicle's public functions; an index without imaginary part is a real number."""
    kind = (np.complex64 if dtype is np.float32 else np.complex128) if isinstance(layer, complex) else dtype
    return _compiled(partial(_both, dtype, layer=kind(layer)), dtype)


def _both(dtype: type, wavelength, thickness, layer):
    media = (layer, dtype(SUBSTRATE))
    R, T = (f(wavelength, thickness, *media, angle=dtype(ANGLE)) for f in (pl.reflectance, pl.transmittance))
    return jax.lax.complex(R, T)


def floor(dtype: type) -> Run:
    """Return the lower bound: one exponential, one sine and cosine at each point."""

    def both(wavelength, thickness):
        phase = dtype(2 * np.pi * 2.8) / wavelength * thickness
        sine, cosine = sincos(phase)
        damping = jnp.exp(dtype(-0.07) * phase)
        return jax.lax.complex(damping * sine, damping * cosine)

    return _compiled(both, dtype)


def keep_pages() -> None:
    """Keep freed memory in the process (glibc): new pages take longer than a film, at random."""
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        trim_threshold, mmap_threshold = -1, -3  # malloc.h
        mallopt(trim_threshold, 2**31 - 1)
        mallopt(mmap_threshold, 2**25)


def installed(make: Callable[[], Run]) -> Run | None:
    """Return the competitor, or print a line and return None if its package is missing."""
    try:
        return make()
    except ImportError as error:
        print(f"{error.name} is not installed: left out")
        return None


def competitors(thicknesses: int) -> dict[str, Runner]:
    """Return all competitors."""
    thickness = np.linspace(0.0, 1000.0, thicknesses)[:, None]
    found = {}
    for dtype, tolerance in ((np.float64, 1e-12), (np.float32, 2e-5)):
        name = np.dtype(dtype).name
        found[f"floor {name}"] = Runner(floor(dtype), thickness, 0j, np.inf, f"floor {name}")
        for layer, kind in ((ABSORBING, "absorbing"), (TRANSPARENT, "transparent")):
            run = by_pellicle(layer, dtype)
            found[f"pellicle {name}, {kind}"] = Runner(run, thickness, layer, tolerance, f"floor {name}")
        run = by_pellicle_table(DISPERSING, dtype)
        found[f"pellicle {name}, dispersing"] = Runner(run, thickness, DISPERSING, tolerance, f"floor {name}")
    found["NumPy complex Airy"] = Runner(partial(numpy_airy, ABSORBING), thickness, ABSORBING, 1e-12)
    tenth, fiftieth = (thickness[:: max(1, thicknesses // n)] + 1.0 for n in (100, 20))
    for name, make, some, tolerance in (
        ("tmm_fast", by_tmm_fast, tenth, 1e-12),
        ("tmmax float32", by_tmmax, tenth, 1e-3),
        ("tmm_faster", by_tmm_faster, fiftieth, 1e-2),  # its T_p is off by 1e-3 with an absorbing substrate
    ):
        if (run := installed(make)) is not None:
            found[name] = Runner(run, some, ABSORBING, tolerance)
    found["tmm"] = Runner(by_tmm, thickness[:1] + 123.0, ABSORBING, 1e-12)
    return found


def wavelengths(name: str) -> np.ndarray:
    return WAVELENGTH[None, :: 401 // TMM_POINTS][:, :TMM_POINTS] if name == "tmm" else WAVELENGTH[None, :]


def main(rounds: int, thicknesses: int) -> None:
    keep_pages()
    runners, first = competitors(thicknesses), {}
    for name, runner in runners.items():
        began = time.perf_counter()
        answer = runner.run(wavelengths(name), runner.thickness)
        first[name] = time.perf_counter() - began
        if np.isfinite(runner.tolerance):
            truth = numpy_airy(runner.layer, wavelengths(name), runner.thickness)
            pair = answer if isinstance(answer, tuple) else (answer.real, answer.imag)
            error = max(float(np.max(np.abs(np.asarray(a) - b))) for a, b in zip(pair, truth, strict=True))
            assert error < runner.tolerance, (name, error)
    times: dict[str, list[float]] = {name: [] for name in runners}
    for _ in range(rounds):
        for name, runner in runners.items():
            runner.run(
                wavelengths(name), runner.thickness
            )  # refills the caches after the previous competitor
            began = time.process_time()
            runner.run(wavelengths(name), runner.thickness)
            size = np.broadcast(wavelengths(name), runner.thickness).size
            times[name].append((time.process_time() - began) / size)
    _table(times, first, {name: runner.floor for name, runner in runners.items()})


def _table(times: dict[str, list[float]], first: dict[str, float], floors: dict[str, str]) -> None:
    versions = ", ".join(f"{p} {importlib.metadata.version(p)}" for p in ("pellicle", "jax", "numpy", "tmm"))
    print(f"{versions}, Python {platform.python_version()}, {platform.machine()}")
    print(f"{'':<30}{'ns per point':>14}{'points per s':>16}{'× floor':>10}{'first call s':>14}")
    for name, values in sorted(times.items(), key=lambda item: statistics.median(item[1])):
        each = statistics.median(values)
        ratio = statistics.median(a / b for a, b in zip(values, times[floors[name]], strict=True))
        print(f"{name:<30}{each * 1e9:>14.1f}{1 / each:>16.3g}{ratio:>10.2f}{first[name]:>14.2f}")


def mirror_table(rounds: int) -> None:
    """Processor time of R of a mirror of 100 pairs, with and without a drift, beside a film times 200."""
    pair, size = ((2.3, 60.0), (1.46, 94.0)), WAVELENGTH.size

    def simulated(*layers: Any) -> Callable[[], Any]:
        scene = tabulated(with_wavelength(pl.Scene(list(layers), SUBSTRATE), WAVELENGTH))
        program = jax.jit(build(exact(scene).static_key))
        return lambda: program(scene).block_until_ready()

    def by_tmm_stack() -> np.ndarray:
        indices, depths = zip((1.0, np.inf), *100 * pair, (SUBSTRATE, np.inf), strict=True)
        return np.array([tmm.coh_tmm("s", indices, depths, 0.0, nm)["R"] for nm in WAVELENGTH[::20]])

    plain, drifting = (
        pl.Group([pl.Layer(n, d, drift=drift) for n, d in pair], 100) for drift in (None, 1e-9)
    )
    runs = {
        "film": (simulated(pl.Layer(*pair[0])), 200.0),
        "mirror of 200 layers": (simulated(plain), 1.0),
        "mirror of 200 layers, drifting": (simulated(drifting), 1.0),
        "tmm": (by_tmm_stack, size / WAVELENGTH[::20].size),
    }
    truth = by_tmm_stack()
    for name in (*runs,)[1:3]:
        assert np.max(np.abs(np.asarray(runs[name][0]())[::20] - truth)) < 1e-6, name
    times: dict[str, list[float]] = {name: [] for name in runs}
    for _ in range(rounds):
        for name, (run, times_as_much) in runs.items():
            run()
            began = time.process_time()
            run()
            times[name].append((time.process_time() - began) * times_as_much)
    print(f"{'R of 200 layers':<32}{'ms':>10}{'× film × 200':>14}")
    for name, each in times.items():
        ratio = statistics.median(a / b for a, b in zip(each, times["film"], strict=True))
        print(f"{name + ' × 200' * (name == 'film'):<32}{statistics.median(each) * 1e3:>10.3g}{ratio:>14.3g}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=31)
    parser.add_argument("--thicknesses", type=int, default=1000, help="of 401 points each (1000)")
    given = parser.parse_args()
    main(given.rounds, given.thicknesses)
    print()
    mirror_table(given.rounds)
