"""Effective samples per CPU second, and the fraction of draws in a second minimum.

Compared are emcee in its usual form (stretch moves from a ball around the best fit, a log-probability in
plain NumPy, one walker at a time), the same with vectorised NumPy, and `pellicle.sample`, whose time includes
its checks. All sample the same film in turn in each round; compilation and the fit are not included. The
posterior is that of the noise, without systematic effects, as emcee's.

    python benchmarks/posterior.py [--rounds 5]
"""

from __future__ import annotations

import argparse
import time
from typing import Any, NamedTuple

import emcee
import jax
import numpy as np
from emcee.autocorr import integrated_time

jax.config.update("jax_enable_x64", True)

import pellicle as pl  # noqa: E402
from pellicle.dispersion import Constant  # noqa: E402
from pellicle.fitting.film.fit import fitted  # noqa: E402
from pellicle.fitting.progress import quiet  # noqa: E402
from pellicle.sampling.chain import empty  # noqa: E402
from pellicle.sampling.density import (  # noqa: E402
    Target,
    log_density,
    modes,
)
from pellicle.sampling.sample import run  # noqa: E402
from pellicle.simulation.spectra import simulate_signal  # noqa: E402

WALKERS, STEPS, BURN = 32, 2000, 500
SILICON = 3.9 + 0.02j
ONE, ALL = "NumPy, a walker at a time", "NumPy, vectorised"
SECOND = 438.0
"""Thickness of the second minimum of the five bands (nm)."""


class Problem(NamedTuple):
    """A film on silicon with constant index: bounds of thickness, n and k, and a noisy spectrum."""

    lower: np.ndarray
    upper: np.ndarray
    wavelength: np.ndarray
    values: np.ndarray
    noise: float

    @property
    def free(self) -> np.ndarray:
        return self.upper > self.lower


def problem(truth: tuple[float, float, float], bounds: Any, wavelength: np.ndarray, noise: float, seed: int):
    thickness, n, k = truth
    scene = pl.Scene(pl.Layer(Constant(n, k), thickness), Constant(SILICON.real, SILICON.imag))
    values = simulate_signal(scene, wavelength, noise, seed).values
    lower, upper = np.array(bounds, dtype=float).T
    return Problem(lower, upper, wavelength, values, noise)


def film_problem() -> Problem:
    bounds = [(10, 1000), (1.3, 1.7), (0.0, 0.2)]
    return problem((420.0, 1.46, 0.004), bounds, np.linspace(400, 900, 101), 0.005, 1)


def bimodal_problem() -> Problem:
    """Five bands with 4 % of noise, which two thicknesses explain."""
    bands = np.array([450.0, 520.0, 600.0, 690.0, 800.0])
    return problem((650.0, 1.46, 0.0), [(50, 1500), (1.46, 1.46), (0, 0)], bands, 0.04, 3)


def reflectance(values: np.ndarray, wavelength: np.ndarray) -> np.ndarray:
    """Return R at normal incidence in NumPy; `values` has the shape (..., 3): thickness, n and k."""
    thickness, n, k = np.moveaxis(values[..., None], -2, 0)
    index = n + 1j * k
    r01, r12 = (1 - index) / (1 + index), (index - SILICON) / (index + SILICON)
    turn = np.exp(4j * np.pi * index * thickness / wavelength)
    return np.abs((r01 + r12 * turn) / (1 + r01 * r12 * turn)) ** 2


def log_probability(values: np.ndarray, p: Problem) -> Any:
    """Return the log-probability of free parameters with the shape (..., free)."""
    full = np.broadcast_to(p.lower, (*values.shape[:-1], 3)).copy()
    full[..., p.free] = values
    inside = np.all((values >= p.lower[p.free]) & (values <= p.upper[p.free]), axis=-1)
    residual = (p.values - reflectance(full, p.wavelength)) / p.noise
    return np.where(inside, -0.5 * np.sum(residual**2, axis=-1), -np.inf)


