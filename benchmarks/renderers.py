"""ΔE2000 of renderers' own formulas of a film's colour, as they are and solved, as Markdown.

Run `python benchmarks/renderers.py`. Each film is taken at six thicknesses, and each of them is solved by
itself, as `pellicle export` does. A cell has mean and largest ΔE2000 from the exact colours (CIE 1931,
D65, exposed for the brightest), over angles from 0 to 80 degrees and over the thicknesses.
"""

from __future__ import annotations

import sys

import jax
import numpy as np

import pellicle as pl
from pellicle.rendering.appearance import Appearance, appearance
from pellicle.rendering.formula import effective, physical
from pellicle.rendering.gltf import GLTF_GUARDED
from pellicle.rendering.targets import target

sys.path.pop(0)  # where another colour.py is

TARGETS = ("gltf", "materialx", "openpbr", "blender")
COUNT = 6


def films() -> dict[str, tuple[pl.Scene, tuple[float, float]]]:
    """Scene and range of thicknesses (nm) of each film."""
    oxide = pl.Layer("SiO2", pl.Free(0, 1000), name="film")
    return {
        "soap film": (pl.Scene(pl.Layer(1.33, pl.Free(0, 1000)), 1.0), (100, 800)),
        "oil on water": (pl.Scene(pl.Layer(1.5, pl.Free(0, 1000)), 1.33), (100, 800)),
        "SiO₂ on Si": (pl.Scene(oxide, "Si"), (50, 500)),
        "tempered steel": (pl.Scene(pl.Layer(2.9, pl.Free(0, 1000)), 2.7 + 2.8j), (10, 70)),
        "TiO₂ on Ti": (pl.Scene(pl.Layer("TiO2", pl.Free(0, 1000)), "Ti"), (20, 150)),
        "Fe₂O₃ on glass": (pl.Scene(pl.Layer("Fe2O3", pl.Free(0, 1000)), "BK7"), (50, 300)),
        "SiO₂ on 80 nm Si₃N₄ on Si": (pl.Scene([oxide, pl.Layer("Si3N4", 80.0)], "Si"), (50, 500)),
    }


def looks(scene: pl.Scene, span: tuple[float, float]) -> list[Appearance]:
    """The film at each thickness."""
    return [appearance(scene, nm) for nm in np.linspace(*span, COUNT)]


def cell(errors: list) -> str:
    """Mean and largest ΔE2000 over the thicknesses."""
    return f"{np.mean([e.mean for e in errors]):.1f} / {max(e.largest for e in errors):.0f}"


def main() -> None:
    jax.config.update("jax_enable_x64", True)
    names = [target(name, package_check=False).title for name in TARGETS]
    head = ["extension's text, as it is", *(f"{name}, {x}" for name in names for x in ("as it is", "solved"))]
    print("| film |", " | ".join(head), "|")
    print("|---|" + "---|" * len(head))
    for film, (scene, span) in films().items():
        each = looks(scene, span)
        cells = [cell([physical(GLTF_GUARDED, look).error for look in each])]
        for name in TARGETS:
            formula = target(name, package_check=False).formula
            assert formula is not None
            for solve in (physical, effective):
                cells.append(cell([solve(formula(look), look).error for look in each]))
        print(f"| {film} |", " | ".join(cells), "|", flush=True)


if __name__ == "__main__":
    main()
