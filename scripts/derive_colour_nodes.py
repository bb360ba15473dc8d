"""Derive the optimised samples and Gaussians in src/pellicle/colour/data.

The transforms of the bands are fitted to those of the CIE 1931 observer at all optical paths up to a
maximum; the difference is weighted as L*, a* and b* weight X, Y and Z near grey. Samples are for
illuminant E; Gaussians are for several lamps at once, except that four Gaussians suffice for only two lamps.
Weights are linear, so only centres and widths are optimised; the library solves the weights for each
observer and illuminant. Run: python scripts/derive_colour_nodes.py
"""

import csv
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

from pellicle.colour.bands import LONGEST_PATH, fit_weights, reach_of, sensor_transform
from pellicle.colour.observers import sensor

DATA = Path(__file__).parents[1] / "src/pellicle/colour/data"
EQUAL = sensor("1931", "E")
TO_LAB = np.array([[0, 116, 0], [500, -500, 0], [0, 200, -200]]).T / 200
NODES = {500: (3, 4, 6, 8, 12), 1000: (8, 12, 16)}
LAMPS = ("E", "D50", "D65", "A")
GAUSSIANS = {4: ("E", "D65"), 5: LAMPS, 6: LAMPS, 8: LAMPS, 10: LAMPS}
STARTS = 60


def residual(wavelength, width, targets):
    residuals = []
    for target in targets:
        weights = fit_weights(wavelength, width, target)
        difference = target.columns(wavelength, width) @ weights - target.exact
        residuals.append((difference / target.white @ TO_LAB).ravel())
    return np.concatenate(residuals)


def split(x, gaussian):
    """Convert frequencies (1/µm) and, for Gaussians, the logarithms of 10 × their widths to nm and 1/nm."""
    if not gaussian:
        return 1000 / x, np.zeros_like(x)
    frequency, width = np.split(x, 2)
    return 1000 / frequency, np.exp(width) * 1e-4


def derive(count, reach, lamps, gaussian):
    rng, best = np.random.default_rng(0), None
    targets = [sensor_transform(sensor("1931", lamp), reach) for lamp in lamps]
    share = np.cumsum(EQUAL.weights.sum(axis=1)) / EQUAL.weights.sum()
    starts = [1000 / np.interp((np.arange(count) + 0.5) / count, share, EQUAL.wavelength)]
    if gaussian:
        starts += [np.linspace(2.55, 1.42, count)]
        starts += [np.sort(rng.uniform(1.45, 2.45, count)) for _ in range(STARTS)]
    for start in starts:
        x = np.concatenate([start, rng.uniform(-0.5, 0.2, count)]) if gaussian else start
        result = least_squares(lambda x: residual(*split(x, gaussian), targets), x, max_nfev=100)
        best = result if best is None or result.cost < best.cost else best
    wavelength, width = split(best.x, gaussian)
    order = np.argsort(wavelength)
    print(count, reach, "cost", best.cost, flush=True)
    return [
        (count, f"{reach:g}", f"{w:.4f}", f"{s:.7g}")
        for w, s in zip(wavelength[order], width[order] * 1000, strict=True)
    ]


def write(name, rows):
    with (DATA / name).open("w", encoding="utf-8", newline="") as file:
        file.write(f"# derived by {Path(__file__).name}\n")
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(("count", "reach_nm", "wavelength_nm", "width_per_um"))
        writer.writerows(rows)


if __name__ == "__main__":
    write(
        "gaussians.csv", [r for n, lamps in GAUSSIANS.items() for r in derive(n, LONGEST_PATH, lamps, True)]
    )
    sizes = [(n, reach_of(thickest)) for thickest, counts in NODES.items() for n in counts]
    write("nodes.csv", [row for n, reach in sizes for row in derive(n, reach, ("E",), False)])
