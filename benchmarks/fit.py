"""Time per point of what a fit evaluates, compared with the forward model alone, and time of whole fits.

Run `python benchmarks/fit.py`. The first table has one line for each signal and depth of stack: the public
function of as many layers itself (of Ψ and Δ it also takes arctangents), the deviance of a candidate
(simulation, scale and offset, misfit), and residuals with their Jacobian in p parameters; all in ns per data
point and evaluation of 64 candidates in one call, by processor time, and as ratios. The goals: deviance at
most 3 (R, T) or 5 (Ψ and Δ) times the film function; residuals with Jacobian at most (1 + p/2) times the
deviance.

The other tables are of whole fits of simulated files with random true values (`whole_fits`). The first has
`pl.fit`: the first call of a new process with an empty cache of compiled programs, which compiles, and with
a filled one; the median of the few calls after it, each of another file, and that of calls after all programs
are compiled. The second has it, and its search
alone, beside SciPy and lmfit with the film in vectorised NumPy, in turns: least squares from the best local
minima of a scan of the thickness or from random starts, and differential evolution, each with the fewest
starts or the smallest population that is right in 95 % of the files; the third has the ratios. A fit is
right where its χ² is within 4 of the minimum reached from the true values; programs that are right in fewer
than 95 % of the files are struck out. The others return the best values, lmfit also their covariance.
`pl.fit` also estimates the noise, and computes standard errors, limits by profile likelihood, rivals and the
status.
"""

from __future__ import annotations

import argparse
import os
import platform
import statistics
import sys
import time
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

