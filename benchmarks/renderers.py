"""ΔE2000 of renderers' own formulas of a film's colour, as they are, changed and solved, as Markdown.

Run `python benchmarks/renderers.py`. Each film is taken at six thicknesses. A cell has mean and largest
ΔE2000 from the exact colours (CIE 1931, D65, exposed for the brightest), over angles from 0 to 80 degrees and
over the thicknesses. Three tables: light reflected by formulas of which steps are changed, with the
operations per colour (arithmetic / roots and transcendental functions); light transmitted; and light
reflected by formulas as they are and with numbers solved for each thickness by itself, as `pellicle export`
does. Last the constants of the refitted Gaussians.
"""

from __future__ import annotations

import sys

import jax
import numpy as np
import renderer_changes as changes

import pellicle as pl
from pellicle.rendering.appearance import ANGLES, Appearance, appearance
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


def transparent() -> dict[str, tuple[pl.Scene, tuple[float, float]]]:
    """Films on transparent bases; the soap film is a sheet that both of its faces bound."""
    ours, free = films(), pl.Free(0, 1000)
    return {
        **{name: ours[name] for name in ("soap film", "oil on water")},
        "MgF₂ on glass": (pl.Scene(pl.Layer("MgF2", free), "BK7"), (50, 200)),
        "TiO₂ on glass": (pl.Scene(pl.Layer("TiO2", free), "BK7"), (20, 200)),
        "Fe₂O₃ on glass": ours["Fe₂O₃ on glass"],
    }


def table(head: list[str], rows: dict[str, list[str]]) -> None:
    """Print a table."""
    print("|", " | ".join(head), "|")
    print("|---|" + "---|" * (len(head) - 1))
    for name, cells in rows.items():
        print(f"| {name} |", " | ".join(cells), "|", flush=True)
    print()


def rungs(
    formulas: tuple[tuple[str, changes.Colours], ...], each: dict[str, list[Appearance]], through: bool
) -> dict[str, list[str]]:
    """Cells of formulas, by their names, for each film; `through`: of transmitted light."""
    cosine = np.cos(np.deg2rad(ANGLES))
    exact = {film: [changes.transmitted(x) if through else x.xyz for x in of] for film, of in each.items()}
    return {
        name: [
            cell(
                [
                    changes.colour_error(colours(look, look.thickness[:, None], cosine), xyz)
                    for look, xyz in zip(of, exact[film], strict=True)
                ]
            )
            for film, of in each.items()
        ]
        for name, colours in formulas
    }


def gaussians() -> dict[str, list[str]]:
    """Centres, standard deviations and weights of the refitted Gaussians for linear sRGB under D65."""
    bands = changes.FOUR
    assert bands.width is not None
    rows = zip(1000 / bands.wavelength, bands.width * 1000, bands.weights @ changes.SRGB.T, strict=True)
    return {f"{centre:.5f}": [f"{x:.6f}" for x in (width, *rgb)] for centre, width, rgb in rows}


def main() -> None:
    jax.config.update("jax_enable_x64", True)
    each = {film: looks(*of) for film, of in films().items()}
    reflected = rungs(changes.CHANGES, each, through=False)
    clear = {film: looks(*of) for film, of in transparent().items()}
    transmitted = rungs(changes.TRANSMITTED, clear, through=True)
    for name, colours in changes.CHANGES:
        counts = changes.operations(colours, each["tempered steel"][0])
        reflected[name].append(" / ".join(f"{x:.0f}" for x in counts))
    table(["formula", *each, "operations"], reflected)
    table(["formula", *clear], transmitted)

    names = [target(name, package_check=False).title for name in TARGETS]
    head = ["extension's text, as it is", *(f"{name}, {x}" for name in names for x in ("as it is", "solved"))]
    solved = {}
    for film, of in each.items():
        cells = [cell([physical(GLTF_GUARDED, look).error for look in of])]
        for name in TARGETS:
            formula = target(name, package_check=False).formula
            assert formula is not None
            for solve in (physical, effective):
                cells.append(cell([solve(formula(look), look).error for look in of]))
        solved[film] = cells
    table(["film", *head], solved)
    table(["centre (1/µm)", "deviation (1/µm)", "red", "green", "blue"], gaussians())


if __name__ == "__main__":
    main()
