"""Thickness from the colours of published series: oxide on silicon, temper colours of steel; as Markdown.

Run `python benchmarks/colour_series.py` (needs tmm and colour-science). `colour_series.csv` has the series
with their sources: thicknesses and names of colours. They are read back twice.

Numbers: tmm and colour-science compute the colour of every thickness of a series as 8-bit sRGB, and
`pellicle.colour.invert` gives its thicknesses. Names: a name is a place on the hue circle of CIECAM02 between
the unique hues red (0), yellow (100), green (200) and blue (300), with 25 to either side, chosen before any
comparison. The thickness of a name is the nearest one at which the computed film has such a hue. By chance
counts the names of all rows at the thickness of each.
"""

from __future__ import annotations

import csv
import re
import sys
from pathlib import Path
from typing import Any, NamedTuple

HERE = Path(__file__).resolve().parent
sys.path[:] = [path for path in sys.path if Path(path).resolve() != HERE]  # colour.py is not colour-science

import colour
import jax
import numpy as np
import tmm

import pellicle as pl
from pellicle.colour import FilmColourTable, invert, lab
from pellicle.colour.bands import Bands
from pellicle.colour.film import reflectance
from pellicle.dispersion.base import known_index
from pellicle.optics.pair import to_complex

UNIQUE = np.array([20.14, 90.0, 164.25, 237.53, 380.14])
"""Unique red, yellow, green, blue and red again, in degrees (CIE 159:2004); taken for the hue of CIELAB."""
HALF_WIDTH = 25.0
PLACES = {
    **{"yellow orange": 75, "yellow brown": 75, "red brown": 40, "red violet": 365, "violet red": 380},
    **{"blue violet": 325, "violet blue": 325, "blue green": 250, "green blue": 270, "yellow green": 150},
    **{"green yellow": 125, "yellowish": 100, "bluish": 300, "gold": 90, "straw": 90, "melon": 35},
    **{"salmon": 20, "pink": 0, "orange": 50, "tan": 75, "brown": 60, "purple": 360, "violet": 350},
    **{"yellow": 100, "green": 200, "blue": 300},
}
"""Places of names on a circle of 400."""
FREE = (0.5, 2.0)
WAVELENGTH = np.arange(380.0, 731.0)
"""nm."""


class Row(NamedTuple):
    """One colour of a series."""

    thickness: float  # nm
    name: str


def series(kind: str) -> list[Row]:
    """Return the rows of a series, "oxide" or "temper"."""
    lines = Path(__file__).with_suffix(".csv").read_text("utf-8").splitlines()
    rows = csv.DictReader(line for line in lines if not line.startswith("#"))
    return [Row(float(row["thickness_nm"]), row["colour"]) for row in rows if row["series"] == kind]


def eye(lamp: str) -> np.ndarray:
    """Return the CIE 1931 observer under a lamp of colour-science, (351, 3): reflectance @ weights is XYZ."""
    shape = colour.SpectralShape(380, 730, 1)
    observer = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"].copy().align(shape).values
    weights = observer * colour.SDS_ILLUMINANTS[lamp].copy().align(shape).values[:, None]
    return weights / weights[:, 1].sum()


def by_tmm(thickness: Any, layer: Any, substrate: Any, lamp: str = "D65") -> np.ndarray:
    """Return 8-bit sRGB (films, 3), white-balanced, of films seen along the normal."""
    indices = [
        np.broadcast_to(np.asarray(x) if np.isscalar(x) else to_complex(known_index(x, WAVELENGTH)), 351)
        for x in (layer, substrate)
    ]
    seen = [
        [
            tmm.coh_tmm("s", [1.0, n, base], [np.inf, d, np.inf], 0.0, nm)["R"]
            for n, base, nm in zip(*indices, WAVELENGTH, strict=True)
        ]
        for d in thickness
    ]
    weights = eye(lamp)
    encoded = colour.XYZ_to_sRGB(np.array(seen) @ weights, colour.XYZ_to_xy(weights.sum(axis=0)), "Bradford")
    return np.round(255 * np.clip(encoded, 0, 1)) / 255


def read_back(kind: str, words: str, film: tuple, shown: tuple, lamp: str, exposure: Any, top: float) -> None:
    """Print how many colours of `shown` the inverse of `film` reads back within 3 nm."""
    truth = np.array([row.thickness for row in series(kind)])
    found = invert(FilmColourTable.build(*film, (0, top)), by_tmm(truth, *shown, lamp), exposure=exposure)
    off = np.abs(found.thickness - truth[:, None])
    best, listed = off[:, 0] <= 3, np.any(off <= 3, axis=1)
    told = np.isin(found.status, ("ambiguous", "misfit", "not-identifiable"))
    print(
        f"| {words} | {lamp} | {'known' if exposure == 1.0 else 'free'} | {best.sum()} of {len(truth)}"
        f" | {listed.sum()} | {np.sum(told & ~best)} of {np.sum(~best)} |",
        flush=True,
    )


