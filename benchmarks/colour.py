"""Error and time of every method of computing a film's colour, as Markdown.

Run `python benchmarks/colour.py` (needs colour-science). 9,999 films: index 1.33 to 2.9, 0 to 2000 nm,
on 1.5 and on 2.7 + 2.8i, 0 to 80°, under each lamp. The reference is the Airy formula in complex NumPy in
steps of 1 nm, 380 to 730 nm. Programs run in float32 on one thread; compilation is timed separately. Methods
take turns in each round. The table gives medians, and the median over the rounds of the ratio to the time of
the published method, which other processes hardly affect. A second table compares one lookup in a
`FilmColourTable` with the eight Gaussians, on one film each.
"""

from __future__ import annotations

import argparse
import os
import platform
import statistics
import sys
import time

os.environ["XLA_FLAGS"] = "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1"

import jax
import numpy as np

from pellicle.colour import FilmColourTable, delta_e2000, film_colour, lab, sensor

sys.path.pop(0)  # the name of this file must not shadow colour-science

INDICES, BASES = (1.33, 1.5, 1.7, 2.0, 2.4, 2.9), (1.5, 2.7 + 2.8j)
WAYS = (
    "points-650-510-475",
    "points-645-525-445",
    "belcour-barla",
    *(f"gaussians-{count}" for count in (4, 5, 6, 8, 10)),
    *("nodes-3-500", "nodes-6-500", "nodes-8-500", "nodes-12-500", "nodes-16-1000"),
    *(f"{kind}-{count}" for kind in ("uniform", "frequency") for count in (8, 16, 32, 64)),
)


def sweep():
    """Return columns (films,) of thickness, index, base and angle (degrees); no film equals its base."""
    grid = np.meshgrid(INDICES, np.arange(0, 2001, 20.0), BASES, np.linspace(0, 80, 9), indexing="ij")
    index, thickness, base, angle = (x.ravel() for x in grid)
    seen = ~((index == 1.5) & (base == 1.5))
    return tuple(x[seen] for x in (thickness, index.real, base, angle.real))


def airy(wavelength, thickness, index, base, angle):
    """Return R by the textbook formula, with shape (films, wavelengths)."""
    thickness, index, base, a = (x[:, None] for x in (thickness, index, base, np.sin(np.deg2rad(angle))))
    q0, q1, q2 = (np.sqrt(n**2 - a**2 + 0j) for n in (1.0, index, base))
    turn, total = np.exp(4j * np.pi / wavelength * q1 * thickness), 0.0
    for e0, e1, e2 in ((1, 1, 1), (1.0, index**2, base**2)):
        r12, r23 = (e1 * q0 - e0 * q1) / (e1 * q0 + e0 * q1), (e2 * q1 - e1 * q2) / (e2 * q1 + e1 * q2)
        total = total + 0.5 * np.abs((r12 + r23 * turn) / (1 + r12 * r23 * turn)) ** 2
    return total


def errors(name, lamp, films, truth):
    """Return ΔE2000 of every film, computed in float32."""
    thickness, index, base, angle = films
    inputs = [x.astype(np.float32) for x in (thickness, index, angle)] + [base.astype(np.complex64)]
    xyz = jax.jit(lambda d, n, t, b: film_colour(d, n, b, angle=t, method=name, illuminant=lamp).xyz)
    return delta_e2000(np.asarray(lab(np.asarray(xyz(*inputs), float), sensor("1931", lamp).white)), truth)


def compiled(films, count):
    """Compile every method under E; return programs, arguments and times of the first calls (s)."""
    thickness, index, base, angle = (x[:count] for x in films)
    inputs = [x.astype(np.float32) for x in (thickness, index, angle)] + [base.astype(np.complex64)]
    programs, first = {}, {}
    for name in WAYS:
        programs[name] = jax.jit(
            lambda d, n, t, b, name=name: film_colour(d, n, b, angle=t, method=name, illuminant="E").xyz
        )
        began = time.perf_counter()
        programs[name](*inputs).block_until_ready()
        first[name] = time.perf_counter() - began
    return programs, inputs, first


