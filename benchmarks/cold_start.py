"""Start-up time: complete `pellicle fit` commands in new processes, compared with JAX and one operation.

Run `python benchmarks/cold_start.py`. First fits start with an empty cache of programs, later
ones with a filled cache. The commands take turns; the table gives medians of wall and processor time (s), and
their ratios to bare JAX, the least that any program of JAX takes.

Linux, 2 cores that did nothing else; JAX 0.10.2, Python 3.11, medians of 3:

                                          wall s   cpu s  wall ratio  cpu ratio
    bare JAX                                0.90    1.01        1.00       1.00
    pellicle --help                         0.28    0.28        0.31       0.28
    R by a recipe                           1.99    2.19        2.21       2.18
    R, CSV by flags                         1.97    2.18        2.19       2.17
    psi and delta, recipe                   2.00    2.10        2.21       2.09
    R by a recipe, --out                    2.96    3.16        3.28       3.14
    R by a recipe, empty cache              2.01    2.20        2.23       2.19
    R, CSV by flags, empty cache            1.92    2.12        2.13       2.11
    psi and delta, recipe, empty cache      2.03    2.13        2.25       2.12

`--programs` has the programs of `pl.fit` of four scenes instead, each in a new process with an empty cache:
lines of StableHLO and of optimised HLO, and processor time (s) of tracing with lowering and of compilation.
Only two layers compile anything. On another day, where bare JAX takes 0.72 s of processor time:

                                     StableHLO       HLO   trace compile
    R, thickness                                                    0.36
    psi and delta, Cauchy                                           0.98
    psi and delta, two layers                                       2.13
        equations                         2371      5831    0.49    0.66
    tilted axis                                                     0.41

Before NumPy took slopes by differences, the first three took 0.85, 2.0 and 2.65 s on that day.
"""

from __future__ import annotations

import argparse
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
RECIPE = ("--recipe", "measurements/recipes/hematite_on_glass_140nm.toml")
OXIDE = (
    "docs/examples/oxide_um_percent.csv",
    "--layer",
    "SiO2",
    "--substrate",
    "Si",
    "--thickness",
    "10:1000",
)
FITS = {
    "R by a recipe": RECIPE,
    "R, CSV by flags": OXIDE,
    "psi and delta, recipe": ("--recipe", "fits/brush_15-1-1/recipe.toml"),
}
BARE = "import jax, jax.numpy as jnp; jnp.ones(3).sum().block_until_ready()"
PELLICLE = "import sys; from pellicle.cli import main; sys.exit(main())"
SCENES = ("R, thickness", "psi and delta, Cauchy", "psi and delta, two layers", "tilted axis")
GOOD = (0, 4)
"""Exit codes of a fit that was made: one answer, no clear answer."""