class Sampled(NamedTuple):
    """Draws (steps, walkers, parameters) in the parameters' units, and their CPU time (s)."""

    draws: np.ndarray
    seconds: float

    @property
    def rate(self) -> float:
        time = float(np.max(integrated_time(self.draws, tol=0)))
        return self.draws.shape[0] * self.draws.shape[1] / time / self.seconds


def plain(p: Problem, best: np.ndarray, seed: int, vectorize: bool) -> Sampled:
    random = np.random.default_rng(seed)
    start = best * (1 + 1e-3 * random.standard_normal((WALKERS, best.size)))
    sampler = emcee.EnsembleSampler(WALKERS, best.size, log_probability, args=(p,), vectorize=vectorize)
    sampler._random.seed(seed)
    began = time.process_time()
    sampler.run_mcmc(start, STEPS)
    return Sampled(sampler.get_chain(discard=BURN), time.process_time() - began)


class PellicleSampler:
    """`pellicle.sample` from an existing fit."""

    def __init__(self, p: Problem):
        bounds = [pl.Free(a, b) if b > a else float(a) for a, b in zip(p.lower, p.upper, strict=True)]
        thickness, n, k = bounds
        scene = pl.Scene(
            pl.Layer(Constant(n, k), thickness),
            Constant(SILICON.real, SILICON.imag),
            uncertainty=pl.Uncertainty.none(),
        )
        data = pl.Spectrum(p.wavelength, p.values, "R", sigma=np.full(p.wavelength.size, p.noise))
        self.fit, self.ranked = fitted(data, scene, 0.0, quiet)
        names = [q.name for q in self.ranked.problem.parameters]
        self.order = [names.index(name) for name in ("thickness", "n", "k") if name in names]
        self(0, 20)

    @property
    def best(self) -> np.ndarray:
        return self.ranked.problem.values(self.ranked.minima.units[0])[self.order]

    def __call__(self, seed: int, steps: int = 20_000) -> Sampled:
        began = time.process_time()
        starts = modes(self.ranked)
        target = Target(log_density(self.ranked.problem), WALKERS // 2)
        chain = empty(WALKERS, len(self.order), seed)
        chain, checks = run(target, starts, chain, steps, lambda chain: None, quiet)
        seconds = time.process_time() - began
        return Sampled(self.ranked.problem.values(chain.draws[checks.discard :])[..., self.order], seconds)


def share_near(sampled: Sampled, thickness: float) -> float:
    """Return the fraction of draws within 80 nm of a thickness."""
    return float(np.mean(abs(sampled.draws[..., 0] - thickness) < 80))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=5)
    rounds = parser.parse_args().rounds
    film, two = film_problem(), bimodal_problem()
    ours, ours_two = PellicleSampler(film), PellicleSampler(two)
    rows: dict[str, list[tuple[float, float]]] = {ONE: [], ALL: [], "pellicle": []}
    for seed in range(rounds):
        for name in (ONE, ALL):
            one, other = (plain(p, its.best, seed, name == ALL) for p, its in ((film, ours), (two, ours_two)))
            rows[name].append((one.rate, share_near(other, SECOND)))
        rows["pellicle"].append((ours(seed).rate, share_near(ours_two(seed), SECOND)))
    grid = np.linspace(50, 1500, 40001)
    log = log_probability(grid[:, None], two)
    weight = np.exp(log - log.max())
    truth = weight[abs(grid - SECOND) < 80].sum() / weight.sum()
    print(
        f"three-parameter film, {film.wavelength.size} wavelengths; second minimum of five bands: {truth:.3f}"
    )
    print(f"{'':27}  samples/CPU s   ratio   fraction in the second minimum")
    base = np.median([rate for rate, _ in rows[ONE]])
    for name, results in rows.items():
        rates, shares = zip(*results, strict=True)
        rate = float(np.median(rates))
        print(
            f"{name:27}  {rate:13.0f}  {rate / base:6.1f}   {np.mean(shares):.3f}"
            f" ({min(shares):.3f} to {max(shares):.3f})"
        )


if __name__ == "__main__":
    main()
