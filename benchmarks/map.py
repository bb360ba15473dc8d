"""Pixels per second of maps on one core, beside SciPy's least squares and a loop of `pl.fit`, as Markdown.

Run `python benchmarks/map.py`. Cubes of 100 bands from 420 to 900 nm are simulated with NumPy: SiO₂ on
silicon of 60 to 1200 nm, seen calibrated or with an unknown scale and offset, and films of unknown index 1.4
to 1.9; noise 0.002. All programs run in turn in one process on one core, with its processor time; compilation
is told apart. SciPy starts where a vectorised scan of the misfit is lowest and uses an exact Jacobian, which
is more than its users usually write; it yields no rivals and no status. "Right" is the share of pixels within
four standard errors of the truth: those of the map, of the noise alone.
"""

from __future__ import annotations

import argparse
import os
import time
from typing import Any, NamedTuple

import numpy as np

CORE = max(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else None
if CORE is not None:
    os.sched_setaffinity(0, {CORE})  # before JAX starts its threads

from maps.films import index, reflectance, slopes  # noqa: E402
from scipy.optimize import least_squares  # noqa: E402

import pellicle as pl  # noqa: E402
from pellicle.data.cube import Cube  # noqa: E402
from pellicle.mapping.pixels import fit_pixels, prepare  # noqa: E402

NM = np.linspace(420.0, 900.0, 100)
SIGMA = 0.002
GRID = np.linspace(20.0, 1500.0, 400)
"""Thicknesses (nm) of the scan from which SciPy starts."""
INDICES = np.linspace(1.3, 2.0, 8)


class Kind(NamedTuple):
    """Films of one kind: the scene, simulated pixels, and the truth."""

    name: str
    goal: int  # pixels/s
    scene: Any
    values: np.ndarray
    truth: np.ndarray
    calibrated: bool = True


def kinds(count: int) -> list[Kind]:
    """The three kinds, of `count` pixels each."""
    random = np.random.default_rng(17)
    silicon, silica = index("Si", NM), index("SiO2", NM)
    thickness = random.uniform(60, 1200, count)
    clean = reflectance(NM, silica, thickness, silicon)
    gain, offset = random.uniform(0.7, 1.3, (count, 1)), random.uniform(0.0, 0.03, (count, 1))
    film = random.uniform(1.4, 1.9, count)
    other = reflectance(NM, film[:, None] + 0j, thickness, silicon)
    noise = SIGMA * random.standard_normal((3, count, NM.size))
    free = pl.Free(20, 1500)
    loose = pl.Instrument(scale="free", offset="free")
    of_index = pl.Layer(pl.dispersion.Constant(pl.Free(1.3, 2.0)), free)
    return [
        Kind("thickness", 60_000, pl.Scene(pl.Layer("SiO2", free), "Si"), clean + noise[0], thickness),
        Kind(
            "thickness, scale and offset",
            6_000,
            pl.Scene(pl.Layer("SiO2", free), "Si", instrument=loose),
            gain * clean + offset + noise[1],
            thickness,
            calibrated=False,
        ),
        Kind("thickness and index", 2_000, pl.Scene(of_index, "Si"), other + noise[2], thickness),
    ]


class Scipy:
    """Least squares of SciPy from the lowest point of a scan."""

    def __init__(self, kind: Kind):
        self.kind, self.silicon = kind, index("Si", NM)
        film = index("SiO2", NM)
        if kind.name == "thickness and index":
            self.starts = np.array([(d, n) for n in INDICES for d in GRID])
            self.table = np.concatenate(
                [reflectance(NM, np.full(NM.size, n + 0j), GRID, self.silicon) for n in INDICES]
            )
        else:
            self.starts, self.table, self.film = (
                GRID[:, None],
                reflectance(NM, film, GRID, self.silicon),
                film,
            )

    def __call__(self, spectrum: np.ndarray) -> float:
        if self.kind.name == "thickness, scale and offset":
            mean = self.table.mean(axis=1, keepdims=True)
            apart = self.table - mean
            gain = np.maximum(apart @ (spectrum - spectrum.mean()) / np.sum(apart**2, axis=1), 0)
            misfit = np.sum((spectrum - spectrum.mean() - gain[:, None] * apart) ** 2, axis=1)
            best = int(np.argmin(misfit))
            start = [GRID[best], gain[best], spectrum.mean() - gain[best] * mean[best, 0]]

            def scaled(x):
                return (x[1] * slopes(NM, self.film, x[:1], self.silicon)[0][0] + x[2] - spectrum) / SIGMA

            def jacobian(x):
                value, slope = slopes(NM, self.film, x[:1], self.silicon)
                return np.column_stack([x[1] * slope[0], value[0], np.ones(NM.size)]) / SIGMA

            return least_squares(scaled, start, jac=jacobian, x_scale=[10.0, 1.0, 0.1]).x[0]
        start = self.starts[int(np.argmin(np.sum((self.table - spectrum) ** 2, axis=1)))]
        if len(start) == 2:

            def of_index(x):
                return (
                    reflectance(NM, np.full(NM.size, x[1] + 0j), x[:1], self.silicon)[0] - spectrum
                ) / SIGMA

            return least_squares(of_index, start, x_scale=[10.0, 0.05]).x[0]
        return least_squares(
            lambda x: (slopes(NM, self.film, x, self.silicon)[0][0] - spectrum) / SIGMA,
            start,
            jac=lambda x: slopes(NM, self.film, x, self.silicon)[1].T / SIGMA,
        ).x[0]


def fitted(kind: Kind, pixel: int) -> Any:
    """The fit of one pixel."""
    sigma = np.full(NM.size, SIGMA)
    return pl.fit(pl.Spectrum(NM, kind.values[pixel], "R", sigma, calibrated=kind.calibrated), kind.scene)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--pixels", type=int, default=32768, help="pixels of each map")
    parser.add_argument("--singles", type=int, default=24, help="pixels a round of the other programs")
    parser.add_argument("--rounds", type=int, default=3)
    options = parser.parse_args()
    print("| free | program | pixels/s | compilation, s | right, % | goal, pixels/s |")
    print("|---|---|---|---|---|---|")
    for kind in kinds(options.pixels):
        arrays = {"values": kind.values[None], "sigma": np.full(NM.size, SIGMA)}
        cube = Cube(arrays, NM, calibrated=kind.calibrated)
        model = prepare(cube, kind.scene)
        where = (slice(None), slice(None))
        began = time.process_time()
        fit_pixels(model, cube, where)  # compiles
        first = time.process_time() - began
        for i in range(2):
            fitted(kind, i)  # compiles
        scipy, seconds, right = Scipy(kind), {}, {}

        def add(name: str, began: float, count: int, good: Any, seconds=seconds, right=right) -> None:
            seconds.setdefault(name, []).append((time.process_time() - began) / count)
            right.setdefault(name, []).append(float(np.mean(good)))

        for round_ in range(options.rounds):
            began = time.process_time()
            found = fit_pixels(model, cube, where)
            at = [p.key for p in model.parameters].index("thickness")
            off, error = np.abs(found.values[:, at] - kind.truth), found.stderr_noise[:, at]
            add("pellicle map", began, len(off), off < 4 * error)
            chosen = range(round_ * options.singles, (round_ + 1) * options.singles)
            began = time.process_time()
            answers = [scipy(kind.values[i]) for i in chosen]
            add(
                "SciPy least_squares",
                began,
                len(answers),
                np.abs(answers - kind.truth[chosen]) < 4 * error[chosen],
            )
            began = time.process_time()
            good = []
            for i in chosen:
                own = fitted(kind, i)["thickness"]
                good.append(abs(own.value - kind.truth[i]) < 4 * own.stderr_noise)
            add("pl.fit in a loop", began, len(good), good)
        for name, each in seconds.items():
            again = float(np.median(each))
            compiled = f"{max(first - again * options.pixels, 0):.1f}" if name == "pellicle map" else ""
            goal = f"{kind.goal}" if name == "pellicle map" else ""
            cells = kind.name, name, f"{1 / again:.0f}", compiled, f"{100 * np.mean(right[name]):.1f}", goal
            print(f"| {' | '.join(cells)} |")


if __name__ == "__main__":
    main()