def hues(thickness: np.ndarray, layer: Any, substrate: Any, lamp: str, bare: bool) -> np.ndarray:
    """Return places on the hue circle; white is the bare substrate or a perfect reflector."""
    weights = eye(lamp)
    at = np.append(thickness, 0.0)
    xyz = np.asarray(reflectance(at, layer, substrate, Bands(WAVELENGTH, None, weights))) @ weights
    white = xyz[-1] if bare else weights.sum(axis=0)
    _, a, b = np.asarray(lab(xyz[:-1], white / white[1])).T
    degrees = np.rad2deg(np.arctan2(b, a))
    return np.interp(np.where(degrees < UNIQUE[0], degrees + 360, degrees), UNIQUE, 100.0 * np.arange(5))


def agrees(place: np.ndarray, name: str) -> np.ndarray:
    """Tell where a hue is within the arc of the names in a description."""
    words = re.findall("|".join(sorted(PLACES, key=len, reverse=True)), name)
    first, *_ = named = [PLACES[word] for word in words]
    turns = [(other - first + 200) % 400 - 200 for other in named]
    centre, half = first + (max(turns) + min(turns)) / 2, (max(turns) - min(turns)) / 2
    return np.abs((place - centre + 200) % 400 - 200) <= half + HALF_WIDTH


def misses(rows: list[Row], thickness: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Return distances (nm): of the nearest film of the hue of name j from thickness i, (rows, rows)."""
    films = [thickness[agrees(place, row.name)] for row in rows]
    return np.array([[np.min(np.abs(at - row.thickness), initial=np.inf) for at in films] for row in rows])


def name_row(words: str, rows: list[Row], film: tuple, lamp: str, bare: bool) -> np.ndarray:
    """Print and return how many names are met within 3 nm."""
    thickness = np.arange(1.0, rows[-1].thickness + 100, 0.5)
    off = misses(rows, thickness, hues(thickness, *film, lamp, bare))
    own = np.diag(off)
    print(
        f"| {words} | {lamp} | {'bare substrate' if bare else 'perfect'} | {np.sum(own <= 3)} of {len(rows)}"
        f" | {np.sum(own <= 10)} | {100 * np.mean(off <= 3):.0f} % |",
        flush=True,
    )
    return own


def main() -> None:
    silica, silicon, iron = (pl.material(name) for name in ("SiO2", "Si", "Fe"))
    oxide, other = (silica, silicon), (1.46, pl.material("Si/Aspnes"))
    print("| colours of | lamp | exposure | best within 3 nm | listed | others called ambiguous or misfit |")
    print("|---|---|---|---|---|---|")
    for exposure in (1.0, FREE):
        read_back("oxide", "SiO₂ on Si", oxide, oxide, "D65", exposure, 1600)
        read_back("oxide", "SiO₂ on Si, other indices", oxide, other, "D65", exposure, 1600)
        read_back("oxide", "SiO₂ on Si", oxide, oxide, "FL1", exposure, 1600)
        for words, layer in (("2.9", 2.9), ("Fe₂O₃", pl.material("Fe2O3")), ("Fe₃O₄", pl.material("Fe3O4"))):
            read_back("temper", f"{words} on Fe", (layer, iron), (layer, iron), "D65", exposure, 150)
    print("\n| names of | lamp | white | within 3 nm | within 10 nm | within 3 nm by chance |")
    print("|---|---|---|---|---|---|")
    rows = series("oxide")
    for words, part in (("to 530 nm", rows[:27]), ("540 to 1540 nm", rows[27:])):
        for lamp in ("D65", "FL1", "FL2"):
            for bare in (False, True):
                name_row(f"SiO₂ on Si, {words}", part, oxide, lamp, bare)
    layers = {"2.9": 2.9, "Fe₂O₃": pl.material("Fe2O3"), "Fe₃O₄": pl.material("Fe3O4"), "1.9": 1.9}
    for words, layer in layers.items():
        for bare in (False, True):
            name_row(f"{words} on Fe", series("temper"), (layer, iron), "D65", bare)


if __name__ == "__main__":
    jax.config.update("jax_enable_x64", True)
    main()
