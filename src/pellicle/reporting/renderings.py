"""Renderings: their display in sRGB, figures of spheres, and the report of a film exported to a renderer.

Spheres are a surface with its BRDF, balls under a film, a bubble, and one film by several methods.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from io import BytesIO
from typing import TYPE_CHECKING, Any

import jax
import numpy as np

from pellicle.accuracy.colour_methods import EXACT, ColourMap, colour_maps
from pellicle.accuracy.colour_methods import EYE as OBSERVER
from pellicle.colour import linear_srgb, sensor, srgb
from pellicle.colour.spaces import LUMINANCE, into_srgb
from pellicle.reporting.matplotlib_figure import figure_path, new_figure, plain, save_figure
from pellicle.reporting.plain_text import block, table, wrapped
from pellicle.scene.film import Scene
from pellicle.scene.surface import Surface
from pellicle.simulation.environment import EYE, Environment, Rendering, Sphere, light_tent, one_lamp, studio
from pellicle.simulation.environment import sphere as sphere_pixels
from pellicle.simulation.film_sphere import Stack, ball, bubble, stack
from pellicle.simulation.surface_sphere import in_plane, render

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.colors import Normalize
    from matplotlib.figure import Figure

    from pellicle.rendering.export import Export

_srgb = jax.jit(srgb)  # compiled one by one its operations take 0.3 s
WHITE_PERCENTILE = 99.5
"""Percentile of the luminance that is shown as white: lamps are brighter than what they light."""


def exposure(*renderings: Rendering, percentile: float = WHITE_PERCENTILE, coloured: bool = False) -> float:
    """Factor, of two digits, that shows this percentile of the spheres' luminance as white.

    `coloured`: of their largest channel, so that what is lit most keeps its colour.
    """
    seen = [p.linear.max(axis=-1) if coloured else p.linear @ LUMINANCE for p in renderings]
    bright = [each[p.coverage > 0.5] for each, p in zip(seen, renderings, strict=True)]
    white = np.percentile(np.concatenate(bright), percentile)
    return float(f"{1 / white:.2g}") if white > 0 else 1.0


def display(rendering: Rendering, factor: float | None = None, background: float = 1.0) -> np.ndarray:
    """Convert a rendering to sRGB (size, size, 3), multiplied by an exposure (its own if None).

    Colours outside sRGB, and brighter than white, are mixed with grey by `into_srgb`. `background` is the
    sRGB value around the sphere.
    """
    factor = exposure(rendering) if factor is None else factor
    shown = encode(factor * rendering.linear)
    share = rendering.coverage[..., None]
    return share * shown + (1 - share) * background


def encode(linear: np.ndarray) -> np.ndarray:
    """Convert linear sRGB (..., 3) to display values, colours outside as `into_srgb` says."""
    return np.asarray(_srgb(into_srgb(linear)))


def png(image: np.ndarray) -> bytes:
    """Encode sRGB values (rows, columns, 3), 0 to 1, as a PNG."""
    from PIL import Image  # a requirement of Matplotlib

    buffer, pixels = BytesIO(), np.rint(255 * np.clip(image, 0.0, 1.0)).astype(np.uint8)
    Image.fromarray(pixels).save(buffer, "PNG", compress_level=1)
    return buffer.getvalue()


INCIDENCES = (15.0, 45.0, 70.0)
LEAVING = np.linspace(-88.0, 88.0, 353)
"""Angles (degrees) of the polar plots: of the light, and to the eye."""
ENVIRONMENTS = {"studio": studio, "lamp": one_lamp}
"""Surroundings of a sphere, by the angle of the brightest lamp from the line of sight."""
SIZE, SMALL = 420, 260
"""Pixels across a single sphere, and across one of several."""
LAMP_PERCENTILE = 97.0
"""Percentile of the luminance that is white where a lamp is mirrored sharply: it covers 2 % of a ball."""
DPI = 110
"""Resolution at which a rendering of several spheres has 200 to 400 kB."""
DARK = 0.06
"""sRGB value around balls in reflection alone."""
_CHANNELS = ("#c03030", "#2f8f2f", "#3050c0")


def sphere(
    surface: Surface,
    path: str | os.PathLike[str],
    light: float = 35.0,
    title: str = "",
    *,
    environment: str = "studio",
    size: int = SIZE,
) -> None:
    """Draw a sphere of the surface and polar plots of its BRDF into `path` (.png, .pdf or .svg).

    **Arguments:** `light`, the angle of the brightest soft box from the line of sight in degrees;
    `environment`, "studio" or "lamp", one soft box in the dark.

    **Raises:** UsageError for another file type, and where the file exists or cannot be written.
    """
    target = figure_path(path)
    rendering = render(surface, ENVIRONMENTS[environment](light), size)
    with jax.enable_x64(True):
        lobes = {angle: in_plane(surface, angle, LEAVING) for angle in INCIDENCES}
    factor = exposure(rendering, coloured=True)
    figure = new_figure(8.0, 5.0)
    grid = figure.add_gridspec(len(lobes), 2, width_ratios=[2.2, 1])
    axes = figure.add_subplot(grid[:, 0])
    _show(axes, display(rendering, factor))
    axes.set_title(plain(title), loc="left", fontsize="medium")
    note = f"D65, {environment}; exposure × {factor:g}"
    axes.text(0.0, -0.01, note, transform=axes.transAxes, va="top", fontsize="x-small")
    for row, (angle, values) in enumerate(lobes.items()):
        _draw_lobe(figure.add_subplot(grid[row, 1], projection="polar"), angle, values, surface)
    save_figure(figure, target, dpi=DPI)


def _draw_lobe(axes: Axes, angle: float, values: np.ndarray, surface: Surface) -> None:
    """The BRDF of each channel in the plane of incidence."""
    from matplotlib.ticker import MaxNLocator

    count = surface.channels
    names = [f"channel {k + 1}" for k in range(count)] if count != 3 else ["R", "G", "B"]
    if surface.sensor is None:
        names = [f"{nm:g} nm" for nm in surface.bands.wavelength]
    colours = _CHANNELS if count == 3 else [f"C{k}" for k in range(count)]
    for lobe, colour, label in zip(values.T, colours, names, strict=True):
        axes.plot(np.deg2rad(LEAVING), lobe, color=colour, linewidth=1.2, label=label)
    axes.axvline(np.deg2rad(-angle), color="#777777", linestyle=":", linewidth=1.0)
    axes.set(theta_zero_location="N", theta_direction=-1, thetamin=-90, thetamax=90)
    axes.set_xticks(np.deg2rad([-90, -45, 0, 45, 90]))
    axes.tick_params(labelsize="xx-small", pad=0)
    axes.yaxis.set_major_locator(MaxNLocator(2))
    axes.set_title(f"light at {angle:g}°, BRDF in 1/sr", fontsize="x-small")
    if angle == INCIDENCES[-1]:
        below: Any = {"loc": "upper center", "bbox_to_anchor": (0.5, 0.1), "ncols": 3}
        axes.legend(fontsize="xx-small", frameon=False, **below)


def objects(
    scene: Scene,
    path: str | os.PathLike[str],
    view: str,
    thickness: Sequence[float],
    title: str = "",
    size: int = SMALL,
    **how: Any,
) -> None:
    """Draw balls of the substrate under films of several thicknesses (nm), or stages of a bubble that drains,
    by the thickness of the film at its top, into `path`.

    A ball that does not absorb is shown in reflection, seen through, and as both together; others in
    reflection. `view` is "balls" or "bubble"; `layer`, `illuminant` and `observer` are those of
    `interference_colours`.

    **Raises:** UsageError as `stack` and `bubble` do, for another file type, and where the file exists.
    """
    target, films = figure_path(path), stack(scene, **how)
    rows, factor = (_balls if view == "balls" else _stages)(films, thickness, size)
    names = [f"{nm:g} nm" if view == "balls" else f"{float(f'{nm:.3g}'):g} nm at the top" for nm in thickness]
    figure = new_figure(0.3 + 1.9 * len(names), 0.6 + 1.95 * len(rows))
    panels = figure.subplots(len(rows), len(names), squeeze=False)
    for row, (word, images) in zip(panels, rows.items(), strict=True):
        for axes, image in zip(row, images, strict=True):
            _show(axes, image)
        row[0].set_ylabel(word, fontsize="small")
    for axes, name in zip(panels[0], names, strict=True):
        axes.set_title(name, fontsize="small")
    place = "studio" if view == "balls" else "light tent"
    _describe(figure, title, f"{how.get('illuminant', 'D65')}, {place}; exposure × {factor:g}")
    save_figure(figure, target, dpi=DPI)


def _balls(films: Stack, thickness: Sequence[float], size: int) -> tuple[dict[str, list[np.ndarray]], float]:
    """Rows of balls in a studio by their names, and their exposure."""
    place = studio()
    balls = [ball(films, nm, place, size) for nm in thickness]
    factor = exposure(*(each.whole for each in balls), percentile=LAMP_PERCENTILE)
    rows = {"in reflection": [display(each.reflected, factor, DARK) for each in balls]}
    through = [each.transmitted for each in balls if each.transmitted is not None]
    if through:
        rows["seen through"] = [display(each, factor, _behind(place, factor)) for each in through]
        rows["together"] = [display(each.whole, factor, _behind(place, factor)) for each in balls]
    return rows, factor


def _stages(films: Stack, thickness: Sequence[float], size: int) -> tuple[dict[str, list[np.ndarray]], float]:
    """The row of stages of a bubble in a light tent, and their exposure."""
    place = light_tent()
    stages = [bubble(films, top, place, size) for top in thickness]
    factor = exposure(*stages)
    return {"": [display(each, factor, _behind(place, factor)) for each in stages]}, factor


def _behind(surroundings: Environment, factor: float) -> float:
    """sRGB value of what lies behind the sphere: all lines of sight are parallel, so it is one grey."""
    return float(encode(np.full(3, factor * surroundings.radiance(-EYE)))[0])


def _describe(figure: Figure, title: str, note: str) -> None:
    figure.suptitle(plain(title), x=0.01, ha="left", fontsize="medium")
    figure.supxlabel(note, x=0.01, ha="left", fontsize="x-small")


def _show(axes: Axes, image: np.ndarray) -> None:
    """A rendering without ticks and frame."""
    axes.imshow(image, interpolation="antialiased")
    axes.set(xticks=[], yticks=[])
    for spine in axes.spines.values():
        spine.set_visible(False)


FILMS, ANGLES = 160, 80
"""Thicknesses and angles at which colours are computed; pixels are interpolated between them."""
STEEPEST = 80.0
"""Largest angle of incidence: beyond it, at 1.5 % of the radius from the limb, colours stay the same."""
LIMB_PERCENTILE = 92.0
"""Percentile of the luminance that is shown as white: at the limb any film reflects more than elsewhere."""
LARGEST = 10.0
"""ΔE2000 at the end of the scale; two colours that differ so are different at a glance."""


def draw_methods(
    scene: Scene,
    path: str | os.PathLike[str],
    thickness: tuple[float, float],
    title: str = "",
    *,
    size: int = 240,
) -> list[ColourMap]:
    """Draw balls under a film by each method, and the ΔE2000 of each pixel, into `path`.

    The ball stands in surroundings of one radiance, so that it shows the colours of the film alone. Its
    thickness falls from the bottom to the top over the range `thickness` (nm).

    **Returns:** the colours by each method, with error and time.

    **Raises:** UsageError as `colour_maps` does, for another file type, and where the file exists.
    """
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    target = figure_path(path)
    nm, degrees = np.linspace(*thickness, FILMS), np.linspace(0.0, STEEPEST, ANGLES)
    maps = colour_maps(scene, nm, degrees)
    factor = float(f"{1 / np.percentile(maps[0].xyz[..., 1], LIMB_PERCENTILE):.2g}")
    pixels = sphere_pixels(size)
    scale = Normalize(0.0, LARGEST)
    figure = new_figure(1.0 + 1.9 * len(maps), 5.1)
    panels = figure.subplots(2, len(maps), squeeze=False)
    for above, below, colours in zip(*panels, maps, strict=True):
        _draw_method(above, below, colours, pixels, factor, scale)
    for axes in panels.flat:
        axes.set(xticks=[], yticks=[])
        axes.set_frame_on(False)
    mappable = ScalarMappable(norm=scale, cmap="magma_r")
    figure.colorbar(mappable, ax=panels[1], label="ΔE2000", shrink=0.85, pad=0.01, extend="max")
    note = (
        f"D65, surroundings of one radiance; exposure × {factor:g}; {thickness[0]:g} nm at the top to"
        f" {thickness[1]:g} nm at the bottom; 0° in the middle to {STEEPEST:g}° at the limb"
    )
    _describe(figure, title, note)
    save_figure(figure, target, dpi=DPI)
    return maps


def _draw_method(
    above: Axes, below: Axes, colours: ColourMap, pixels: Sphere, factor: float, scale: Normalize
) -> None:
    """The ball by one method, its time, and below it the ΔE2000 of each pixel."""
    linear = np.asarray(linear_srgb(colours.xyz, sensor(*OBSERVER).white))
    shown = display(pixels.rendering(_over(pixels, linear)), factor, DARK)
    above.imshow(shown, interpolation="antialiased")
    seconds, delta_e = colours.seconds, colours.delta_e
    time = f"{seconds * 1e9:.0f} ns" if seconds < 1e-6 else f"{seconds * 1e6:.1f} µs"
    above.set_title(f"{colours.name}\n{time} a colour", fontsize="small")
    error = np.full(pixels.mask.shape, np.nan)
    error[pixels.mask] = np.where(pixels.share > 0.5, _over(pixels, delta_e[..., None])[:, 0], np.nan)
    below.imshow(error, norm=scale, cmap="magma_r", interpolation="nearest")
    mean, largest = (f"{x:.2g}" if x >= 1e-3 else "below 0.001" for x in (delta_e.mean(), delta_e.max()))
    words = "the reference" if colours.name == EXACT else f"mean {mean}, largest {largest}"
    below.set_title(words, fontsize="small")


def _over(pixels: Sphere, values: np.ndarray) -> np.ndarray:
    """Values (thicknesses, angles, channels) at the pixels of a sphere, by bilinear interpolation."""
    from scipy.ndimage import map_coordinates  # slow to import

    row = (1 - pixels.normal[:, 1]) / 2 * (values.shape[0] - 1)
    column = np.rad2deg(np.arccos(pixels.cosine)) / STEEPEST * (values.shape[1] - 1)
    at = np.stack([row, np.minimum(column, values.shape[1] - 1)])
    return np.stack([map_coordinates(each, at, order=1) for each in np.moveaxis(values, -1, 0)], axis=-1)


def export_text(export: Export) -> str:
    """Format an exported film as plain text."""
    material = export.material
    notes = [line for note in material.look.notes for line in wrapped(note, "- ", "  ")]
    if material.solved is None:
        return block(f"{export.title}: {material.name}", [*wrapped("exact colours, tabulated"), *notes])
    sets = {"as it is": material.solved.physical, "solved": material.solved.effective}
    rows = [("", *sets)]
    even = len(material.look.thickness) == 1
    ends = [solution.scale * material.look.thickness[[0, -1]] for solution in sets.values()]
    spans = (f"{low:.5g}" if even else f"{low:.5g} to {high:.5g}" for low, high in ends)
    rows.append(("thickness (nm)", *spans))
    for key in material.solved.physical.numbers:
        values = (np.ravel(solution.numbers[key]) for solution in sets.values())
        rows.append((key, *(" ".join(f"{x:.4g}" for x in value) for value in values)))
    rows.append(("mean ΔE2000", *(f"{each.error.mean:.2f}" for each in sets.values())))
    rows.append(("largest ΔE2000", *(f"{each.error.largest:.1f}" for each in sets.values())))
    used = "solved numbers are" if material.solved.used == "effective" else "film's own numbers are"
    said = wrapped(
        f"ΔE2000 of {material.solved.formula.name} from the exact colours (CIE 1931, D65), 0 to 80 degrees."
        f" The {used} drawn; the file has both."
    )
    return block(f"{export.title}: {material.name}", [*table(rows), "", *said, *notes])
