"""Recovery of known surfaces by BRDF fits: how often each parameter lies within its reported error.

Run `python benchmarks/brdf_recovery.py [--runs 100] [--noise 0.01] [MODEL ...]`; it prints the tables of
docs/brdf_recovery.md. Each surface is drawn at random, sampled in 200 directions in the plane of incidence
(five angles, 40 directions each) with noise, and fitted with every parameter of the table free. A minimum is
right if its reduced χ² is below 1.3, and claimed if the status is `converged`. With correct errors 95.4 % of
the true values lie within two of them; brackets give the 95 % interval of a share for this number of runs.
A parameter without a finite error is not counted: the fit reports it as not determined.
With `--posterior` the coverage of the posteriors is measured instead.
"""

from __future__ import annotations

import argparse
import math
from collections import Counter
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import numpy as np
from scipy.stats import binomtest

import pellicle as pl
from pellicle.brdf import direction
from pellicle.data.brdf_samples import BrdfSamples
from pellicle.scene.free import Free
from pellicle.scene.surface import Surface

jax.config.update("jax_enable_x64", True)

INCIDENCES = (10.0, 25.0, 40.0, 55.0, 70.0)
RIGHT = 1.3
"""Upper bound of the reduced χ² of a right minimum; for 600 values it is 1 ± 0.06."""


class Run(NamedTuple):
    """Result of one fit: reduced χ², status, time, and (z, reported error) of each free parameter."""

    chi2_reduced: float
    status: pl.Status
    seconds: float
    scores: dict[str, tuple[float, float]]


KINDS = ("", "-reciprocal", "-full")
WEIGHTS = {"specular": Free(0, 100), "diffuse": Free(0, 2)}
LOBES = {
    "thickness": Free(0, 1000),
    "n": Free(1.05, 2.5),
    "exponent_reflection": Free(1, 1000),
    "exponent_transmission": Free(1, 1000),
    "deviation": Free(0, 20),
    "azimuth": Free(-180, 180),
    **WEIGHTS,
}
FILM = {"thickness": Free(0, 1500), "n": Free(1.1, 2.8), **WEIGHTS}
SURFACES = {
    **{f"granier-heidrich{kind}": Surface(f"granier-heidrich{kind}", LOBES) for kind in KINDS},
    "microfacet-film": Surface(
        "microfacet-film", {**FILM, "base_n": 2.7, "base_k": 2.8, "roughness": Free(0.003, 1)}
    ),
    "blinn-phong-film": Surface("blinn-phong-film", {**FILM, "base_n": 2.0, "exponent": Free(1, 1000)}),
}


