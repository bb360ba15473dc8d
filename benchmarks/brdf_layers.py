"""Do measured BRDFs call for a layer? Each against the same surface without interference and two lobes.

Run `python benchmarks/brdf_layers.py FOLDER`: every CSV of BRDF samples in it is fitted with both layered
models, and the table of fits/brdf/README.md comes out. Directions beyond 70 degrees are left out, and at
most 1000 samples of a file are kept, spread over it.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import jax
import numpy as np

import pellicle as pl
from pellicle.data.brdf_samples import BrdfSamples

jax.config.update("jax_enable_x64", True)

STEEPEST = 70.0
MOST = 1000


def between(lower: float, upper: float) -> pl.Free:
    return pl.Free(lower, upper)


SHARED = {"specular": between(0, 100), "diffuse": between(0, 2)}
LOBES = {
    "thickness": between(0, 1000),
    "n": between(1.05, 2.5),
    "exponent_reflection": between(1, 1000),
    "exponent_transmission": between(1, 1000),
    "deviation": between(0, 20),
    "azimuth": between(-180, 180),
    **SHARED,
}
FACETS = {
    "thickness": between(0, 1500),
    "n": between(1.1, 2.8),
    "base_n": between(1.05, 4),
    "base_k": between(0, 6),
    "roughness": between(0.003, 1),
    **SHARED,
}
MODELS = {"granier-heidrich": LOBES, "microfacet-film": FACETS}


def samples(path: Path) -> BrdfSamples:
    """The samples of a file within `STEEPEST`, thinned; a column that is no colour is skipped."""
    header = next(line for line in path.read_text().splitlines() if not line.startswith("#")).split(",")
    found = pl.read_brdf_samples(path, columns=",".join([*header[:7], *"_" * (len(header) - 7)]))
    steep = np.maximum(found.theta_i, found.theta_o) > STEEPEST
    return found.at(np.flatnonzero(~steep)).thinned(MOST)


def wavelengths(path: Path) -> tuple[float, ...]:
    """Those of R, G and B: PTFE was measured with two lasers, the others by cameras."""
    return (633.0, 532.0, 532.0) if "633_532" in path.name else (645.0, 525.0, 445.0)


def main(folder: Path) -> None:
    print("| samples | model | held-out error | without interference | two lobes | layer | status | why |")
    print("|---|---|---|---|---|---|---|---|")
    for path in sorted(folder.glob("*.csv")):
        if not path.read_text()[:2000].count("theta_i"):
            continue
        for model, numbers in MODELS.items():
            fit = pl.fit(samples(path), pl.Surface(model, numbers, wavelengths(path)))
            errors = [fit.held_out, *(b.held_out for b in fit.baselines)]
            told = " | ".join(f"{error:.4f}" for error in errors)
            layer = "yes" if fit.layered else "no"
            print(f"| {path.stem} | {model} | {told} | {layer} | {fit.status} | {fit.verdict} |", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    main(parser.parse_args().folder)
