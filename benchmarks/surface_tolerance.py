"""Check of the error bounds of plans on random surfaces.

At new random points between the bounds of each surface, and in directions that the plan did not use, the
planned BRDF is compared with the exact one. Run as `python benchmarks/surface_tolerance.py [--surfaces 100]`.
"""

from __future__ import annotations

import argparse
import collections
import sys
import time
from typing import Any

import jax
import numpy as np

from pellicle.effects import surface_plan
from pellicle.effects.differences import signals
from pellicle.effects.surface_plan import exact
from pellicle.forward_model.surface_signal import build
from pellicle.scene.free import Free, free_leaves
from pellicle.scene.surface import Surface, surface_view
from pellicle.simulation.brdf import default_directions

FRESH = 64
"""Number of points per surface at which the bound is checked."""
PLANNED = default_directions(1000)


def weak(rng: np.random.Generator) -> float:
    """Draw a small number, uniform in its logarithm."""
    return float(10 ** rng.uniform(-8, 0))


def between(rng: np.random.Generator, low: float, high: float) -> Free:
    lower, upper = sorted(rng.uniform(low, high, 2))
    return Free(lower, upper + 1e-3 * (high - low))


def facets(rng: np.random.Generator) -> Surface:
    numbers: dict[str, Any] = {
        "thickness": between(rng, 0, 1500),
        "n": rng.uniform(1.2, 2.9),
        "k": weak(rng),
        "base_n": rng.uniform(1.1, 4),
        "base_k": rng.choice([0.0, rng.uniform(0, 6)]),
        "roughness": between(rng, 0.05, 0.8),
        "diffuse": weak(rng),
    }
    return Surface("microfacet-film", numbers)


def shader(rng: np.random.Generator) -> Surface:
    numbers = {
        "thickness": between(rng, 0, 1500),
        "n": between(rng, 1.1, 2.5),
        "base_n": rng.uniform(1.1, 2.5),
        "exponent": rng.uniform(1, 200),
        "diffuse": weak(rng),
    }
    return Surface("blinn-phong-film", numbers)


def lobes(rng: np.random.Generator) -> Surface:
    numbers = {
        "thickness": between(rng, 0, 1000),
        "n": rng.uniform(1.2, 2.2, 3).tolist(),
        "exponent_reflection": between(rng, 1, 200),
        "exponent_transmission": rng.uniform(1, 200),
        "deviation": 10 * weak(rng),
        "azimuth": rng.uniform(-180, 180),
        "diffuse": weak(rng),
    }
    kinds = ["granier-heidrich", "granier-heidrich-reciprocal", "granier-heidrich-full"]
    return Surface(str(rng.choice(kinds)), numbers)


KINDS = {"facets": facets, "shader": shader, "lobes": lobes}


def tried(rng: np.random.Generator, surface: Surface, tolerance: float) -> tuple[set[str], float, float]:
    """Return what the plan leaves out, its error, and its stated bound."""
    plan = surface_plan.plan(surface_view(surface, PLANNED), tolerance)
    whole = surface_view(surface, PLANNED, len(PLANNED.theta_i))
    free = [leaf for _, leaf in free_leaves(whole)]
    low, high = (np.array([getattr(f, side) for f in free]) for side in ("lower", "upper"))
    points = rng.uniform(low, high, (FRESH, len(free)))
    with jax.enable_x64(True):
        true, found = (signals(each, whole, points, build) for each in (exact(whole), plan))
    off = np.max(np.abs(found - true) / np.maximum(true, surface_plan.FLOOR))
    gone = {left_out.effect for left_out in plan.left_out}
    gone |= {f"{row.count} angles" for row in plan.rows if row.effect == "oblique" and row.count}
    return gone, float(off), plan.error_bound


def main(surfaces: int, seed: int) -> int:
    rng, began = np.random.default_rng(seed), time.perf_counter()
    left_out: collections.Counter[str] = collections.Counter()
    failures, shares = [], []
    for number in range(surfaces):
        kind, tolerance = str(rng.choice(list(KINDS))), 10 ** rng.uniform(-5, -1)
        gone, off, bound = tried(rng, KINDS[kind](rng), tolerance)
        left_out.update(gone)
        print(f"{number + 1} of {surfaces}: {kind}, error {off:.1e}", file=sys.stderr, flush=True)
        if gone:
            shares.append(off / bound)
        if off > bound or bound > tolerance:
            failures.append(f"{number} {kind}: error {off:.2g}, bound {bound:.2g}, tolerance {tolerance:.2g}")
    took = time.perf_counter() - began
    print(f"{surfaces} surfaces in {took:.0f} s; left out: {dict(left_out.most_common())}")
    print(f"error over bound: median {np.median(shares):.2f}, largest {np.max(shares):.2f}")
    print(*failures, sep="\n")
    print(f"{len(failures)} exceed their bound or tolerance")
    return bool(failures)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--surfaces", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    sys.exit(main(given.surfaces, given.seed))
