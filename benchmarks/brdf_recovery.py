"""Known surfaces with noise of 1 %: how often each parameter is found within its reported error.

Run `python benchmarks/brdf_recovery.py [--runs 100] [--noise 0.01] [MODEL ...]`. A surface is drawn at
random, seen in 200 directions in the plane of incidence (five angles, 40 directions each), and fitted
with every number in the table free. `found` is the share of runs that end in the right minimum (reduced
χ² below 1.3); the others are shares of all runs within two and within three reported errors: 95.4 and
99.7 % where errors are what they say.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable
from typing import Any

import jax
import numpy as np

from pellicle.brdf import direction
from pellicle.brdf_fitting.estimates import estimates, local
from pellicle.brdf_fitting.fit import problem
from pellicle.brdf_fitting.search import THOROUGH, search
from pellicle.fitting.search import quiet
from pellicle.free import Free
from pellicle.io.samples import BrdfSamples
from pellicle.surfaces.surface import Surface

jax.config.update("jax_enable_x64", True)

INCIDENCES = (10.0, 25.0, 40.0, 55.0, 70.0)
RIGHT = 1.3


def between(lower: float, upper: float) -> Free:
    return Free(lower=lower, upper=upper)


WEIGHTS = {"specular": between(0, 100), "diffuse": between(0, 2)}
SURFACES = {
    "granier-heidrich": Surface(
        "granier-heidrich",
        {
            "thickness": between(0, 1000),
            "n": between(1.05, 2.5),
            "exponent_reflection": between(1, 1000),
            "exponent_transmission": between(1, 1000),
            "deviation": between(0, 20),
            "azimuth": between(-180, 180),
            **WEIGHTS,
        },
    ),
    "microfacet-film": Surface(
        "microfacet-film",
        {
            "thickness": between(0, 1500),
            "n": between(1.1, 2.8),
            "base_n": 2.7,
            "base_k": 2.8,
            "roughness": between(0.003, 1),
            **WEIGHTS,
        },
    ),
    "blinn-phong-film": Surface(
        "blinn-phong-film",
        {
            "thickness": between(0, 1500),
            "n": between(1.1, 2.8),
            "base_n": 2.0,
            "exponent": between(1, 1000),
            **WEIGHTS,
        },
    ),
}


def drawn(rng: np.random.Generator, surface: Surface) -> dict[str, Any]:
    """A random truth, away from the bounds."""

    def log(lower, upper):
        return math.exp(rng.uniform(math.log(lower), math.log(upper)))

    ways: dict[str, Callable[[], Any]] = {
        "thickness": lambda: rng.uniform(80, 900),
        "n": lambda: rng.uniform(1.3, 1.8) + np.array([0.0, 0.02, 0.05]) * (surface.model[0] == "g"),
        "exponent_reflection": lambda: log(10, 300),
        "exponent_transmission": lambda: log(10, 300),
        "exponent": lambda: log(10, 300),
        "deviation": lambda: rng.uniform(1, 12),
        "azimuth": lambda: rng.uniform(20, 160),
        "roughness": lambda: log(0.05, 0.5),
        "specular": lambda: log(0.3, 5),
        "diffuse": lambda: rng.uniform(0.02, 0.3),
    }
    free = {key: ways[key]() for key, number in surface.numbers.items() if isinstance(number, Free)}
    if surface.model != "granier-heidrich":
        free["n"] = float(np.mean(free["n"]))
    return {**surface.fixed(), **free}


def seen(surface: Surface, truth: dict[str, Any], noise: float, rng: np.random.Generator) -> BrdfSamples:
    """Samples of the truth in the plane of incidence, with a relative noise that is known."""
    across = np.tile(np.linspace(-78, 78, 40), len(INCIDENCES))
    theta_i, theta_o = np.repeat(INCIDENCES, 40), np.abs(across)
    phi_i, phi_o = np.zeros(200), np.where(across > 0, 180.0, 0.0)
    rho = np.asarray(surface.brdf(truth, direction(theta_i, phi_i), direction(theta_o, phi_o)))
    values = np.abs(rho * (1 + noise * rng.standard_normal(rho.shape)))
    return BrdfSamples(theta_i, phi_i, theta_o, phi_o, values, ("R", "G", "B"), sigma=noise * rho)


def deviations(surface: Surface, noise: float, seed: int) -> tuple[float, dict[str, float]]:
    """Reduced χ², and each free number's distance from the truth in reported errors."""
    rng = np.random.default_rng(seed)
    truth = drawn(rng, surface)
    samples = seen(surface, truth, noise, rng)
    whole = problem(samples, surface, "linear", surface.brdf.evaluate)
    minima = search(whole, THOROUGH, quiet)
    at = local(whole, minima.units[0], sigma_known=True)
    found = estimates(surface, whole, minima.units[0], at)
    true = {leaf.name: np.ravel(truth[leaf.key])[leaf.channel or 0] for leaf in surface.leaves()}
    return at.chi2_reduced, {k: float((found[k].value - x) / found[k].stderr) for k, x in true.items()}


def study(name: str, runs: int, noise: float) -> None:
    surface, began = SURFACES[name], time.perf_counter()
    results = [deviations(surface, noise, seed) for seed in range(runs)]
    right = np.mean([chi2 < RIGHT for chi2, _ in results])
    seconds = (time.perf_counter() - began) / runs
    print(f"\n{name}: {runs} runs, noise {100 * noise:g} %, {seconds:.1f} s each; found {100 * right:.0f} %")
    print(f"{'':<24}{'within 2 errors':>16}{'within 3':>10}")
    for leaf in surface.leaves():
        z = np.abs([each[leaf.name] for _, each in results])
        print(f"{leaf.name:<24}{100 * np.mean(z <= 2):>14.0f} %{100 * np.mean(z <= 3):>8.0f} %", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("models", nargs="*", choices=[[], *SURFACES], default=[])
    parser.add_argument("--runs", type=int, default=100)
    parser.add_argument("--noise", type=float, default=0.01)
    given = parser.parse_args()
    for each in given.models or SURFACES:
        study(each, given.runs, given.noise)
