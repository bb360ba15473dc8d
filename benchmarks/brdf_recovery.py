"""Known surfaces with noise of 1 %: how often each parameter is found within its reported error.

Run `python benchmarks/brdf_recovery.py [--runs 100] [--noise 0.01] [MODEL ...]`; it prints the tables of
docs/brdf_recovery.md. A surface is drawn at random, seen in 200 directions in the plane of incidence
(five angles, 40 directions each), and fitted with every number in the table free. A fit is `right` where
its reduced χ² is below 1.3, and `claimed` where it says `converged`. Within two reported errors
are 95.4 % of numbers whose errors are what they say; the bracket is the 95 % interval of the share that
so many runs allow. A number without a finite error is not counted: the fit says that it was not seen.
With `--posterior` posteriors are sampled, and what their intervals hold is counted.
"""

from __future__ import annotations

import argparse
import math
import time
from collections import Counter
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import numpy as np
from scipy.stats import binomtest

from pellicle.brdf import direction
from pellicle.data.brdf_samples import BrdfSamples
from pellicle.fitting.brdf.estimates import local, rivals
from pellicle.fitting.brdf.fit import judged, problem
from pellicle.fitting.brdf.search import THOROUGH, search, settle
from pellicle.fitting.result import Status
from pellicle.fitting.spectra.search import quiet
from pellicle.sampling.brdf import sample_brdf
from pellicle.scene.free import Free
from pellicle.scene.surface import Surface

jax.config.update("jax_enable_x64", True)

INCIDENCES = (10.0, 25.0, 40.0, 55.0, 70.0)
RIGHT = 1.3
"""Reduced χ² of the right minimum is below this: of 600 values it is 1 ± 0.06."""


class Run(NamedTuple):
    """One surface: its reduced χ², what the fit says, and (z, reported error) of each free number."""

    chi2_reduced: float
    status: Status
    seconds: float
    scores: dict[str, tuple[float, float]]


def between(lower: float, upper: float) -> Free:
    return Free(lower, upper)


