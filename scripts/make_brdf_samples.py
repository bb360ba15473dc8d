"""Write the simulated samples of the studies in `fits/brdf` from their recipes.

Run `python scripts/make_brdf_samples.py [FOLDER]` (default: fits/brdf). Existing files are not overwritten:
remove a file to write it again.
"""

from __future__ import annotations

import sys
from pathlib import Path

import pellicle
from pellicle.data.brdf_samples import write_brdf_samples
from pellicle.recipes.read import read_recipe
from pellicle.simulation.brdf import default_directions, simulate_samples

STUDIES = Path(__file__).resolve().parents[1] / "fits" / "brdf"
SAMPLES, NOISE = 250, 0.002
"""Number of pairs of directions, and standard deviation of the noise (1/sr)."""


def main(folder: Path = STUDIES) -> None:
    """Simulate every study; the seed is its position in alphabetical order, from 1."""
    for seed, recipe in enumerate(sorted(STUDIES.glob("*/recipe.toml")), start=1):
        target = folder / recipe.parent.name / "samples.csv"
        if target.exists():
            continue
        target.parent.mkdir(parents=True, exist_ok=True)
        surface = read_recipe(recipe).scene()
        samples = simulate_samples(surface, default_directions(SAMPLES), noise=NOISE, seed=seed).samples
        start = ", ".join(f"{key} = {' '.join(f'{x:g}' for x in number)}" for key, number in _truth(surface))
        said = [
            "SYNTHETIC: simulated, not measured",
            f"seed {seed}, noise {NOISE:g}, pellicle {pellicle.__version__}",
            f"truth: model {surface.model}, {start}",
        ]
        write_brdf_samples(target, samples, comments=said)


def _truth(surface):
    return [(key, number.reshape(-1)) for key, number in surface.start_numbers().items()]


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:]))
