"""Start-up time: complete `pellicle fit` commands in new processes, compared with JAX and one operation.

Run `python benchmarks/cold_start.py`. First fits start with an empty cache of programs, later
ones with a filled cache. The commands take turns; the table gives medians of wall and processor time (s), and
their ratios to bare JAX, the least that any program of JAX takes.

Linux, 2 cores that did nothing else; JAX 0.10.2, Python 3.11, medians of 5:

                                          wall s   cpu s  wall ratio  cpu ratio
    bare JAX                                0.63    0.73        1.00       1.00
    pellicle --help                         0.17    0.16        0.26       0.23
    R by a recipe                           1.37    1.68        2.18       2.31
    R, CSV by flags                         1.53    1.83        2.44       2.51
    psi and delta, recipe                   1.55    1.65        2.47       2.26
    R by a recipe, --out                    2.29    2.58        3.65       3.54
    R by a recipe, empty cache              3.98    4.92        6.34       6.76
    R, CSV by flags, empty cache            3.95    5.03        6.31       6.91
    psi and delta, recipe, empty cache      5.40    6.63        8.61       9.11
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
    main(parser.parse_args().rounds)