KINDS = ("", "-reciprocal", "-full")
WEIGHTS = {"specular": between(0, 100), "diffuse": between(0, 2)}
LOBES = {
    "thickness": between(0, 1000),
    "n": between(1.05, 2.5),
    "exponent_reflection": between(1, 1000),
    "exponent_transmission": between(1, 1000),
    "deviation": between(0, 20),
    "azimuth": between(-180, 180),
    **WEIGHTS,
}
FILM = {"thickness": between(0, 1500), "n": between(1.1, 2.8), **WEIGHTS}
SURFACES = {
    **{f"granier-heidrich{kind}": Surface(f"granier-heidrich{kind}", LOBES) for kind in KINDS},
    "microfacet-film": Surface(
        "microfacet-film", {**FILM, "base_n": 2.7, "base_k": 2.8, "roughness": between(0.003, 1)}
    ),
    "blinn-phong-film": Surface("blinn-phong-film", {**FILM, "base_n": 2.0, "exponent": between(1, 1000)}),
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
    if surface.model[0] != "g":
        free["n"] = float(np.mean(free["n"]))
    return {**surface.fixed_numbers(), **free}


def seen(surface: Surface, truth: dict[str, Any], noise: float, rng: np.random.Generator) -> BrdfSamples:
    """Samples of the truth in the plane of incidence, with a relative noise that is known."""
    across = np.tile(np.linspace(-78, 78, 40), len(INCIDENCES))
    theta_i, theta_o = np.repeat(INCIDENCES, 40), np.abs(across)
    phi_i, phi_o = np.zeros(200), np.where(across > 0, 180.0, 0.0)
    rho = np.asarray(surface.brdf(truth, direction(theta_i, phi_i), direction(theta_o, phi_o)))
    values = np.abs(rho * (1 + noise * rng.standard_normal(rho.shape)))
    return BrdfSamples(theta_i, phi_i, theta_o, phi_o, values, ("R", "G", "B"), sigma=noise * rho)


def run(surface: Surface, noise: float, seed: int) -> Run:
    rng = np.random.default_rng(seed)
    truth = drawn(rng, surface)
    samples = seen(surface, truth, noise, rng)
    began = time.perf_counter()
    whole = problem(samples, surface, "linear", surface.brdf.evaluate)
    minima = settle(whole, search(whole, THOROUGH, quiet), quiet)
    at = local(whole, minima.units[0], sigma_known=True)
    status, found = judged(surface, whole, minima, at, rivals(whole, minima, at), sigma_known=True)
    seconds = time.perf_counter() - began
    true = {leaf.name: float(np.ravel(truth[leaf.key])[leaf.channel or 0]) for leaf in surface.free_numbers()}
    scores = {k: ((found[k].value - x) / found[k].stderr, found[k].stderr) for k, x in true.items()}
    return Run(at.chi2_reduced, status, seconds, scores)


def share(hits: np.ndarray) -> str:
    """`95.0 % [88.7, 98.4]`: the share and its 95 % interval (Clopper and Pearson)."""
    if not hits.size:
        return "none"
    lower, upper = binomtest(int(hits.sum()), hits.size).proportion_ci()
    return f"{100 * hits.mean():.1f} % [{100 * lower:.0f}, {100 * upper:.0f}]"


def study(name: str, runs: int, noise: float) -> None:
    """One model's table."""
    surface = SURFACES[name]
    results = [run(surface, noise, seed) for seed in range(runs)]
    right = np.array([r.chi2_reduced < RIGHT for r in results])
    claimed = np.array([r.status is Status.CONVERGED for r in results])
    said = ", ".join(
        f"{count} {status}" for status, count in Counter(r.status for r in results).most_common()
    )
    print(f"\n### {name}\n\n{runs} runs, noise {100 * noise:g} %; median {_median(results):.1f} s a search.")
    print(f"Right minimum in {share(right)}; {said}; right where claimed {share(right[claimed])}.\n")
    print("| parameter | within 2 errors, all runs | where claimed | within 3, claimed | sd of z, claimed |")
    print("|---|---|---|---|---|")
    for leaf in surface.free_numbers():
        z, error = np.array([r.scores[leaf.name] for r in results]).T
        seen_ = np.isfinite(error)
        z, sure = np.abs(z), seen_ & claimed
        cells = [share(z[seen_] <= 2), share(z[sure] <= 2), share(z[sure] <= 3)]
        print(f"| {leaf.name} | {' | '.join(cells)} | {np.sqrt(np.mean(z[sure] ** 2)):.2f} |", flush=True)


def intervals(name: str, runs: int, noise: float) -> None:
    """How often the central 68 and 95 % of posteriors hold the truth, and their width by the fit's."""
    surface, inside, widths, refused = SURFACES[name], [], [], 0
    for seed in range(runs):
        rng = np.random.default_rng(seed)
        truth = drawn(rng, surface)
        found = sample_brdf(seen(surface, truth, noise, rng), surface, seed=seed)
        refused += not found.trusted
        for leaf in surface.free_numbers() if found.trusted else ():
            values = found.draws[..., found.names.index(leaf.name)].ravel()
            below = np.mean(values < float(np.ravel(truth[leaf.key])[leaf.channel or 0]))
            inside.append(abs(2 * below - 1))
            widths.append(np.std(values) / found.fit[leaf.name].stderr)
    near, wide = np.array(inside), np.array([w for w in widths if w > 0])  # 0: the fit gives no error
    low, middle, high = np.quantile(wide, [0.05, 0.5, 0.95])
    print(f"| {name} | {runs} | {refused} | {share(near < 0.68)} | {share(near < 0.95)} |", end=" ")
    print(f"{middle:.2f} ({low:.2f} to {high:.2f}) |", flush=True)


def _median(results: list[Run]) -> float:
    return float(np.median([r.seconds for r in results]))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("models", nargs="*", choices=[[], *SURFACES], default=[])
    parser.add_argument("--runs", type=int, default=100)
    parser.add_argument("--noise", type=float, default=0.01)
    parser.add_argument("--posterior", action="store_true", help="sample, and count what intervals hold")
    given = parser.parse_args()
    if given.posterior:
        print("| surface | runs | no interval | 68 % | 95 % | sd by the fit's error (5 to 95 % of them) |")
        print("|---|---|---|---|---|---|")
        for each in given.models or SURFACES:
            intervals(each, given.runs, given.noise)
        raise SystemExit
    for each in given.models or SURFACES:
        study(each, given.runs, given.noise)