def times_of(command: list[str], environment: dict[str, str]) -> tuple[float, float]:
    """Return the wall and processor time (s) of one process."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    began = time.perf_counter()
    ran = subprocess.run(command, cwd=ROOT, env=environment, check=False, capture_output=True)
    wall = time.perf_counter() - began
    if ran.returncode not in GOOD:
        raise RuntimeError(ran.stderr.decode())
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def pellicle(*words: str) -> list[str]:
    """The command in this interpreter."""
    return [sys.executable, "-c", PELLICLE, *words]


def first_fit(name: str) -> None:
    """Fit one of `SCENES` in this process and print a line for each program and for the whole fit."""
    import jax
    import numpy as np
    from whole_fits.cases import cases, measurement

    import pellicle as pl
    from pellicle.programs import cache

    lines, began, names = [], [0.0], [""]
    load, make, compile_ = cache._load, cache.make, jax.stages.Lowered.compile

    def named(function, *rest):
        names[0] = function.__qualname__
        return load(function, *rest)

    def timed(*arguments):
        began[0] = time.process_time()
        return make(*arguments)

    def counted(lowered, *arguments, **options):
        traced, own = time.process_time() - began[0], lowered.as_text().count("\n")
        at = time.process_time()
        compiled = compile_(lowered, *arguments, **options)
        took = time.process_time() - at
        if lowered.as_text().startswith("module @jit_program_"):  # no trial of options
            lines.append((names[0], own, str(compiled.as_text()).count("\n"), traced, took))
        return compiled

    cache._load, cache.make = named, timed
    stages: Any = jax.stages
    stages.Lowered.compile = counted
    if name == SCENES[-1]:

        def tilted(*angles, thickness, azimuth=None):
            film = pl.Layer(pl.Anisotropic(1.6, 1.75, axis=angles), thickness)
            return pl.Scene(film, "BK7", light=pl.Light(angle=60.0, signal="psi-delta", azimuth=azimuth))

        truth = tilted(40.0, 25.0, thickness=240.0, azimuth=np.repeat([0.0, 45.0, 90.0], 64))
        data = pl.simulate(truth, np.tile(np.linspace(400.0, 800.0, 64), 3), noise=0.05, seed=5)
        scene = tilted(pl.Free(10, 80), pl.Free(0, 90), thickness=pl.Free(100, 400))
    else:
        case = cases()[(0, 3, 6)[SCENES.index(name)]]
        data, scene = measurement(case, 0).spectrum, case.scene
    with tempfile.TemporaryDirectory() as folder:
        jax.config.update("jax_compilation_cache_dir", folder)
        at = time.process_time()
        pl.fit(data, scene)
    print(f"{name:<52}{time.process_time() - at:>16.2f}")
    for program, *sizes in lines:
        print("    {:<28}{:>10}{:>10}{:>8.2f}{:>8.2f}".format(program, *sizes))


def programs() -> None:
    """Print the programs of each first fit."""
    print(f"{'':<32}{'StableHLO':>10}{'HLO':>10}{'trace':>8}{'compile':>8}", flush=True)
    for name in SCENES:
        subprocess.run([sys.executable, __file__, "--first-fit", name], check=True)


def main(rounds: int) -> None:
    """Measure and print the table."""
    with tempfile.TemporaryDirectory() as folder:
        environment = os.environ | {
            "PELLICLE_CACHE": f"{folder}/cache",
            "PYTHONPYCACHEPREFIX": f"{folder}/code",
        }
        environment.pop("PYTHONDONTWRITEBYTECODE", None)  # an installed package has its bytecode
        commands = {
            "bare JAX": [sys.executable, "-c", BARE],
            "pellicle --help": pellicle("--help"),
            **{name: pellicle("fit", *words) for name, words in FITS.items()},
            "R by a recipe, --out": pellicle("fit", *RECIPE, "--out", f"{folder}/out"),
        }
        times_of(pellicle("fit", *RECIPE, "--out", f"{folder}/out"), environment | {"PELLICLE_CACHE": "off"})
        rows: dict[str, list[tuple[float, float]]] = {name: [] for name in commands}
        for name, words in FITS.items():
            own = environment | {"PELLICLE_CACHE": f"{folder}/{name}"}
            rows[f"{name}, empty cache"] = [times_of(pellicle("fit", *words), own)]
            times_of(commands[name], environment)
        for _ in range(rounds):
            for name, command in commands.items():
                rows[name].append(times_of(command, environment))
    medians = {name: [statistics.median(c) for c in zip(*times, strict=True)] for name, times in rows.items()}
    print(f"{'':<36}{'wall s':>8}{'cpu s':>8}{'wall ratio':>12}{'cpu ratio':>11}")
    bare = medians["bare JAX"]
    for name, (wall, cpu) in medians.items():
        print(f"{name:<36}{wall:>8.2f}{cpu:>8.2f}{wall / bare[0]:>12.2f}{cpu / bare[1]:>11.2f}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--programs", action="store_true", help="the programs of first fits")
    parser.add_argument("--first-fit", choices=SCENES, help="those of one scene, in this process")
    asked = parser.parse_args()
    if asked.first_fit:
        first_fit(asked.first_fit)
    elif asked.programs:
        programs()
    else:
        main(asked.rounds)