def timed(programs, inputs, rounds):
    """Return the times (s) of every program in every round."""
    times = {name: [] for name in programs}
    for _ in range(rounds):
        for name, program in programs.items():
            began = time.perf_counter()
            program(*inputs).block_until_ready()
            times[name].append(time.perf_counter() - began)
    return {name: np.array(taken) for name, taken in times.items()}


LOOKUPS = {"soap film": (1.33, 1.0, 1200), "oxide on steel": (2.9, 2.7 + 2.8j, 150)}


def _gaussians(thickness, index, base, cosine):
    return film_colour(thickness, index, base, angle=jax.numpy.rad2deg(jax.numpy.arccos(cosine))).xyz


def lookups(rounds):
    """Print error, time and size of tables of one film, 0 to 80°, beside `gaussians-8`."""
    print("\n| film | build s | kB | mean ΔE2000 | max | ns | gaussians-8: mean ΔE2000 | ns |")
    print("|---|---|---|---|---|---|---|---|")
    rng, eye = np.random.default_rng(0), sensor("1931", "D65")
    FilmColourTable.build(1.5, 1.0, (0, 100))  # compiles, which takes 0.5 s
    for name, (index, base, thickest) in LOOKUPS.items():
        began = time.perf_counter()
        table = FilmColourTable.build(index, base, (0, thickest))
        built = time.perf_counter() - began
        thickness, cosine = rng.uniform(0, thickest, 20_000), rng.uniform(np.cos(np.deg2rad(80)), 1, 20_000)
        angle = np.rad2deg(np.arccos(cosine))
        media = (np.full_like(thickness, index), np.full(len(thickness), base))
        truth = np.asarray(lab(airy(eye.wavelength, thickness, *media, angle) @ eye.weights, eye.white))
        programs = {
            "table": jax.jit(lambda d, c, table=table: table.xyz(d, c)),
            "gaussians": jax.jit(lambda d, c, n=index, b=base: _gaussians(d, n, b, c)),
        }
        inputs = [x.astype(np.float32) for x in (thickness, cosine)]
        found = {way: np.asarray(program(*inputs), float) for way, program in programs.items()}
        error = {way: delta_e2000(np.asarray(lab(xyz, eye.white)), truth) for way, xyz in found.items()}
        ns = {way: 1e9 * x.min() / len(thickness) for way, x in timed(programs, inputs, rounds).items()}
        print(
            f"| {name} | {built:.1f} | {table.nbytes / 1000:.0f} | {error['table'].mean():.4f} "
            f"| {error['table'].max():.3f} | {ns['table']:.0f} | {error['gaussians'].mean():.3f} "
            f"| {ns['gaussians']:.0f} |",
            flush=True,
        )


def main(rounds: int, lamps: list[str]) -> None:
    """Print all tables."""
    films = sweep()
    count = films[0].size
    programs, inputs, first = compiled(films, count)
    times = timed(programs, inputs, rounds)
    print(
        f"jax {jax.__version__}, Python {platform.python_version()}, {platform.machine()}, one thread, ",
        end="",
    )
    print(f"load average {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores, {rounds} rounds\n")
    print("| method | ns per film (minimum) | time / published | first call s |")
    print("|---|---|---|---|")
    for name in WAYS:
        ns, ratio = times[name] / count * 1e9, statistics.median(times[name] / times["belcour-barla"])
        print(f"| {name} | {statistics.median(ns):.0f} ({ns.min():.0f}) | {ratio:.2f} | {first[name]:.2f} |")
    thin = films[0] <= 500
    for lamp in lamps:
        eye = sensor("1931", lamp)
        truth = np.asarray(lab(airy(eye.wavelength, *films) @ eye.weights, eye.white))
        print(f"\n| under {lamp} | mean ΔE2000 | p95 | max | mean, d ≤ 500 nm |\n|---|---|---|---|---|")
        for name in WAYS:
            e = errors(name, lamp, films, truth)
            print(f"| {name} | {e.mean():.3f} | {np.percentile(e, 95):.2f} | {e.max():.2f} ", end="")
            print(f"| {e[thin].mean():.3f} |", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=30)
    parser.add_argument("--lamps", nargs="+", default=["E", "D65", "A"])
    parser.add_argument("--lookups", action="store_true", help="only the tables of one film")
    given = parser.parse_args()
    if not given.lookups:
        main(given.rounds, given.lamps)
    lookups(given.rounds)