def random_values(rng: np.random.Generator, surface: Surface) -> dict[str, Any]:
    """Draw true values, away from the bounds."""

    def log(lower, upper):
        return math.exp(rng.uniform(math.log(lower), math.log(upper)))

    draws: dict[str, Callable[[], Any]] = {
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
    free = {key: draws[key]() for key, number in surface.numbers.items() if isinstance(number, Free)}
    if surface.model[0] != "g":
        free["n"] = float(np.mean(free["n"]))
    return {**surface.fixed_numbers(), **free}


def simulated(surface: Surface, truth: dict[str, Any], noise: float, rng: np.random.Generator) -> BrdfSamples:
    """Simulate samples in the plane of incidence with a known relative noise."""
    across = np.tile(np.linspace(-78, 78, 40), len(INCIDENCES))
    theta_i, theta_o = np.repeat(INCIDENCES, 40), np.abs(across)
    phi_i, phi_o = np.zeros(200), np.where(across > 0, 180.0, 0.0)
    rho = np.asarray(surface.brdf(truth, direction(theta_i, phi_i), direction(theta_o, phi_o)))
    values = np.abs(rho * (1 + noise * rng.standard_normal(rho.shape)))
    return BrdfSamples(theta_i, phi_i, theta_o, phi_o, values, ("R", "G", "B"), sigma=noise * rho)


def run(surface: Surface, noise: float, seed: int) -> Run:
    """Fit samples of one random surface."""
    rng = np.random.default_rng(seed)
    truth = random_values(rng, surface)
    fit = pl.fit(simulated(surface, truth, noise, rng), surface)
    scores = {}
    for number in surface.free_numbers():
        estimate, true = fit[number.name], float(np.ravel(truth[number.key])[number.channel or 0])
        scores[number.name] = (estimate.value - true) / estimate.stderr, estimate.stderr
    return Run(fit.chi2_reduced, fit.status, fit.seconds, scores)


def share(hits: np.ndarray) -> str:
    """`95.0 % [88.7, 98.4]`: the share and its 95 % interval (Clopper and Pearson)."""
    if not hits.size:
        return "none"
    lower, upper = binomtest(int(hits.sum()), hits.size).proportion_ci()
    return f"{100 * hits.mean():.1f} % [{100 * lower:.0f}, {100 * upper:.0f}]"


def print_recovery(name: str, runs: int, noise: float) -> None:
    """Print the table of one model."""
    surface = SURFACES[name]
    results = [run(surface, noise, seed) for seed in range(runs)]
    right = np.array([r.chi2_reduced < RIGHT for r in results])
    claimed = np.array([r.status is pl.Status.CONVERGED for r in results])
    statuses = ", ".join(
        f"{count} {status}" for status, count in Counter(r.status for r in results).most_common()
    )
    median = float(np.median([r.seconds for r in results]))
    print(f"\n### {name}\n\n{runs} runs, noise {100 * noise:g} %; median {median:.1f} s per fit.")
    print(f"Right minimum in {share(right)}; {statuses}; right if claimed: {share(right[claimed])}.\n")
    print(
        "| parameter | within 2 errors, all runs | within 2, claimed | within 3, claimed | sd of z, claimed |"
    )
    print("|---|---|---|---|---|")
    for leaf in surface.free_numbers():
        z, error = np.array([r.scores[leaf.name] for r in results]).T
        determined = np.isfinite(error)
        z, counted = np.abs(z), determined & claimed
        cells = [share(z[determined] <= 2), share(z[counted] <= 2), share(z[counted] <= 3)]
        print(f"| {leaf.name} | {' | '.join(cells)} | {np.sqrt(np.mean(z[counted] ** 2)):.2f} |", flush=True)


def print_coverage(name: str, runs: int, noise: float) -> None:
    """Print the coverage of the central 68 and 95 % of posteriors, and their width relative to the fit's."""
    surface, inside, widths, refused = SURFACES[name], [], [], 0
    for seed in range(runs):
        rng = np.random.default_rng(seed)
        truth = random_values(rng, surface)
        posterior = pl.sample(simulated(surface, truth, noise, rng), surface, seed=seed)
        refused += not posterior.trusted
        for leaf in surface.free_numbers() if posterior.trusted else ():
            values = posterior.draws[..., posterior.names.index(leaf.name)].ravel()
            below = np.mean(values < float(np.ravel(truth[leaf.key])[leaf.channel or 0]))
            inside.append(abs(2 * below - 1))
            widths.append(np.std(values) / posterior.fit[leaf.name].stderr)
    near, wide = np.array(inside), np.array([w for w in widths if w > 0])  # 0: the fit has no finite error
    low, middle, high = np.quantile(wide, [0.05, 0.5, 0.95])
    print(f"| {name} | {runs} | {refused} | {share(near < 0.68)} | {share(near < 0.95)} |", end=" ")
    print(f"{middle:.2f} ({low:.2f} to {high:.2f}) |", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("models", nargs="*", choices=[[], *SURFACES], default=[])
    parser.add_argument("--runs", type=int, default=100)
    parser.add_argument("--noise", type=float, default=0.01)
    parser.add_argument("--posterior", action="store_true", help="measure the coverage of posteriors")
    arguments = parser.parse_args()
    if arguments.posterior:
        print("| surface | runs | no interval | 68 % | 95 % | sd / standard error of the fit (5 to 95 %) |")
        print("|---|---|---|---|---|---|")
        for each in arguments.models or SURFACES:
            print_coverage(each, arguments.runs, arguments.noise)
        raise SystemExit
    for each in arguments.models or SURFACES:
        print_recovery(each, arguments.runs, arguments.noise)
