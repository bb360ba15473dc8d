"""Published numbers of birefringent and graded layers beside those of pellicle.

Run `python benchmarks/published.py`. It prints the table of docs/published.md, and ends with exit code 1
where a number differs by more than its tolerance: the digits that are published, or what a published formula
neglects.
"""

from __future__ import annotations

import argparse
import sys
from typing import NamedTuple

import jax
import numpy as np
from scipy.optimize import root_scalar

import pellicle as pl


class Row(NamedTuple):
    """A published number, the number computed, and the difference that is allowed."""

    quantity: str
    published: float
    computed: float
    tolerance: float


def twisted_nematic(u: np.ndarray, slices: int = 64) -> np.ndarray:
    """Return T of a cell twisted by 90° between parallel polarisers, the first along the director.

    **Arguments:** `u` = 2dΔn/λ. The cell is `slices` plates, each between half spaces of its ordinary index:
    Δn = 0.001 reflects nothing that counts, as the published formula assumes.
    """
    n, difference, wavelength = 1.5, 0.001, 550.0
    thickness = np.asarray(u) * wavelength / (2 * difference) / slices
    azimuth = (np.arange(slices) + 0.5) * 90.0 / slices
    plate = pl.Anisotropic(n, n + difference, axis=(90.0, azimuth))
    plates = pl.jones(wavelength, thickness[:, None], plate, n, ambient=n, angle=0.0, side="transmission")
    matrix = np.broadcast_to(np.eye(2), (thickness.size, 2, 2))
    for i in range(slices):
        matrix = np.asarray(plates[:, i]) @ matrix
    return np.abs(matrix[:, 0, 0]) ** 2


def gooch_tarry() -> list[Row]:
    """T = sin²(½π√(1 + u²))/(1 + u²): C. H. Gooch and H. A. Tarry, J. Phys. D 8, 1575 (1975)."""
    minima = {"first": 3, "second": 15, "third": 35}
    u = np.sqrt([1.0, 4.0, *minima.values()])
    published = np.round(np.sin(0.5 * np.pi * np.sqrt(1 + u**2)) ** 2 / (1 + u**2), 6)
    names = [f"T at u = {x:.0f}" for x in u[:2]] + [f"T in the {x} minimum" for x in minima]
    # the slices of a continuous twist neglect (π/2/64)²
    return [Row(*row, 6e-4) for row in zip(names, published, twisted_nematic(u), strict=True)]


def sapphire_window() -> list[Row]:
    """Reflection loss of both faces at 1.06 µm, from a data sheet that gives n_o and n_e too."""
    rows = []
    for name, axis in (("normal", (0.0, 0.0)), ("in the surface", (90.0, 0.0))):
        window = pl.Substrate(pl.Anisotropic(1.75449, 1.74663, axis=axis), back="air", plate_mm=1.0)
        loss = pl.simulate(pl.Scene([pl.Layer(1.0, 0.0)], window), [1060.0]).values
        rows.append(Row(f"loss of a sapphire window, axis {name}", 0.14, float(loss[0]), 0.005))
    return rows


def angle_inside(medium: tuple[float, float, float], a: float) -> float:
    """Return the angle in degrees of a p wave's normal in a medium of indices along x, y and z."""
    x, _, z = medium
    return float(np.degrees(np.arctan2(a, x * np.sqrt(1 - (a / z) ** 2))))


def brewster_angles() -> list[Row]:
    """Angles within the crystal at which p is not reflected, where light comes from the other side."""
    rows = []
    for medium, n, published in (((1.1, 1.1, 1.2), 1.0, 34.4166), ((1.1, 1.2, 1.4), 1.5, 73.0770)):
        x, y, z = medium
        crystal = pl.Anisotropic(x=x, y=y, z=z)

        def reflected(angle: float, crystal: pl.Anisotropic = crystal, n: float = n) -> float:
            return float(pl.jones(550.0, 0.0, n, crystal, ambient=n, angle=angle)[0, 0].real)

        last = 89.0 if n < z else np.degrees(np.arcsin(z / n)) - 1e-3
        angle = root_scalar(reflected, bracket=(20.0, last), xtol=1e-6).root
        computed = angle_inside(medium, n * np.sin(np.radians(angle)))
        rows.append(Row(f"Brewster angle in {x}, {y}, {z} to {n}, degrees", published, computed, 6e-5))
    return rows


def rugate_filters() -> list[Row]:
    """Optical density and bandwidth of rugate filters: Appl. Opt. 32, 4831 (1993), equations 1 to 3.

    The factor 1.36 of the density is rounded. The bandwidth is that of many periods; with a finite number it
    is larger.
    """
    mean, glass, peak, rows = 2.0, 1.52, 600.0, []
    for swing, periods in ((0.1, 80), (0.4, 40)):
        material = pl.Graded(
            mean - swing / 2, mean + swing / 2, pl.profile.Sine(0.5, 0.5, periods), mix="linear"
        )
        filter_ = pl.Scene(pl.Layer(material, periods * peak / (2 * mean)), glass)
        R = pl.simulate(filter_, [peak]).values[0]
        share = 0.5 * swing / mean
        density = 1.36 * periods * share - np.log10(4 / glass)
        name = f"optical density of {periods} periods of {mean} ± {swing / 2}"
        rows.append(Row(name, density, float(-np.log10(1 - R)), 0.01 * density))
    swing, periods = 0.2, 200
    material = pl.Graded(mean - swing / 2, mean + swing / 2, pl.profile.Sine(0.5, 0.5, periods), mix="linear")
    wide = peak * np.linspace(0.965, 1.035, 1401)
    R = pl.simulate(pl.Scene(pl.Layer(material, periods * peak / (2 * mean)), glass), wide).values
    outside, middle = np.flatnonzero(R < 0.5), wide.size // 2
    band = wide[outside[outside > middle][0]] - wide[outside[outside < middle][-1]]
    name = f"bandwidth of {periods} periods of {mean} ± {swing / 2}"
    return [*rows, Row(name, 0.5 * swing / mean, float(band / peak), 0.002)]


STUDIES = gooch_tarry, sapphire_window, brewster_angles, rugate_filters


def main() -> int:
    """Print the table; return 1 if a number differs by more than its tolerance."""
    argparse.ArgumentParser(description=__doc__).parse_args()
    jax.config.update("jax_enable_x64", True)
    print("| quantity | published | pellicle | tolerance |\n|---|---|---|---|")
    failed = False
    for study in STUDIES:
        for row in study():
            print(f"| {row.quantity} | {row.published:.6g} | {row.computed:.6g} | {row.tolerance:.1g} |")
            failed |= abs(row.computed - row.published) > row.tolerance
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
