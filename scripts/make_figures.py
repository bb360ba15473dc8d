"""Draw the figures of published systems, and pictures of films, in docs/figures.

The thin conductors of Gerardin, Holzschuch and Martinetto 2019, and the tempered steel and water-like
films of an account of Belcour and Barla 2017.

python scripts/make_figures.py
"""

from __future__ import annotations

from pathlib import Path

import jax
import matplotlib
import numpy as np

import pellicle as pl
from pellicle.colour import film_colour, srgb
from pellicle.colour.spaces import into_srgb

matplotlib.use("Agg")
from matplotlib.figure import Figure

FOLDER = Path(__file__).parents[1] / "docs" / "figures"
VISIBLE = np.linspace(400.0, 700.0, 301)
GLASS = pl.material("BK7")


def canvas(title: str, panels: int) -> tuple[Figure, list]:
    figure = Figure(figsize=(4.6 * panels, 3.8), layout="constrained")
    figure.suptitle(title)
    return figure, list(np.atleast_1d(figure.subplots(1, panels)))


def map_of(axes, y, values, ylabel: str, title: str, most: float) -> None:
    """Draw a signal against wavelength and another quantity."""
    mesh = axes.pcolormesh(
        VISIBLE, y, values, cmap="viridis", vmin=0, vmax=most, shading="auto", rasterized=True
    )
    axes.set(xlabel="wavelength (nm)", ylabel=ylabel, title=title)
    axes.figure.colorbar(mesh, ax=axes)


def film(function, name: str, thickness):
    return function(VISIBLE, np.asarray(thickness)[:, None], pl.material(name), GLASS)


def hematite() -> Figure:
    """Draw figure 1: a hematite layer on glass from 0 to 300 nm."""
    thickness = np.linspace(0.0, 300.0, 301)
    figure, (left, right) = canvas("Hematite on glass, normal incidence", 2)
    for axes, function, title in (
        (left, pl.reflectance, "reflectance"),
        (right, pl.transmittance, "transmittance"),
    ):
        map_of(axes, thickness, film(function, "Fe2O3", thickness), "thickness (nm)", title, 1.0)
    swatches = film_colour(thickness, pl.material("Fe2O3"), GLASS, method="uniform-64").srgb
    beside = left.inset_axes((-0.32, 0, 0.07, 1), sharey=left)
    beside.imshow(
        np.asarray(swatches)[:, None], extent=(0, 1, 0, 300), origin="lower", aspect="auto", rasterized=True
    )
    beside.axis("off")
    return figure


def gold_and_cadmium_sulfide() -> Figure:
    """Draw figure 4: transmittance and reflectance against thickness."""
    thickness = np.geomspace(1.0, 2e4, 600)
    figure, panels = canvas("A layer on glass, mean over 500-700 nm", 2)
    red = VISIBLE >= 500
    for axes, function, label in zip(panels, (pl.transmittance, pl.reflectance), "TR", strict=True):
        for name, colour in (("Au", "#D55E00"), ("main/CdS/Treharne", "#0072B2")):
            mean = np.mean(np.asarray(film(function, name, thickness))[:, red], axis=1)
            axes.semilogx(thickness, mean, color=colour, label=name.replace("main/", ""))
        axes.axvline(100, color="#777777", linewidth=0.8, linestyle=":")
        axes.set(xlabel="thickness (nm)", ylabel=f"mean {label}", ylim=(0, 1))
    panels[0].legend(frameon=False)
    return figure


def copper_oxide_on_aluminium() -> Figure:
    """Draw figure 5, right, against the angle. The paper prints 500 µm; fringes need some 100 nm."""
    angle = np.linspace(0.0, 89.0, 180)
    figure, panels = canvas("CuO on aluminium, unpolarised", 2)
    for axes, thickness, title in zip(panels, (150.0, 500.0), ("150 nm", "500 nm"), strict=True):
        signal = pl.reflectance(
            VISIBLE, thickness, pl.material("CuO"), pl.material("Al"), angle=angle[:, None]
        )
        map_of(axes, angle, signal, "angle of incidence (degrees)", title, 0.6)
    return figure


STEEL = 2.7 + 2.8j
"""Index of the base of the tempered steel; its oxide has an index of 2.9."""


def swatch(axes, most: float, index: float, base: complex, title: str, exposure=1.0, steepest=80.0) -> None:
    """Draw the colours of a film under D65 against thickness and angle of incidence."""
    nm, degrees = np.linspace(0.0, most, 401), np.linspace(0.0, steepest, 81)
    colours = film_colour(nm, index, base, angle=degrees[:, None], method="uniform-64")
    shown = srgb(into_srgb(exposure * np.asarray(colours.linear_srgb)))
    axes.imshow(shown, origin="lower", aspect="auto", extent=(0, most, 0, steepest), rasterized=True)
    axes.set(xlabel="thickness (nm)", ylabel="angle of incidence (°)", title=title)


