"""Coverage of the reported intervals, and correctness of the claim that a thickness is determined.

First study: simulated data sets of seven kinds of film, three noise levels, with sigma given and estimated.
True values are drawn uniformly between the bounds, and the share of them inside the 68 % and 95 % intervals
is counted: for the covariance of the best fit, its profile likelihood (95 % only) and the sampled posterior.
The data have noise and no systematic effects, and so have the scenes (`pl.Uncertainty.none`).
Second study: sixty films. A scan of the likelihood in plain NumPy classifies the thickness of thirty of them
as determined and of thirty as undetermined; the fit should agree.

    python benchmarks/calibration.py [--sets 1000] [--cases 60] [--jobs 2] [--write FILE.md]
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path
from typing import Any, NamedTuple

import jax
import numpy as np

jax.config.update("jax_enable_x64", True)


import pellicle as pl  # noqa: E402
from pellicle.fitting.conclusion import linearised, neighbourhood  # noqa: E402
from pellicle.fitting.film.fit import fitted  # noqa: E402
from pellicle.fitting.film.parameters import parameters  # noqa: E402
from pellicle.fitting.profile_likelihood import interval  # noqa: E402
from pellicle.fitting.progress import quiet  # noqa: E402
from pellicle.scene.free import insert  # noqa: E402
from pellicle.scene.instrument import Drift  # noqa: E402
from pellicle.simulation.spectra import simulate_signal  # noqa: E402

WAVELENGTH = np.linspace(400.0, 900.0, 101)
SILICON = pl.dispersion.Constant(3.9, 0.02)
EXACT = pl.Uncertainty.none()
LEVELS = {"R": (0.001, 0.004, 0.015), "T": (0.001, 0.004, 0.015), "psi-delta": (0.02, 0.1, 0.5)}


def thickness(lower: float = 50.0, upper: float = 1200.0) -> pl.Free:
    return pl.Free(lower, upper)


def kinds() -> dict[str, pl.Scene]:
    """Return scenes whose free parameters are drawn uniformly between their bounds."""
    index, extinction = pl.Free(1.3, 1.8), pl.Free(0.0, 0.05)
    glass, t = pl.dispersion.Constant(1.52, 0.0), pl.Light(None, 0.0, "T", "unpolarised")
    plate = pl.Substrate(glass, pl.dispersion.Constant(1.0, 0.0))
    scaled = pl.Instrument(scale=Drift(0))
    scenes = {
        "R: d": pl.Scene(pl.Layer(1.46, thickness()), SILICON),
        "R: d, n": pl.Scene(pl.Layer(pl.dispersion.Constant(index, 0.0), thickness()), SILICON),
        "R: d, n, k": pl.Scene(pl.Layer(pl.dispersion.Constant(index, extinction), thickness()), SILICON),
        "R: d, Cauchy A, B": pl.Scene(
            pl.Layer(pl.dispersion.Cauchy(pl.Free(1.4, 1.7), pl.Free(0.0, 1e4)), thickness()), SILICON
        ),
        "R: d, n, scale": pl.Scene(
            pl.Layer(pl.dispersion.Constant(index, 0.0), thickness()), SILICON, instrument=scaled
        ),
        "T: d, n, k": pl.Scene(
            pl.Layer(pl.dispersion.Constant(pl.Free(1.8, 2.4), extinction), thickness()), plate, light=t
        ),
        "psi-delta: d, n": pl.Scene(
            pl.Layer(pl.dispersion.Constant(index, 0.0), thickness(5.0, 400.0)),
            SILICON,
            light=pl.Light(None, 70.0, "psi-delta", "unpolarised"),
        ),
    }
    return {kind: replace(scene, uncertainty=EXACT) for kind, scene in scenes.items()}


class Count(NamedTuple):
    """Whether the intervals of one parameter of a data set contain the true value; None without interval."""

    kind: str
    level: int
    known: bool
    name: str
    covariance: tuple[bool, bool] | None
    profile: tuple[bool, bool] | None
    posterior: tuple[bool, bool] | None


def simulated(scene: pl.Scene, truth: np.ndarray, noise: float, known: bool, seed: int) -> pl.Spectrum:
    fixed = insert(scene, truth)
    sigma = np.full(WAVELENGTH.size, noise) if known else None
    values = simulate_signal(fixed, WAVELENGTH, noise, seed).values
    if scene.light.signal != "psi-delta":
        return pl.Spectrum(WAVELENGTH, values, scene.light.signal, sigma=sigma)
    psi, delta = values.T
    angle = np.full(WAVELENGTH.size, 70.0)
    return pl.Spectrum(WAVELENGTH, psi, "psi-delta", sigma=sigma, delta=delta, delta_sigma=sigma, angle=angle)


def coverage(sets: int, jobs: int) -> list[Count]:
    """Count for all data sets; each has its own random numbers, so that processes can share the work."""
    if jobs == 1:
        return _some(range(sets))
    shares = [range(first, sets, jobs) for first in range(jobs)]
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        return [count for some in pool.map(_some, shares) for count in some]


def _some(which: range) -> list[Count]:
    found, named = [], list(kinds().items())
    for done, i in enumerate(which):
        kind, scene = named[i % len(named)]
        level, known = (i // len(named)) % 3, (i // (3 * len(named))) % 2 == 0
        free, random = parameters(scene), np.random.default_rng([0, i])
        truth = np.array([random.uniform(p.lower, p.upper) for p in free])
        noise = LEVELS[scene.light.signal][level]
        data = simulated(scene, truth, noise, known, i)
        posterior, profiles = pl.sample(data, scene, seed=i), _profiles(data, scene)
        for p, value in zip(free, truth, strict=True):
            found.append(_count(posterior, profiles, p.name, float(value), (kind, level, known)))
        print_progress(done + 1, len(which), "data sets")
    return found


def _profiles(data: pl.Spectrum, scene: pl.Scene) -> dict[str, tuple[float, float]]:
    with jax.enable_x64(True):
        _, ranked = fitted(data, scene, 0.0, quiet)
        _, errors = linearised(ranked)
        around = neighbourhood(ranked, errors.covariance, np.zeros((0, len(ranked.problem.parameters))))
        return {p.name: interval(around, i) for i, p in enumerate(ranked.problem.parameters)}


def _count(
    posterior: pl.Posterior,
    profiles: dict[str, tuple[float, float]],
    name: str,
    truth: float,
    of: tuple[str, int, bool],
) -> Count:
    low, high = profiles[name]
    profiled = (False, low <= truth <= high)
    estimate = posterior.fit[name]
    normal = sampled = None
    if np.isfinite(estimate.stderr) and posterior.fit.status == "converged":
        away = abs(estimate.value - truth)
        normal = (bool(away < 0.9945 * estimate.stderr), bool(away < 1.96 * estimate.stderr))
    if posterior.trusted:
        column = posterior.draws[..., posterior.names.index(name)]
        limits = np.quantile(column, [0.16, 0.84, 0.025, 0.975])
        sampled = (bool(limits[0] < truth < limits[1]), bool(limits[2] < truth < limits[3]))
    return Count(*of, name, normal, profiled if normal else None, sampled)


class Case(NamedTuple):
    """A film with free thickness and index, and whether the likelihood determines the thickness."""

    thickness: float
    n: float
    k: float
    wavelength: np.ndarray
    noise: float
    determined: bool


SUBSTRATE = 3.9 + 0.02j
DETERMINED, UNDETERMINED = 0.05, 0.3
"""Width of the likelihood over the thickness: determined below the first, undetermined above the second."""
CLAIMED = float(np.sqrt(DETERMINED * UNDETERMINED))
"""A fit with four standard errors below this fraction of the thickness claims that it is determined."""


def reflectance(thickness: Any, index: Any, wavelength: np.ndarray) -> np.ndarray:
    """Return R at normal incidence in NumPy; the arrays `thickness` and `index` broadcast."""
    thickness, index = np.asarray(thickness)[..., None], np.asarray(index, dtype=complex)[..., None]
    r01, r12 = (1 - index) / (1 + index), (index - SUBSTRATE) / (index + SUBSTRATE)
    turn = np.exp(4j * np.pi * index * thickness / wavelength)
    return np.abs((r01 + r12 * turn) / (1 + r01 * r12 * turn)) ** 2


def cases(count: int, seed: int = 0) -> list[Case]:
    """Draw as many determined as undetermined films, alternating; films between the two are skipped.

    Films of 5 to 1500 nm, index 1.3 to 2.5 free by ± 0.3, transparent or opaque, 4 to 101 wavelengths.
    """
    random, drawn = np.random.default_rng(seed), {True: [], False: []}
    while min(map(len, drawn.values())) < count // 2:
        d = float(np.exp(random.uniform(np.log(5), np.log(1500))))
        n = random.uniform(1.3, 2.5)
        k = 0.0 if random.random() < 0.7 else float(np.exp(random.uniform(np.log(0.1), np.log(4))))
        points = int(random.choice([4, 8, 30, 101]))
        noise = float(random.choice([0.001, 0.005, 0.02, 0.05]))
        case = Case(d, n, k, np.linspace(400, 900, points), noise, True)
        width = _likelihood_width(case) / d
        determined = True if width < DETERMINED else False if width > UNDETERMINED else None
        if determined is not None and len(drawn[determined]) < count // 2:
            drawn[determined].append(case._replace(determined=determined))
    return [case for pair in zip(drawn[True], drawn[False], strict=True) for case in pair]


def _likelihood_width(case: Case) -> float:
    """Return the range (nm) of thicknesses with a misfit below 4 to noiseless data for some index."""
    clean = reflectance(case.thickness, case.n + 1j * case.k, case.wavelength)
    thick = np.unique(
        np.concatenate([np.linspace(1, 3000, 1500), case.thickness * np.linspace(0.8, 1.2, 401)])
    )
    index = case.n + np.linspace(-0.3, 0.3, 61)
    possible = [
        np.any(
            np.sum(((reflectance(d, index + 1j * case.k, case.wavelength) - clean) / case.noise) ** 2, -1) < 4
        )
        for d in thick
    ]
    inside = thick[np.array(possible)]
    return float(np.ptp(inside))


class Claim(NamedTuple):
    """Status and standard error of a fit, and whether it claims that the thickness is determined."""

    case: Case
    status: str
    stderr: float
    claimed: bool


def claims(count: int) -> list[Claim]:
    results = []
    for i, case in enumerate(cases(count)):
        random = np.random.default_rng(1000 + i)
        clean = reflectance(case.thickness, case.n + 1j * case.k, case.wavelength)
        values = clean + random.normal(0, case.noise, clean.size)
        index = pl.dispersion.Constant(pl.Free(max(case.n - 0.3, 1.0), case.n + 0.3), case.k)
        scene = pl.Scene(pl.Layer(index, pl.Free(1.0, 3000.0)), SILICON, uncertainty=EXACT)
        data = pl.Spectrum(case.wavelength, values, "R", sigma=np.full(clean.size, case.noise))
        fit = pl.fit(data, scene)
        error = fit["thickness"].stderr
        claimed = fit.status in ("converged", "at-bound") and 4 * error < CLAIMED * fit["thickness"].value
        results.append(Claim(case, str(fit.status), error, bool(claimed)))
        print_progress(i + 1, count, "cases")
    return results


def print_progress(done: int, total: int, what: str) -> None:
    if sys.stderr.isatty() or done == total or done % 50 == 0:
        print(f"{done} of {total} {what}", file=sys.stderr, flush=True)


def coverage_cell(counts: list[Count], method: str, which: int) -> str:
    inside = [getattr(c, method)[which] for c in counts if getattr(c, method) is not None]
    if not inside:
        return "     -"
    p, size = float(np.mean(inside)), len(inside)
    return f"{100 * p:5.1f} ± {100 * np.sqrt(max(p * (1 - p), 1 / size**2) / size):.1f} ({size})"


SHOWN = (("covariance", 0), ("covariance", 1), ("profile", 1), ("posterior", 0), ("posterior", 1))


def coverage_table(counts: list[Count]) -> list[str]:
    """Return the coverage in per cent with its binomial standard error and the number of parameters."""
    head = " | ".join(f"{method} {'95 %' if which else '68 %'}" for method, which in SHOWN)
    rows: list[tuple[str, Callable[[Count], bool]]] = [("all", lambda c: True)]
    rows += [(kind, lambda c, kind=kind: c.kind == kind) for kind in kinds()]
    rows += [(f"noise level {i + 1}", lambda c, i=i: c.level == i) for i in range(3)]
    rows += [("sigma given", lambda c: c.known), ("sigma estimated", lambda c: not c.known)]
    lines = [f"| data sets | {head} |", "|---|---|---|---|---|---|"]
    for label, chosen in rows:
        some = [c for c in counts if chosen(c)]
        cells = [coverage_cell(some, method, which) for method, which in SHOWN]
        lines.append(f"| {label} | {' | '.join(cells)} |")
    return lines


def claim_table(results: list[Claim]) -> list[str]:
    lines = ["| likelihood in NumPy | fit: determined | fit: not determined |", "|---|---|---|"]
    for determined in (True, False):
        claimed = [r.claimed for r in results if r.case.determined is determined]
        label = "determined" if determined else "undetermined"
        lines.append(f"| {label} | {sum(claimed)} | {len(claimed) - sum(claimed)} |")
    for r in [r for r in results if r.claimed is not r.case.determined]:
        c = r.case
        label = "determined" if c.determined else "undetermined"
        lines.append(
            f"\n{label}, but {r.status} ± {r.stderr:.3g} nm: {c.thickness:.4g} nm, n {c.n:.3f}, k {c.k:.3g},"
            f" {c.wavelength.size} wavelengths, noise {c.noise:g}"
        )
    return lines


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sets", type=int, default=1000)
    parser.add_argument("--cases", type=int, default=60)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--write", type=Path)
    arguments = parser.parse_args()
    began, lines = time.perf_counter(), []
    if arguments.sets:
        counts = coverage(arguments.sets, arguments.jobs)
        trusted = np.mean([c.posterior is not None for c in counts])
        lines += coverage_table(counts)
        lines += [f"\n{arguments.sets} data sets; {100 * trusted:.1f} % of chains trusted."]
    if arguments.cases:
        lines += ["", *claim_table(claims(arguments.cases))]
    print("\n".join(lines))
    print(f"{time.perf_counter() - began:.0f} s", file=sys.stderr)
    if arguments.write:
        arguments.write.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
