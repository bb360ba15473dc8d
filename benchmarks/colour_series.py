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
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import tmm

import pellicle as pl
from pellicle.colour import FilmColourTable, invert, lab
from pellicle.colour.bands import Bands
from pellicle.colour.film import reflectance
from pellicle.colour.observers import observer_sensor
from pellicle.dispersion.base import known_index
from pellicle.optics.pair import to_complex

HERE = Path(__file__).resolve().parent
sys.path[:] = [path for path in sys.path if Path(path).resolve() != HERE]  # where another colour.py is
colour = import_module("colour")

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
ROUNDED = 0.5 / 255
"""Standard deviation of a channel: the colours of tmm have no noise but that of 8 bits, 0.29 of 255."""
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


def table(layer: Any, substrate: Any, top: float, lamp: str = "D65") -> FilmColourTable:
    """Return the table of a film under a lamp of colour-science, 0 to `top` nm, seen along the normal."""
    spectrum = colour.SDS_ILLUMINANTS[lamp]
    lit = observer_sensor("1931", spectrum.wavelengths, spectrum.values)
    bands = Bands(lit.wavelength, None, lit.weights)

    @jax.jit
    def colours(thickness: Any, cosine: Any) -> Any:
        angle = np.rad2deg(1.0) * jnp.arccos(cosine)
        return reflectance(thickness, layer, substrate, bands, angle=angle) @ lit.weights

    return FilmColourTable.from_colours(
        lambda nm, cosine: np.asarray(colours(nm, cosine)), (0.0, top), white=lit.white, angle=(0.0, 5.0)
    )


def read_back(words: str, rows: list[Row], film: FilmColourTable, shown: np.ndarray) -> None:
    """Print how many colours are read back within 3 nm, with a known and with a free exposure."""
    truth, cells = np.array([row.thickness for row in rows])[:, None], []
    for exposure in (1.0, FREE):
        found = invert(film, shown, exposure=exposure, sigma=ROUNDED)
        off = np.abs(found.thickness - truth)
        within = np.any(off <= np.maximum(3.0, 3 * found.stderr), axis=1)
        cells += [np.sum(off[:, 0] <= 3), np.sum(np.any(off <= 3, axis=1)), np.sum(within)]
    print(f"| {words} | {len(rows)} | {' | '.join(map(str, cells))} |", flush=True)


def hues(film: FilmColourTable, thickness: np.ndarray, bare: bool) -> np.ndarray:
    """Return places on the hue circle; white is the bare substrate or a perfect reflector."""
    white = film.evaluate(np.array(0.0), np.array(1.0)) if bare else np.array(film.white)
    _, a, b = np.asarray(lab(film.evaluate(thickness, np.array(1.0)), white / white[1])).T
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


def name_rows(words: str, lamp: str, rows: list[Row], film: FilmColourTable) -> None:
    """Print how many names are met within 3 nm, for either white."""
    thickness = np.arange(1.0, min(rows[-1].thickness + 100, film.thickness[1]), 0.5)
    for bare in (False, True):
        off = misses(rows, thickness, hues(film, thickness, bare))
        own, white = np.diag(off), "bare substrate" if bare else "perfect"
        print(
            f"| {words} | {lamp} | {white} | {np.sum(own <= 3)} of {len(rows)}"
            f" | {np.sum(own <= 10)} | {100 * np.mean(off <= 3):.0f} % |",
            flush=True,
        )


def main() -> None:
    silica, silicon, iron = (pl.material(name) for name in ("SiO2", "Si", "Fe"))
    rows, temper = series("oxide"), series("temper")
    print(
        "| colours | rows | exposure known: best within 3 nm | any | any within 3σ | free: best | any | 3σ |"
    )
    print("|---|---|---|---|---|---|---|---|")
    films = {lamp: table(silica, silicon, 1700, lamp) for lamp in ("D65", "FL1", "FL2")}
    for part, those in (("to 900 nm", rows[:46]), ("920 to 1540 nm", rows[46:])):
        at = [row.thickness for row in those]
        shown = {lamp: by_tmm(at, silica, silicon, lamp) for lamp in ("D65", "FL1")}
        read_back(f"SiO₂ on Si, {part}", those, films["D65"], shown["D65"])
        other = by_tmm(at, 1.46, pl.material("Si/Aspnes"))
        read_back(f"the same by other indices, {part}", those, films["D65"], other)
        read_back(f"the same under FL1, {part}", those, films["FL1"], shown["FL1"])
        read_back(f"the same under FL1, read as D65, {part}", those, films["D65"], shown["FL1"])
    layers = {"2.9": 2.9, "Fe₂O₃": pl.material("Fe2O3"), "Fe₃O₄": pl.material("Fe3O4"), "1.9": 1.9}
    tints = {f"{words} on Fe": table(layer, iron, 180) for words, layer in layers.items()}
    at = [row.thickness for row in temper]
    for (words, film), layer in zip(tints.items(), layers.values(), strict=True):
        read_back(words, temper, film, by_tmm(at, layer, iron))
    print("\n| names of | lamp | white | within 3 nm | within 10 nm | within 3 nm by chance |")
    print("|---|---|---|---|---|---|")
    for part, those in (("to 520 nm", rows[:27]), ("540 to 1540 nm", rows[27:])):
        for lamp, film in films.items():
            name_rows(f"SiO₂ on Si, {part}", lamp, those, film)
    for words, film in tints.items():
        name_rows(words, "D65", temper, film)


if __name__ == "__main__":
    jax.config.update("jax_enable_x64", True)
    main()
