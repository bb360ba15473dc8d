"""Errors of an index from 1, 3 and 5 thicknesses in one fit, and their time: `benchmarks/shared_index.py`.

Cauchy films (A 1.7, B 8000 nm²) on silicon, R at 101 wavelengths with a noise of 0.003, simulated with seeds
0 to 4. It prints the table of docs/howto/samples.md. Time is that of the processor for the second fit,
without compilation.
"""

import time

import numpy as np

import pellicle as pl
from pellicle.dispersion import Cauchy

WAVELENGTH = np.linspace(400.0, 900.0, 101)
DEPTHS = (480.0, 120.0, 950.0, 260.0, 700.0)
A, B = 1.7, 8e3


def spectrum(depth: float, seed: int) -> pl.Spectrum:
    """R of one film with noise."""
    return pl.simulate(pl.Scene(pl.Layer(Cauchy(A, B), depth), "Si"), WAVELENGTH, noise=0.003, seed=seed)


def scene(name: str) -> pl.Scene:
    """The scene of one sample, index and thickness free."""
    film = pl.Layer(Cauchy(pl.Free(1.3, 2.2), pl.Free(0, 3e4)), pl.Free(20, 1500), "film")
    return pl.Scene(film, "Si", sample=name)


def main() -> None:
    """Print one row for each number of samples."""
    print("| samples | error of A | by noise alone | error of the first thickness (nm) | status | time (s) |")
    print("|---|---|---|---|---|---|")
    for count in (1, 3, 5):
        data = [spectrum(depth, seed) for seed, depth in enumerate(DEPTHS[:count])]
        scenes = [scene(f"film{depth:g}") for depth in DEPTHS[:count]]
        shared = ["film.A", "film.B"] if count > 1 else None
        given = (data, scenes) if count > 1 else (data[0], pl.Scene(scenes[0].layers, "Si"))
        for _ in range(2):
            began = time.process_time()
            fit = pl.fit(*given, shared=shared)
            seconds = time.process_time() - began
        a, depth = (next(p for p in fit.free if p.name.split(".")[-1] == key) for key in ("A", "thickness"))
        errors = f"{a.stderr:.2g} | {a.stderr_noise:.2g} | {depth.stderr:.2g}"
        print(f"| {count} | {errors} | {fit.status} | {seconds:.2f} |", flush=True)


if __name__ == "__main__":
    main()
