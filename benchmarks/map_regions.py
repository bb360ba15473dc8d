"""Map of a simulated cube whose regions are known: statuses, errors and their coverage against the truth.

Run `python benchmarks/map_regions.py`. The cube has 512 x 512 pixels and 100 bands from 420 to 900 nm, of
oxide on silicon: a wedge from 180 to 880 nm, a step of 60 nm, an opaque patch of gold, a scratch whose
spectra are noise, dead pixels without data and stuck ones at 0, and a lamp that falls off by 25 % to the
corners, which the scene follows by a free scale. Noise has σ 0.003, which the cube states. It is simulated
with NumPy. The second cube is a wedge of gold on glass, 5 to 400 nm, of which no light decides the thick
end. Of both, pixels drawn at random are fitted by `pellicle.fit` too.
"""

from __future__ import annotations

import argparse
import time
from typing import NamedTuple

import numpy as np
from maps.films import index, reflectance

import pellicle as pl
from pellicle.data.cube import Cube
from pellicle.fitting.batch.data import STATUSES, BatchFits
from pellicle.mapping.pixels import fit_pixels, prepare, spectrum

NM = np.linspace(420.0, 900.0, 100)
SIGMA = 0.003


class Sample(NamedTuple):
    """A cube, its scene, the true thickness and the region of each pixel, and statuses that are right."""

    name: str
    cube: Cube
    scene: pl.Scene
    thickness: np.ndarray
    region: np.ndarray
    expected: dict[str, tuple[str, ...]]


def oxide(size: int) -> Sample:
    """Oxide on silicon with everything that a camera sees beside it."""
    random = np.random.default_rng(17)
    y, x = np.mgrid[:size, :size] / size
    thickness = 180 + 700 * x
    region = np.full((size, size), "wedge", dtype="<U8")
    step = (x > 0.1) & (x < 0.9) & (y > 0.6) & (y < 0.8)
    thickness, region = thickness + 60 * step, np.where(step, "step", region)
    values = reflectance(NM, index("SiO2", NM), thickness, index("Si", NM))
    gold = (x - 0.25) ** 2 + (y - 0.3) ** 2 < 0.08**2
    values[gold] = np.abs((1 - index("Au", NM)) / (1 + index("Au", NM))) ** 2
    lamp = 1 - 0.5 * ((x - 0.5) ** 2 + (y - 0.5) ** 2)
    values = values * lamp[..., None] + SIGMA * random.standard_normal(values.shape)
    scratch = np.abs(x - 0.6 - 0.2 * y) < 1.5 / size
    values[scratch] = random.uniform(0, 1, (int(scratch.sum()), NM.size))
    dead, stuck = random.uniform(size=(2, size, size)) < 0.001
    values[stuck] = SIGMA * random.standard_normal((int(stuck.sum()), NM.size))
    values[dead] = np.nan
    for name, where in (("opaque", gold), ("scratch", scratch), ("stuck", stuck), ("dead", dead)):
        region = np.where(where, name, region)
    scene = pl.Scene(pl.Layer("SiO2", pl.Free(20, 1500)), "Si", instrument=pl.Instrument(scale="free"))
    unusable = ("misfit", "not-converged")
    return Sample(
        "oxide on silicon",
        Cube({"values": values, "sigma": np.full(NM.size, SIGMA)}, NM),
        scene,
        thickness,
        region,
        {
            "wedge": ("converged",),
            "step": ("converged",),
            "opaque": unusable,
            "scratch": unusable,
            "stuck": (*unusable, "not-identifiable", "at-bound"),
            "dead": ("no-data",),
        },
    )