def tempered_steel() -> Figure:
    """Draw the colours of the oxide, and of films of index 1.33 on the same base and on glass."""
    figure, (steel, water, glass) = canvas("Colours under D65", 3)
    swatch(steel, 80.0, 2.9, STEEL, "film 2.9 on 2.7 + 2.8i")
    for nm, name in ((20, "straw"), (30, "purple"), (40, "blue")):
        steel.annotate(name, (nm, 2), color="white", rotation=90, ha="center", fontsize="small")
    swatch(water, 600.0, 1.33, STEEL, "film 1.33 on 2.7 + 2.8i")
    swatch(glass, 600.0, 1.33, 1.5, "film 1.33 on glass 1.5, ten times brighter", 10.0, 60.0)
    return figure


TEMPER_NAMES = {
    "straw": (75.0, 100.0, 10.0),
    "brown": (20.0, 75.0, 10.0),
    "purple": (295.0, 345.0, 10.0),
    "blue": (258.0, 295.0, 10.0),
    "pale blue": (225.0, 258.0, 8.0),
}
"""Names of temper colours in the order in which a growing oxide has them: hue from and to (degrees of CIELAB)
and least chroma. Yellow has a hue of about 90°, red 30°, purple 320°, blue 270°."""


def temper_intervals(nm: np.ndarray, lab: np.ndarray) -> dict[str, tuple[float, float]]:
    """First interval of thickness (nm) with each name, one after the other."""
    hue = np.rad2deg(np.arctan2(lab[:, 2], lab[:, 1])) % 360
    chroma = np.hypot(lab[:, 1], lab[:, 2])
    found, start = {}, 0
    for name, (low, high, least) in TEMPER_NAMES.items():
        named = (hue >= low) & (hue < high) & (chroma >= least) & (np.arange(len(nm)) >= start)
        first = int(np.argmax(named))
        start = first + int(np.argmin(named[first:]))
        found[name] = (nm[first], nm[start])
    return found


def temper_colours() -> Figure:
    """Draw a gradient of oxide on steel with the names of its temper colours."""
    films = {
        "magnetite on iron: Fe3O4 (Querry 1985) on Fe (Johnson and Christy 1974)": ("Fe3O4", "Fe", 96.0),
        "index 2.9 on 2.7 + 2.8i, constant": (2.9, STEEL, 72.0),
    }
    figure = Figure(figsize=(8.0, 3.4), layout="constrained")
    panels = figure.subplots(len(films), 1)
    for axes, (title, (layer, base, most)) in zip(panels, films.items(), strict=True):
        nm = np.linspace(0.0, most, 961)
        media = [pl.material(x) if isinstance(x, str) else x for x in (layer, base)]
        colours = film_colour(nm, *media, method="uniform-64")
        shown = srgb(into_srgb(np.asarray(colours.linear_srgb)))
        axes.imshow(np.asarray(shown)[None], aspect="auto", extent=(0, most, 0, 1), rasterized=True)
        for name, (low, high) in temper_intervals(nm, np.asarray(colours.lab)).items():
            axes.plot([low, high], [1.12, 1.12], color="#444444", linewidth=1.5, clip_on=False)
            axes.text(0.5 * (low + high), 1.2, name, ha="center", fontsize="small")
        axes.set(yticks=[], xlim=(0, most), ylim=(0, 1))
        axes.set_title(title, loc="left", fontsize="medium", pad=24)
    panels[-1].set_xlabel(
        "thickness of the oxide (nm); colours at normal incidence under D65, white as sRGB white"
    )
    return figure


def main() -> None:
    import gallery_pictures  # beside this file

    FOLDER.mkdir(parents=True, exist_ok=True)
    drawn = {
        "hematite_on_glass": hematite,
        "gold_and_cds_on_glass": gold_and_cadmium_sulfide,
        "cuo_on_aluminium": copper_oxide_on_aluminium,
        "tempered_steel": tempered_steel,
        "temper_colours": temper_colours,
    }
    with jax.enable_x64(True):
        for name, draw in drawn.items():
            draw().savefig(FOLDER / f"{name}.png", dpi=110, metadata={"Software": None})
            print(FOLDER / f"{name}.png")
    for name, picture in gallery_pictures.PICTURES.items():
        picture().save(FOLDER / f"{name}.png", optimize=True)
        print(FOLDER / f"{name}.png")
    for name, mean in gallery_pictures.differences().items():
        print(f"{name}: mean ΔE2000 {mean:.1g} from spectra in steps of 1 nm")


if __name__ == "__main__":
    main()
