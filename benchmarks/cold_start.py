"""Start-up time: a complete `pellicle fit` in a new process, compared with JAX and one operation.

Run `python benchmarks/cold_start.py`. The first fit starts with an empty cache, later fits with a
filled one. The commands take turns; the table gives medians of processor and wall time (s), and the
ratio of a fit with a filled cache to bare JAX.
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
RECIPE = ROOT / "measurements" / "recipes" / "hematite_on_glass_140nm.toml"
BARE = "import jax, jax.numpy as jnp; jnp.ones(3).sum().block_until_ready()"
PELLICLE = "import sys; from pellicle.cli import main; sys.exit(main())"


def times_of(command: list[str], environment: dict[str, str]) -> tuple[float, float]:
    """Return the processor and wall time (s) of one process."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    began = time.perf_counter()
    subprocess.run(command, env=environment, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    wall = time.perf_counter() - began
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, wall


def main(rounds: int) -> None:
    with tempfile.TemporaryDirectory() as cache:
        environment = os.environ | {"PELLICLE_CACHE": cache}
        fit = [sys.executable, "-c", PELLICLE, "fit", "--recipe", str(RECIPE), "--json"]
        commands = {
            "bare jax": [sys.executable, "-c", BARE],
            "pellicle --help": [sys.executable, "-c", PELLICLE, "--help"],
            "fit, cache filled": fit,
        }
        print(f"{'':<22}{'cpu s':>8}{'wall s':>8}")
        first = times_of(fit, environment)
        print(f"{'fit, cache empty':<22}{first[0]:>8.2f}{first[1]:>8.2f}")
        times: dict[str, list[tuple[float, float]]] = {name: [] for name in commands}
        for _ in range(rounds):
            for name, command in commands.items():
                times[name].append(times_of(command, environment))
    medians = {
        name: [statistics.median(column) for column in zip(*t, strict=True)] for name, t in times.items()
    }
    for name, (cpu, wall) in medians.items():
        print(f"{name:<22}{cpu:>8.2f}{wall:>8.2f}")
    ratios = [a / b for a, b in zip(medians["fit, cache filled"], medians["bare jax"], strict=True)]
    print(
        f"fit with filled cache / bare jax: {ratios[0]:.2f} in processor time, {ratios[1]:.2f} in wall time"
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=7)
    main(parser.parse_args().rounds)
