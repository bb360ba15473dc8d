"""Thickness from 8-bit sRGB colours: how often it is right, and how long it takes, as Markdown.

Run `python benchmarks/colour_inverse.py`. The films have random thicknesses, seen at 0°, or at 0°, 35° and
60°, with the exposure of a perfect reflector known, or free between 0.5 and 2. Their colours are computed in
steps of 1 nm, get normal noise of 1.5 of 255 in each channel, and are rounded to 8 bits. The table gives the
share whose best order is within 5 nm, the share within 5 nm of any order that is listed, the mean probability
of the best order, and, among the colours whose best order is a wrong one (off by more than 5 nm and by more
than four standard errors), those that are called ambiguous.
"""

from __future__ import annotations

import argparse
import time

import jax.numpy as jnp
import numpy as np

import pellicle as pl
from pellicle.colour import ColourInverse, FilmColourTable, film_colour, srgb
from pellicle.colour.inverse import SIGMA

FREE = (0.5, 2.0)
ANGLES = ((0.0,), (0.0, 35.0, 60.0))


def films():
    """Layer, substrate and largest thickness (nm) of each film."""
    return {
        "SiO₂ on Si": (pl.material("SiO2"), pl.material("Si"), 1000.0),
        "oxide on steel": (2.9, 2.7 + 2.8j, 150.0),
        "Fe₂O₃ on glass": (pl.material("Fe2O3"), 1.52, 300.0),
        "soap film": (1.33, 1.0, 1200.0),
    }


def measured(layer, substrate, thickness, angles, exposure, rng):
    """8-bit sRGB (films, angles, 3) with noise."""
    seen = [
        film_colour(thickness, layer, substrate, angle=a, method="uniform-351").linear_srgb for a in angles
    ]
    linear = np.stack([np.asarray(x) for x in seen], axis=1) * exposure[:, None, None]
    coded = np.asarray(srgb(jnp.asarray(linear)))
    return np.clip(np.round(255 * (coded + rng.normal(0, SIGMA, coded.shape))), 0, 255) / 255


def row(name, film, angles, free, count):
    """Print one row of the table."""
    layer, substrate, top = film
    rng = np.random.default_rng(0)
    truth = rng.uniform(0, top, count)
    exposure = np.exp(rng.uniform(*np.log(FREE), count)) if free else np.ones(count)
    colours = measured(layer, substrate, truth, angles, exposure, rng)
    table = FilmColourTable.build(layer, substrate, (0, top), angle=(0, 61))
    inverse = ColourInverse.build(table, angles, exposure=FREE if free else 1.0)
    found = inverse(colours)
    off = np.abs(found.thickness - truth[:, None])
    wrong = off[:, 0] > np.maximum(5.0, 4 * found.stderr[:, 0])
    called = np.sum(found.status[wrong] == "ambiguous")
    began = time.perf_counter()
    for one in colours[:200]:
        inverse(one)
    taken = (time.perf_counter() - began) / min(count, 200)
    print(
        f"| {name} | {len(angles)} | {'free' if free else 'known'} | {100 * np.mean(off[:, 0] < 5):.1f}"
        f" | {100 * np.mean(np.any(off < 5, axis=1)):.1f} | {100 * np.mean(found.probability[:, 0]):.1f}"
        f" | {called} of {wrong.sum()} | {1e3 * taken:.2f} |",
        flush=True,
    )


def image(size=512):
    """Print the time of a photo of a wedge of oxide, 20 to 800 nm, with noise."""
    layer, substrate, top = films()["SiO₂ on Si"]
    table = FilmColourTable.build(layer, substrate, (0, top))
    x, y = np.meshgrid(np.linspace(0, 1, size), np.linspace(0, 1, size))
    truth = 20 + 700 * x + 80 * np.sin(9 * y) ** 2
    rng = np.random.default_rng(0)
    coded = np.asarray(table(truth, 1.0).srgb) + rng.normal(0, SIGMA, (size, size, 3))
    photo = np.clip(np.round(255 * coded), 0, 255) / 255
    for exposure, words in ((1.0, "known"), (FREE, "free")):
        inverse = ColourInverse.build(table, exposure=exposure)
        inverse(photo[:8])
        began = time.perf_counter()
        found = inverse(photo, orders=4)
        taken = time.perf_counter() - began
        right = np.mean(np.abs(found.thickness[..., 0] - truth) < 5)
        print(f"\n{size} × {size} pixels, exposure {words}: {taken:.1f} s, {100 * right:.1f} % within 5 nm")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=3000, help="films of each row")
    given = parser.parse_args()
    print("| film | angles | exposure | right % | listed % | mean probability % | ambiguous | ms a colour |")
    print("|---|---|---|---|---|---|---|---|")
    for name, film in films().items():
        for angles in ANGLES:
            for free in (False, True):
                row(name, film, angles, free, given.count)
    image()
