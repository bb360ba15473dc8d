"""Error and time of every way to a film's colour, in one run, as Markdown.

Run `python benchmarks/colour.py` (needs colour-science). 9,999 films: index 1.33 to 2.9, 0 to 2000 nm,
on 1.5 and on 2.7 + 2.8i, 0 to 80°, illuminant E. The truth is the Airy formula in complex NumPy at
steps of 1 nm, 380 to 730 nm. Programs run in float32; compilation is timed apart; ways take turns in
each round and the medians are given.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import time

import jax
import numpy as np

from pellicle.colour import delta_e2000, film_colour, lab, sensor

sys.path.pop(0)  # this file's own name must not hide colour-science

INDICES, BASES = (1.33, 1.5, 1.7, 2.0, 2.4, 2.9), (1.5, 2.7 + 2.8j)
WAYS = (
    "points-650-510-475",
    "points-645-525-445",
    "belcour-barla",
    "gaussians-4",
    "gaussians-6",
    *("nodes-3-500", "nodes-6-500", "nodes-8-500", "nodes-12-500", "nodes-16-1000"),
    *(f"{kind}-{count}" for kind in ("uniform", "frequency") for count in (8, 16, 32, 64)),
)


def sweep():
    """Columns (films,) of thickness, index, base and angle in degrees; no film on its own base."""
    grid = np.meshgrid(INDICES, np.arange(0, 2001, 20.0), BASES, np.linspace(0, 80, 9), indexing="ij")
    index, thickness, base, angle = (x.ravel() for x in grid)
    seen = ~((index == 1.5) & (base == 1.5))
    return tuple(x[seen] for x in (thickness, index.real, base, angle.real))


def airy(wavelength, thickness, index, base, angle):
    """The textbook formula, (films, wavelengths)."""
    thickness, index, base, a = (x[:, None] for x in (thickness, index, base, np.sin(np.deg2rad(angle))))
    q0, q1, q2 = (np.sqrt(n**2 - a**2 + 0j) for n in (1.0, index, base))
    turn, total = np.exp(4j * np.pi / wavelength * q1 * thickness), 0.0
    for e0, e1, e2 in ((1, 1, 1), (1.0, index**2, base**2)):
        r12, r23 = (e1 * q0 - e0 * q1) / (e1 * q0 + e0 * q1), (e2 * q1 - e1 * q2) / (e2 * q1 + e1 * q2)
        total = total + 0.5 * np.abs((r12 + r23 * turn) / (1 + r12 * r23 * turn)) ** 2
    return total


def main(rounds: int) -> None:
    thickness, index, base, angle = films = sweep()
    eye = sensor("1931", "E")
    truth = np.asarray(lab(airy(eye.wavelength, *films) @ eye.weights, eye.white))
    inputs = [x.astype(np.float32) for x in (thickness, index, angle)] + [base.astype(np.complex64)]
    programs, first, errors = {}, {}, {}
    for name in WAYS:
        programs[name] = jax.jit(
            lambda d, n, t, b, name=name: film_colour(d, n, b, angle=t, way=name, illuminant="E").xyz
        )
        began = time.perf_counter()
        xyz = np.asarray(programs[name](*inputs), float)
        first[name] = time.perf_counter() - began
        errors[name] = delta_e2000(np.asarray(lab(xyz, eye.white)), truth)
    times = {name: [] for name in WAYS}
    for _ in range(rounds):
        for name, program in programs.items():
            began = time.perf_counter()
            program(*inputs).block_until_ready()
            times[name].append((time.perf_counter() - began) / thickness.size * 1e9)
    median = {name: statistics.median(t) for name, t in times.items()}
    published, thin = median["belcour-barla"], thickness <= 500
    print("| way | mean ΔE2000 | p95 | max | mean, d ≤ 500 nm | ns per film | of published | first call s |")
    print("|---|---|---|---|---|---|---|---|")
    for name in WAYS:
        e = errors[name]
        print(
            f"| {name} | {e.mean():.3f} | {np.percentile(e, 95):.2f} | {e.max():.2f} | {e[thin].mean():.3f} "
            f"| {median[name]:.0f} | {median[name] / published:.2f} | {first[name]:.2f} |"
        )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=30)
    main(parser.parse_args().rounds)
