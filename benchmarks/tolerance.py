"""Check of the error bounds of plans on random scenes of films.

At new random points between the bounds of each scene the planned model is compared with the exact one.
Run as `python benchmarks/tolerance.py [--scenes 1000]` (`make tolerance`).
"""

from __future__ import annotations

import argparse
import collections
import sys
import time
from typing import Any, NamedTuple

import jax
import numpy as np

import pellicle as pl
from pellicle.effects.differences import largest_difference, signals
from pellicle.effects.film_plan import full_plan
from pellicle.forward_model.film_signal import build, tabulated
from pellicle.forward_model.plan import Plan
from pellicle.scene.free import free_leaves

FRESH = 400
"""Number of points per scene at which the bound is checked."""


class Drawn(NamedTuple):
    """A scene with a tolerance in the unit of its signal."""

    name: str
    scene: pl.Scene
    tolerance: float


def draw(rng: np.random.Generator) -> Drawn:
    """Draw one of ten kinds of scene with random numbers and bounds."""
    kind = str(rng.choice(list(KINDS)))
    wavelength = np.linspace(*sorted(rng.uniform(400, 900, 2)), 7)
    scene = KINDS[kind](rng, wavelength)
    unit = 10.0 if scene.light.signal == "psi-delta" else 1.0
    return Drawn(kind, scene, unit * 10 ** rng.uniform(-5, -2))


def free(rng: np.random.Generator, low: float, high: float) -> pl.Free:
    lower, upper = sorted(rng.uniform(low, high, 2))
    return pl.Free(lower, upper + 1e-3 * (high - low))


def weak(rng: np.random.Generator) -> float:
    """Draw a small number, uniform in its logarithm."""
    return float(10 ** rng.uniform(-9, 0))


def cauchy(rng: np.random.Generator) -> Any:
    return pl.dispersion.Cauchy(rng.uniform(1.3, 2.5), rng.uniform(0, 2e4) * weak(rng))


def absorbing(rng: np.random.Generator) -> complex:
    return complex(rng.uniform(1.3, 2.5), weak(rng))


def _coating(rng, wavelength):
    layer = pl.Layer(absorbing(rng), free(rng, 0, 2000))
    return pl.Scene(layer, cauchy(rng), light=pl.Light(wavelength, 50 * weak(rng)))


def _fitted_index(rng, wavelength):
    material = pl.dispersion.Constant(free(rng, 1.3, 2.5), free(rng, 0, weak(rng)))
    light = pl.Light(wavelength, 60 * weak(rng), polarisation=str(rng.choice(["s", "p", "unpolarised"])))
    return pl.Scene(pl.Layer(material, free(rng, 0, 900)), absorbing(rng), light=light)


def _plate(rng, wavelength):
    glass = complex(rng.uniform(1.4, 1.8), 1e-3 * weak(rng))
    layer = pl.Layer(absorbing(rng), free(rng, 0, 900))
    return pl.Scene(layer, pl.Substrate(glass, "air"), light=pl.Light(wavelength, 50 * weak(rng)))


def _through_a_plate(rng, wavelength):
    scene = _plate(rng, wavelength)
    return pl.Scene(scene.layers, scene.substrate, light=pl.Light(wavelength, signal="T"))


def _metal_on(rng, wavelength):
    metal = pl.Layer(complex(rng.uniform(0.1, 3), rng.uniform(0.5, 4)), rng.uniform(20, 500))
    layers = [pl.Layer(cauchy(rng), free(rng, 0, 900)), metal]
    return pl.Scene(layers, cauchy(rng), light=pl.Light(wavelength))


def _rough(rng, wavelength):
    layer = pl.Layer(cauchy(rng), free(rng, 0, 900), roughness=10 * weak(rng))
    return pl.Scene(layer, 3.9 + 0.02j, light=pl.Light(wavelength, 40 * weak(rng)))


def _bandwidth(rng, wavelength):
    layer = pl.Layer(absorbing(rng), free(rng, 0, 2000))
    instrument = pl.Instrument(bandwidth=10 * weak(rng))
    return pl.Scene(layer, cauchy(rng), light=pl.Light(wavelength), instrument=instrument)


def _uneven(rng, wavelength):
    layer = pl.Layer(cauchy(rng), free(rng, 50, 2000), thickness_spread=15 * weak(rng))
    return pl.Scene(layer, 3.9 + 0.02j, light=pl.Light(wavelength, 40 * weak(rng)))


def _microscope(rng, wavelength):
    layer = pl.Layer(cauchy(rng), free(rng, 0, 1500))
    instrument = pl.Instrument(numerical_aperture=0.5 * weak(rng))
    return pl.Scene(layer, 3.9 + 0.02j, light=pl.Light(wavelength), instrument=instrument)


def _ellipsometry(rng, wavelength):
    layer = pl.Layer(absorbing(rng), free(rng, 0, 500))
    instrument = pl.Instrument(bandwidth=5 * weak(rng))
    light = pl.Light(wavelength, rng.uniform(45, 75), signal="psi-delta")
    return pl.Scene(layer, 3.9 + 0.02j, light=light, instrument=instrument)


KINDS = {
    "coating": _coating,
    "fitted index": _fitted_index,
    "plate": _plate,
    "through a plate": _through_a_plate,
    "metal below": _metal_on,
    "rough": _rough,
    "bandwidth": _bandwidth,
    "uneven": _uneven,
    "microscope": _microscope,
    "ellipsometry": _ellipsometry,
}


def fresh(rng: np.random.Generator, scene: pl.Scene) -> np.ndarray:
    """Draw points between the bounds, which the plan did not use."""
    bounds = [(leaf.lower, leaf.upper) for _, leaf in free_leaves(scene)]
    return np.stack([rng.uniform(*b, FRESH) for b in bounds], axis=1)


def measured(plan: Plan, scene: pl.Scene, points: np.ndarray) -> float:
    """Return the largest error of a plan at these points, in the unit of the signal."""
    whole = tabulated(scene)
    one, other = (signals(p, whole, points, build) for p in (plan, full_plan(scene)))
    return largest_difference(one, other, plan.degrees)


def main() -> int:
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--scenes", type=int, default=1000)
    arguments.add_argument("--seed", type=int, default=0)
    given = arguments.parse_args()
    jax.config.update("jax_enable_x64", True)
    rng, start = np.random.default_rng(given.seed), time.monotonic()
    ratios, gone, broken = [], collections.Counter(), 0
    for number in range(given.scenes):
        name, scene, tolerance = draw(rng)
        plan = pl.plan(scene, tolerance)
        error, bound = measured(plan, scene, fresh(rng, scene)), plan.error_bound
        gone.update(left_out.effect for left_out in plan.left_out)
        if plan.left_out:
            ratios.append(error / max(bound, 1e-15))
        if error > bound or bound > tolerance:
            broken += bool(error > bound)
            print(f"{number} {name}: error {error:.2g}, bound {bound:.2g}, tolerance {tolerance:.2g}\n{plan}")
        if (number + 1) % 50 == 0:
            print(f"{number + 1} scenes, {time.monotonic() - start:.0f} s", file=sys.stderr, flush=True)
    print(f"{given.scenes} scenes, {len(ratios)} with something left out: " + str(dict(gone)))
    print(
        f"error over bound: median {np.median(ratios):.2f}, largest {np.max(ratios):.2f}; {broken} violated"
    )
    return int(broken > 0)


if __name__ == "__main__":
    sys.exit(main())
