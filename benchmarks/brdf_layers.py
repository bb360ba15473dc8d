"""Fits of measured BRDFs with a layer, without interference and with two lobes.

Run `python benchmarks/brdf_layers.py FOLDER`: every CSV of BRDF samples in it is fitted with both layered
models; the output is the table of fits/brdf/README.md. Directions beyond 70 degrees are left out, and at
most 1000 samples of a file are used, spread evenly over it.
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


SHARED = {"specular": pl.Free(0, 100), "diffuse": pl.Free(0, 2)}
LOBES = {
    "thickness": pl.Free(0, 1000),
    "n": pl.Free(1.05, 2.5),
    "exponent_reflection": pl.Free(1, 1000),
    "exponent_transmission": pl.Free(1, 1000),
    "deviation": pl.Free(0, 20),
    "azimuth": pl.Free(-180, 180),
    **SHARED,
}
FACETS = {
    "thickness": pl.Free(0, 1500),
    "n": pl.Free(1.1, 2.8),
    "base_n": pl.Free(1.05, 4),
    "base_k": pl.Free(0, 6),
    "roughness": pl.Free(0.003, 1),
    **SHARED,
}
MODELS = {"granier-heidrich": LOBES, "microfacet-film": FACETS}


def read_samples(path: Path) -> BrdfSamples:
    """Read the samples of a file within `STEEPEST`, thinned; columns that are no colours are skipped."""
    header = next(line for line in path.read_text().splitlines() if not line.startswith("#")).split(",")
    samples = pl.read_brdf_samples(path, columns=",".join([*header[:7], *"_" * (len(header) - 7)]))
    steep = np.maximum(samples.theta_i, samples.theta_o) > STEEPEST
    return samples.at(np.flatnonzero(~steep)).thinned(MOST)


def wavelengths(path: Path) -> tuple[float, ...]:
    """Return the wavelengths of R, G and B: PTFE was measured with two lasers, the others with cameras."""
    return (633.0, 532.0, 532.0) if "633_532" in path.name else (645.0, 525.0, 445.0)


def main(folder: Path) -> None:
    print("| samples | model | held-out error | without interference | two lobes | layer | status | why |")
    print("|---|---|---|---|---|---|---|---|")
    for path in sorted(folder.glob("*.csv")):
        if not path.read_text()[:2000].count("theta_i"):
            continue
        for model, numbers in MODELS.items():
            fit = pl.fit(read_samples(path), pl.Surface(model, numbers, wavelengths(path)))
            errors = [fit.held_out, *(b.held_out for b in fit.baselines)]
            cells = " | ".join(f"{error:.4f}" for error in errors)
            layer = "yes" if fit.layered else "no"
            print(f"| {path.stem} | {model} | {cells} | {layer} | {fit.status} | {fit.verdict} |", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    main(parser.parse_args().folder)