def gold(size: int) -> Sample:
    """A wedge of gold on glass: its thick end lets no light through."""
    random = np.random.default_rng(18)
    thickness = np.broadcast_to(np.linspace(5, 400, size), (max(size // 16, 4), size))
    values = reflectance(NM, index("Au", NM), thickness, np.full(NM.size, 1.52 + 0j))
    values = values + SIGMA * random.standard_normal(values.shape)
    region = np.select([thickness < 60, thickness < 200], ["thin", "between"], "opaque")
    scene = pl.Scene(pl.Layer("Au", pl.Free(0, 1000)), pl.Substrate(1.52))
    expected = {"thin": ("converged",), "between": STATUSES, "opaque": ("not-identifiable",)}
    return Sample(
        "gold on glass",
        Cube({"values": values, "sigma": np.full(NM.size, SIGMA)}, NM),
        scene,
        thickness,
        region,
        expected,
    )


def table(sample: Sample, found: BatchFits) -> list[str]:
    """One row for each region: how many pixels have a right status, and each status."""
    lines = ["| region | pixels | right status, % | statuses, % |", "|---|---|---|---|"]
    words = np.array(STATUSES)[found.status]
    for name, right in sample.expected.items():
        own = words[sample.region.ravel() == name]
        names, counts = np.unique(own, return_counts=True)
        every = ", ".join(f"{word} {100 * n / own.size:.2f}" for word, n in zip(names, counts, strict=True))
        share = "" if right == STATUSES else f"{100 * np.mean(np.isin(own, right)):.2f}"
        lines.append(f"| {name} | {own.size} | {share} | {every} |")
    return lines


def coverage(sample: Sample, found: BatchFits, regions: tuple[str, ...]) -> list[str]:
    """Shares of pixels within 1, 1.96 and 3 standard errors (noise) of the truth, with binomial errors."""
    usable = np.isin(sample.region.ravel(), regions) & (found.status == STATUSES.index("converged"))
    z = ((found.values[:, 0] - sample.thickness.ravel()) / found.stderr_noise[:, 0])[usable]
    lines = [f"{z.size} pixels of {' and '.join(regions)} with the status converged:"]
    for k, ideal in ((1.0, 68.27), (1.96, 95.00), (3.0, 99.73)):
        share = np.mean(np.abs(z) < k)
        error = np.sqrt(ideal / 100 * (1 - ideal / 100) / z.size)
        lines.append(
            f"- within {k:g} standard errors {100 * share:.2f} % (normal errors: {ideal:.2f}"
            f" ± {100 * error:.2f}, off by {(share - ideal / 100) / error:+.1f} of that)"
        )
    combined = np.abs(found.values[:, 0] - sample.thickness.ravel())[usable] < 3 * found.stderr[usable, 0]
    return [*lines, f"- within 3 combined standard errors {100 * np.mean(combined):.2f} %"]


def agreement(sample: Sample, found: BatchFits, count: int) -> list[str]:
    """Pixels drawn at random, fitted by `pellicle.fit`."""
    random = np.random.default_rng(19)
    names, model = sample.region.ravel(), prepare(sample.cube, sample.scene)
    with_data = np.flatnonzero(found.status != STATUSES.index("no-data"))
    apart, ratios, equal, differ = [], [], 0, []
    chosen = random.choice(with_data, count, replace=False)
    for at in chosen:
        y, x = divmod(int(at), sample.cube.shape[1])
        block = sample.cube.pixels((slice(y, y + 1), slice(x, x + 1)))
        fit = pl.fit(spectrum(sample.cube, {name: own[0] for name, own in block.items()}), sample.scene)
        own, word = fit[model.parameters[0].name], STATUSES[found.status[at]]
        equal += word == fit.status
        if word != fit.status:
            differ.append(f"{names[at]}: {fit.status} by pellicle.fit, {word} in the map")
        elif fit.status == "converged":
            apart.append(abs(own.value - found.values[at, 0]) / own.stderr_noise)
            ratios.append(found.stderr[at, 0] / own.stderr)
    largest = f"{max(apart):.1g}" if apart else "-"
    low, high = np.percentile(ratios, [2.5, 97.5]) if ratios else (np.nan, np.nan)
    return [
        f"{equal} of {count} random pixels have the status of pellicle.fit; where both converged, thicknesses"
        f" are at most {largest} standard errors (noise) apart, and 95 % of combined standard errors have"
        f" ratios from {low:.3f} to {high:.3f}",
        *(f"- {line}" for line in differ),
    ]


def main() -> None:
    """Map both samples and print what came out."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--size", type=int, default=512, help="pixels along a side")
    parser.add_argument("--fits", type=int, default=60, help="random pixels fitted by pellicle.fit")
    options = parser.parse_args()
    for make, regions in ((oxide, ("wedge", "step")), (gold, ("thin",))):
        sample = make(options.size)
        model = prepare(sample.cube, sample.scene)
        began = time.perf_counter()
        found = fit_pixels(model, sample.cube, (slice(None), slice(None)))
        seconds = time.perf_counter() - began
        pixels = sample.thickness.size
        print(f"\n## {sample.name}\n\n{pixels} pixels in {seconds:.1f} s, compilation included\n")
        for lines in (
            table(sample, found),
            coverage(sample, found, regions),
            agreement(sample, found, options.fits),
        ):
            print("\n".join(lines), end="\n\n")


if __name__ == "__main__":
    main()
