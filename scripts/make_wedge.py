"""Make docs/examples/wedge.png: a simulated photograph of an oxide wedge on silicon, 20 to 240 nm thick.

Run `python scripts/make_wedge.py`. Each of the 221 columns is 1 nm thicker than the last; noise of 1 of 255.
"""

from pathlib import Path

import numpy as np
from PIL import Image

import pellicle as pl
from pellicle.simulation.colours import interference_colours

PHOTOGRAPH = Path(__file__).parents[1] / "docs" / "examples" / "wedge.png"
THICKNESS = np.arange(20.0, 241.0)


def main() -> None:
    """Write the photograph."""
    scene = pl.Scene(pl.Layer("SiO2", 100.0), "Si")
    colours = np.asarray(interference_colours(scene, THICKNESS, np.zeros(1)).srgb)[0]
    noise = np.random.default_rng(0).normal(0.0, 1 / 255, (24, THICKNESS.size, 3))
    pixels = np.round(255 * np.clip(colours + noise, 0, 1)).astype(np.uint8)
    Image.fromarray(pixels).save(PHOTOGRAPH, optimize=True)


if __name__ == "__main__":
    main()