os.environ.setdefault("XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import jax
import jax.numpy as jnp
import numpy as np

import pellicle as pl
from pellicle.fitting.evaluation import deviances
from pellicle.fitting.film.problem import make, measured

jax.config.update("jax_enable_x64", True)

CANDIDATES = 64
NOISE = 0.002


class Case(NamedTuple):
    """A scene with free parameters, its light and the values that simulate its data."""

    name: str
    scene: pl.Scene
    points: int
    truth: tuple[float, ...]


def cauchy(A: float | pl.Free = 1.45, B: float | pl.Free = 4000.0) -> pl.dispersion.Cauchy:
    """The dispersion of the fitted layers, B in nm²."""
    return pl.dispersion.Cauchy(A, B)


def scene(layers: Any, signal: str = "R", angle: float = 0.0, **instrument: Any) -> pl.Scene:
    """Layers on silicon in the light of `signal` at `angle` degrees."""
    return pl.Scene(
        layers,
        "Si",
        light=pl.Light(signal=signal, angle=angle),
        instrument=pl.Instrument(**instrument),
    )


THICKNESS, A, B, NATIVE = pl.Free(10, 1000), pl.Free(1.3, 1.7), pl.Free(0, 20000), pl.Free(0.5, 50)
TWO = [pl.Layer(cauchy(A, B), THICKNESS), pl.Layer("SiO2", NATIVE)]
CASES = (
    Case("R, thickness", scene(pl.Layer("SiO2", THICKNESS)), 401, (300.0,)),
    Case("R, thickness and Cauchy", scene(pl.Layer(cauchy(A, B), THICKNESS)), 401, (1.45, 4e3, 300.0)),
    Case(
        "R, slow scale, offset",
        scene(pl.Layer("SiO2", THICKNESS), scale="slow", offset="free"),
        401,
        (300.0,),
    ),
    Case("R, two layers", scene(TWO), 401, (1.45, 4e3, 300.0, 5.0)),
    Case(
        "psi-delta, thickness and Cauchy",
        scene(pl.Layer(cauchy(A, B), THICKNESS), "psi-delta", 65.0),
        401,
        (1.45, 4e3, 300.0),
    ),
    Case("psi-delta, two layers", scene(TWO, "psi-delta", 65.0), 926, (1.45, 4e3, 300.0, 5.0)),
)


def spectrum(case: Case) -> pl.Spectrum:
    """Data of a case with noise of `NOISE`; Ψ and Δ in degrees of a tenth of that by 57."""
    wavelength = np.linspace(400.0, 900.0, case.points)
    truth = pl.simulate(_at(case), wavelength)
    random = np.random.default_rng(0)
    scale = np.rad2deg(NOISE) if truth.delta is not None else NOISE
    values = truth.values + scale * random.standard_normal(case.points)
    if truth.delta is None:
        return pl.Spectrum(wavelength, values, truth.signal)
    delta = truth.delta + scale * random.standard_normal(case.points)
    return pl.Spectrum(wavelength, values, "psi-delta", delta=delta, angle=np.full(case.points, 65.0))


def _at(case: Case) -> pl.Scene:
    """The case's scene with its free parameters at the truth."""
    from pellicle.scene.free import insert

    bare = insert(case.scene, case.truth)
    return pl.Scene(bare.layers, bare.substrate, light=bare.light)


def seconds(run: Callable[[], Any], rounds: int) -> float:
    """Median processor time of one call, after one that compiles."""
    jax.block_until_ready(run())
    times = []
    for _ in range(rounds):
        began = time.process_time()
        jax.block_until_ready(run())
        times.append(time.process_time() - began)
    return statistics.median(times)


def film(case: Case, thicknesses: np.ndarray) -> Callable[[], Any]:
    """The public film function of as many layers and points, with indices already evaluated.

    `thicknesses` are (candidates, layers).
    """
    wavelength = np.linspace(400.0, 900.0, case.points)
    n, oxide = cauchy()(wavelength), pl.refractive_index(wavelength, "SiO2").real
    below, light = pl.refractive_index(wavelength, "Si"), case.scene.light
    depths = tuple(jnp.asarray(x)[:, None] for x in thicknesses.T)

    @jax.jit
    def run(*depths: Any) -> Any:
        film = (
            (wavelength, list(depths), [n, oxide], below)
            if len(depths) > 1
            else (wavelength, *depths, n, below)
        )
        if light.signal == "psi-delta":
            return pl.ellipsometry(*film, angle=light.angle)
        return pl.reflectance(*film)

    return lambda: run(*depths)


def rows(case: Case, rounds: int) -> tuple[str, ...]:
    """One line of the first table."""
    problem = make(measured(spectrum(case), case.scene))
    [view] = problem.views
    size = len(problem.parameters)
    units = np.random.default_rng(1).uniform(0.1, 0.9, (CANDIDATES, size))
    values = problem.seen_by(view, np.asarray(problem.values(units)))

    @jax.jit
    def residuals(arrays: Any, values: Any) -> Any:
        def one(value: Any) -> Any:
            rows, push = jax.linearize(lambda v: view.form.explain(arrays, list(v)).residual, value)
            return rows, jax.vmap(push)(jnp.eye(size))

        return jax.vmap(one)(values)

    scale = 1e9 / (CANDIDATES * view.rows)
    layers = sum(p.key == "thickness" for p in problem.parameters)
    bare = scale * seconds(film(case, values[:, -layers:]), rounds)
    misfit = scale * seconds(lambda: deviances(view.form, view.arrays, values).value, rounds)
    slopes = scale * seconds(lambda: residuals(view.arrays, values), rounds)
    goals = 5 if view.channels > 1 else 3, 1 + size / 2
    return (
        case.name,
        f"{bare:.1f}",
        f"{misfit:.1f}",
        f"{misfit / bare:.1f} (goal {goals[0]})",
        f"{slopes:.1f}",
        f"{slopes / misfit:.1f} (goal {goals[1]:g})",
    )


def whole_fits(chosen: list[str], files: int | None) -> None:
    """Print the tables of whole fits, of all cases or of those whose name contains a word of `chosen`."""
    from whole_fits import cases, comparison, tables

    names = [case.name for case in cases.cases()]
    of = [i for i, name in enumerate(names) if not chosen or any(word in name for word in chosen)]
    found = []
    for i in of:
        found.append(comparison.compared(i, files))
        print(f"{len(found)} of {len(of)}: {names[i]}", file=sys.stderr, flush=True)
    table(*tables.calls(found))
    table(*tables.others(found))
    table(*tables.ratios(found))


def table(header: tuple[str, ...], lines: Iterable[tuple[str, ...]]) -> None:
    """Print a Markdown table, each line when it comes."""
    print("| " + " | ".join(header) + " |")
    print("|" + "---|" * len(header))
    for line in lines:
        print("| " + " | ".join(line) + " |", flush=True)
    print()


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--rounds", type=int, default=15, help="repetitions of each evaluation (15)")
    parser.add_argument("--no-fits", action="store_true", help="only the evaluations")
    parser.add_argument("--no-evaluations", action="store_true", help="only the whole fits")
    parser.add_argument("--only", nargs="*", default=[], help="words in the names of the whole fits to time")
    parser.add_argument("--files", type=int, help="files of each whole fit (20; 119 of soap films)")
    asked = parser.parse_args()
    print(f"jax {jax.__version__}, Python {platform.python_version()}, {platform.machine()}, one thread\n")
    if not asked.no_evaluations:
        head = ("ns per point", "film function", "deviance", "x film", "residuals and Jacobian", "x deviance")
        table(head, [rows(case, asked.rounds) for case in CASES])
    if not asked.no_fits:
        whole_fits(asked.only, asked.files)


if __name__ == "__main__":
    main()
