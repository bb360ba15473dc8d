"""Check of the stated errors of the slices of graded layers on random profiles.

Each scene has a graded layer of random media, profile and bounds. At new random points between the bounds, at
every wavelength, its signals are compared with those of four times as many slices. Run as
`python benchmarks/slices.py [--scenes 1000]`.
"""

from __future__ import annotations

import argparse
import collections
import sys
import time

import jax
import numpy as np

import pellicle as pl
from pellicle.effects.gradient import GRADIENT_ERROR, gradient, signals
from pellicle.scene.free import free_leaves, insert

FRESH = 6
"""Number of points per scene at which the error is measured."""
FINER = 4


def number(rng: np.random.Generator, low: float, high: float) -> float | pl.Free:
    """Draw a free number with random bounds, or with the probability of a half a fixed one."""
    lower, upper = sorted(rng.uniform(low, high, 2))
    return pl.Free(lower, upper) if rng.random() < 0.5 else lower


def profile(rng: np.random.Generator) -> pl.profile.AbstractProfile:
    """Draw a profile of any kind."""
    top, bottom = number(rng, 0, 1), number(rng, 0, 1)
    kind = rng.integers(5)
    if kind == 0:
        return pl.profile.Linear(top, bottom)
    if kind == 1:
        return pl.profile.Exponential(top, bottom, number(rng, 0.02, 2) if rng.random() < 0.5 else -0.1)
    if kind == 2:
        return pl.profile.Power(top, bottom, number(rng, 0.3, 4))
    if kind == 3:
        return pl.profile.Spline([number(rng, 0, 1) for _ in range(rng.integers(2, 9))])
    return pl.profile.Sine(0.5, number(rng, 0, 0.5), number(rng, 0.5, 20), rng.uniform())


def transparent(rng: np.random.Generator) -> complex | float:
    return rng.uniform(1.3, 2.6)


def absorbing(rng: np.random.Generator) -> complex | float:
    return complex(rng.uniform(1.3, 3.0), 10 ** rng.uniform(-4, 0))


def metal(rng: np.random.Generator) -> complex | float:
    """Between it and a dielectric the real part of ε passes through 0."""
    return complex(rng.uniform(0.1, 2.5), rng.uniform(1.5, 5))


KINDS = {
    "transparent": (transparent, transparent),
    "absorbing": (transparent, absorbing),
    "metal": (transparent, metal),
    "metal, p": (transparent, metal),
}


def draw(rng: np.random.Generator) -> tuple[str, pl.Scene]:
    """Draw a graded layer on a substrate, below another layer half of the time."""
    kind = str(rng.choice(list(KINDS)))
    media = [make(rng) for make in KINDS[kind]]
    rng.shuffle(media)
    mix = "linear" if kind.startswith("metal") else str(rng.choice(["linear", "bruggeman", "looyenga"]))
    layers = [pl.Layer(pl.Graded(*media, profile(rng), mix=mix), number(rng, 20, 1500))]
    if rng.random() < 0.5:
        layers.insert(0, pl.Layer(absorbing(rng), number(rng, 5, 300), name="cover"))
    signal = str(rng.choice(["R", "T", "psi-delta"]))
    angle = 0.0 if kind == "metal" else rng.uniform(20, 80)
    light = pl.Light(
        np.linspace(*sorted(rng.uniform(350, 1200, 2)), 40), angle, "R" if angle == 0 else signal
    )
    ambient = 1.0 if rng.random() < 0.7 else 1.52
    return kind, pl.Scene(layers, transparent(rng), ambient=ambient, light=light)


def measured(scene: pl.Scene, count: int, rng: np.random.Generator) -> float:
    """Return the largest error of a signal at new points, in degrees for Ψ and Δ."""
    bounds = [(leaf.lower, leaf.upper) for _, leaf in free_leaves(scene)]
    largest = 0.0
    for _ in range(FRESH if bounds else 1):
        numbers = insert(scene, [rng.uniform(*each) for each in bounds])
        # R, T and such of both polarisations, and for an ellipsometer N, C and S
        apart = np.abs(signals(numbers, count) - signals(numbers, FINER * count))
        largest = max(largest, float(np.nanmax(apart)))
    return float(np.rad2deg(largest)) if scene.light.signal == "psi-delta" else largest


def main() -> int:
    """Print how often the stated error is exceeded, by kind."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    rng, start = np.random.default_rng(given.seed), time.process_time()
    ratios: dict[str, list[float]] = collections.defaultdict(list)
    missed: collections.Counter[str] = collections.Counter()
    for position in range(given.scenes):
        kind, scene = draw(rng)
        row = gradient(scene)
        error, bound = measured(scene, row.count, rng), row.error_bound
        ratios[kind].append(error / max(bound, 1e-15))
        limit = np.rad2deg(GRADIENT_ERROR) if scene.light.signal == "psi-delta" else GRADIENT_ERROR
        missed[kind] += bound > limit
        if error > bound:
            print(f"{position} {kind}: error {error:.2g}, stated {bound:.2g}, {row.count} slices\n{scene}")
        if (position + 1) % 100 == 0:
            print(f"{position + 1} scenes, {time.process_time() - start:.0f} s", file=sys.stderr, flush=True)
    print(
        "| graded layer | scenes | error over stated error, median | largest | exceeded | stated above 1e-6 |"
    )
    print("|---|---|---|---|---|---|")
    for kind in KINDS:
        each = np.array(ratios[kind])
        if each.size:
            print(
                f"| {kind} | {each.size} | {np.median(each):.2g} | {np.max(each):.2g} "
                f"| {np.sum(each > 1)} | {missed[kind]} |"
            )
    return int(any(np.max(x) > 1 for x in ratios.values()))


if __name__ == "__main__":
    sys.exit(main())
