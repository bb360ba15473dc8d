"""Pictures of films in nature and optics for docs/figures: a dragonfly's wing, coated lenses, and a beetle.

The colour of every pixel is that of its film's own spectrum, for s and p, at the wavelengths of
`integration_bands`: reflected from the studio, and for wing and lenses also what passes from the background.
`difference` compares it with the film's spectrum in steps of 1 nm (CIE 1931, D65). `make figures` draws the
pictures, and prints these differences.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import PIL.Image
import PIL.ImageDraw
from PIL.Image import Image
from scipy.spatial import cKDTree

import pellicle as pl
from pellicle.colour import delta_e2000, lab, sensor, srgb
from pellicle.colour.spaces import into_srgb, srgb_matrix
from pellicle.simulation.environment import EYE, studio
from pellicle.simulation.film_sphere import Stack, linear_srgb, spectra, stack

DARK, LIGHT = 0.01, 1.0
"""Radiance behind what is transparent."""
COSINES = 256
"""Nodes of the cosine between which colours of even films are interpolated."""


class Picture(NamedTuple):
    """Pixels with a film in an image: `mask` (rows, columns); thickness in nm, `normal` (pixels, 3) and
    `shade` (pixels,), 1 where the film is seen and 0 on what is black, as the veins of a wing."""

    scene: pl.Scene
    mask: np.ndarray
    thickness: np.ndarray
    normal: np.ndarray
    shade: np.ndarray

    def linear(self, behind: float, films: Stack | None = None, some: slice = slice(None)) -> np.ndarray:
        """Linear sRGB (pixels, 3) of some pixels before a background of one radiance."""
        films = stack(self.scene) if films is None else films
        normal, nm = self.normal[some], self.thickness[some]
        cosine = normal @ EYE
        seen = np.clip(cosine, 0.05, 1.0)
        if np.ptp(nm) == 0:  # an even film: colours between even cosines
            nodes = np.linspace(0.05, 1.0, COSINES)
            each = spectra(films, nm[0], nodes)
            reflected, passed = (
                np.stack([np.interp(seen, nodes, channel) for channel in linear_srgb(films, x).T], axis=-1)
                for x in (each.reflected, each.transmitted)
            )
        else:
            each = spectra(films, nm, seen)
            reflected, passed = (linear_srgb(films, x) for x in (each.reflected, each.transmitted))
        if np.max(np.imag(self.scene.substrate.material(films.eye.wavelength))) > 1e-4:
            passed = 0.0  # the base absorbs it
        light = studio().radiance(2 * cosine[:, None] * normal - EYE)[:, None]
        return (reflected * light + passed * behind) * self.shade[some, None]

    def difference(self, behind: float, count: int = 2000) -> np.ndarray:
        """ΔE2000 of every few pixels from spectra in steps of 1 nm, exposed as the picture is."""
        some = slice(None, None, max(1, len(self.normal) // count))
        quick, exact = (self.linear(behind, films, some) for films in (None, stack(self.scene, eye=sensor())))
        to_xyz = np.linalg.inv(srgb_matrix(sensor().white)).T
        scale = exposure(quick)
        return delta_e2000(*(lab(scale * x @ to_xyz, sensor().white) for x in (quick, exact)))

    def image(self, linear: np.ndarray, behind: float, scale: float) -> np.ndarray:
        """sRGB (rows, columns, 3) of linear colours of the pixels, at an exposure."""
        whole = np.full((*self.mask.shape, 3), behind)
        whole[self.mask] = linear
        return np.asarray(srgb(into_srgb(scale * whole)))


def exposure(linear: np.ndarray) -> float:
    """Factor, of two digits, that shows the 99th percentile of the largest channel as white."""
    return float(f"{1 / np.percentile(linear.max(axis=-1), 99.0):.2g}")


def grid(rows: int, columns: int, width: float) -> tuple[np.ndarray, np.ndarray]:
    """x and y of pixels, y upward, over a width; the height is that of square pixels."""
    height = width * rows / columns
    return np.meshgrid(np.linspace(-0.5, 0.5, columns) * width, np.linspace(0.5, -0.5, rows) * height)


def tilted(slope_x: np.ndarray, slope_y: np.ndarray) -> np.ndarray:
    """Normals (pixels, 3) of a height with these slopes."""
    normal = np.stack([-slope_x, -slope_y, np.ones_like(slope_x)], axis=-1)
    return normal / np.linalg.norm(normal, axis=-1, keepdims=True)


def dragonfly_wing(columns: int = 640) -> Picture:
    """A wing of chitin (index 1.56), 330 to 810 nm thick: ridges along it, cells between black veins."""
    random = np.random.default_rng(5)
    x, y = grid(int(0.30 * columns), columns, 2.0)
    u = (x + 0.96) / 1.92  # from the hinge to the tip
    share = np.clip(u, 1e-6, 1.0)
    front, back = (
        0.05 + 0.21 * share**0.6 * (1 - share**9),
        -0.02 - 0.42 * share**0.75 * (1 - share**4) ** 0.8,
    )
    mask = (u > 0) & (u < 1) & (y < front) & (y > back)
    v = (y - back) / np.maximum(front - back, 1e-6)
    centres = np.stack([random.uniform(-0.96, 0.96, 520), random.uniform(-0.36, 0.3, 520)], axis=-1)
    # cells are longer near the front edge, where veins run along the wing
    stretch = np.array([0.75, 1.0])
    near, _ = cKDTree(centres * stretch).query(np.stack([x, y], axis=-1) * stretch, k=2)
    edge = np.minimum((near[..., 1] - near[..., 0]) / 0.006, 1.0)
    along = np.abs((v * 7 + 0.5) % 1 - 0.5) * (front - back) / 7
    ribs = np.where(v > 0.55, np.clip(along / 0.004, 0, 1), 1.0)
    rim = np.clip(np.minimum(front - y, y - back) / 0.008, 0, 1)
    spot = np.clip(np.hypot((u - 0.87) / 0.045, (v - 0.94) / 0.07) - 0.5, 0, 0.5) * 2
    ridge = np.sin(2 * np.pi * (9 * v + 0.6 * np.sin(5 * u)))
    domes = 1 - np.clip(near[..., 0] / 0.05, 0, 1) ** 2  # cells are thinner in the middle
    nm = 700 - 170 * u + 70 * ridge - 90 * domes + 40 * np.sin(7 * u + 3 * v)
    # folds of the wing, steeper toward the front
    fold = 0.22 * np.cos(2 * np.pi * 4.5 * v) + 0.05 * np.cos(2 * np.pi * 9 * v)
    bow = 0.12 * np.sin(3.0 * u + 0.4)
    shade = (edge * ribs * rim * spot) ** 1.5
    return Picture(
        pl.Scene(pl.Layer(1.56, 700.0), 1.0),
        mask,
        nm[mask],
        tilted(bow[mask] - 0.28, fold[mask] - 0.30),
        shade[mask],
    )


def lens(layers: list, size: int = 220) -> Picture:
    """The front face of a lens of BK7 under coatings, a cap of a sphere."""
    x, y = grid(size, size, 2.1)
    mask = np.hypot(x, y) < 1
    slope = 0.62  # sine at the rim
    normal = np.stack([slope * x, slope * y, np.sqrt(1 - slope**2 * np.minimum(x**2 + y**2, 1))], -1)[mask]
    scene = pl.Scene(layers, "BK7")
    nm = float(layers[0].thickness)
    return Picture(scene, mask, np.full(len(normal), nm), normal, np.ones(len(normal)))


COATINGS = {
    "bare": [pl.Layer(1.0, 10.0)],
    "MgF2, 100 nm": [pl.Layer("MgF2", 100.0)],
    "three layers": [
        pl.Layer("MgF2", 93.7),
        pl.Layer("ZrO2", 105.2),
        pl.Layer("Al2O3", 55.4),
    ],
}
"""Reflectances of 4.3, 1.3 and 0.04 % to the eye at normal incidence; the three layers are a least of it."""


def beetle(rows: int = 350) -> Picture:
    """Wing cases of a jewel beetle: 8 pairs of chitin and melanin layers, 1.56 and 1.70, on dark chitin.

    Their surface is dimpled; the gap between both cases is black.
    """
    x, y = grid(rows, int(0.62 * rows), 1.24)
    width = 0.5 * np.clip(1 - np.abs(y / 0.93) ** 2.6, 0, 1) ** 0.62 * (1 - 0.16 * y)
    share = x / np.maximum(width, 1e-6)
    mask = (np.abs(share) < 0.995) & (width > 0.02)
    slope_x = np.clip(share, -0.97, 0.97) / np.sqrt(1 - np.clip(share, -0.97, 0.97) ** 2) * 0.75
    slope_y = 0.75 * y
    pitch = 90.0
    dimple_x, dimple_y = (
        0.09 * np.sin(pitch * (a + 0.15 * b)) * np.cos(0.5 * pitch * b) for a, b in ((x, y), (y, x))
    )
    stripes = 0.10 * np.sin(2 * np.pi * 5.5 * np.abs(share)) * np.exp(-((share / 0.9) ** 8))
    gap = np.clip((np.abs(x) - 0.004) / 0.008, 0, 1)
    pair = [pl.Layer(1.56, 94.0), pl.Layer(1.70, 86.0)]
    scene = pl.Scene(
        [pl.Layer(1.56, 94.0, name="cuticle"), *[pair[(k + 1) % 2] for k in range(15)]], 1.70 + 0.06j
    )
    slopes = slope_x + dimple_x + stripes * np.sign(x), slope_y + dimple_y
    nm = np.full(mask.sum(), 94.0)
    return Picture(scene, mask, nm, tilted(*(each[mask] for each in slopes)), gap[mask])


def panels(views: dict[str, tuple[Picture, float]], across: int, exposed_as: int | None = None) -> Image:
    """Pictures by their titles with the radiance behind them, `across` in each row, with their exposures.

    `exposed_as` is the number of the picture in its row whose exposure the others of the row have.
    """
    linear = [picture.linear(behind) for picture, behind in views.values()]
    scales = [exposure(x) for x in linear]
    if exposed_as is not None:
        scales = [scales[k - k % across + exposed_as] for k in range(len(scales))]
    first = next(iter(views.values()))[0].mask.shape
    wide, high = first[1] + 8, first[0] + 22
    sheet = PIL.Image.new("RGB", (across * wide, len(views) // across * high), "white")
    draw = PIL.ImageDraw.Draw(sheet)
    for k, (title, (picture, behind)) in enumerate(views.items()):
        left, top = k % across * wide + 4, k // across * high
        pixels = np.rint(255 * picture.image(linear[k], behind, scales[k])).astype(np.uint8)
        sheet.paste(PIL.Image.fromarray(pixels), (left, top + 18))
        draw.text((left, top + 3), f"{title}; exposure x {scales[k]:g}", fill="black", font_size=11)
    return sheet


def wing_figure() -> Image:
    """The wing before a dark and a white background."""
    wing = dragonfly_wing()
    return panels({"before black": (wing, DARK), "before white": (wing, LIGHT)}, 1)


def lens_figure() -> Image:
    """Three lenses before a dark and a light background, each row with the exposure of the bare one."""
    lenses = {name: lens(layers) for name, layers in COATINGS.items()}
    words = (("dark", DARK), ("light", 0.6))
    return panels({f"{name}, {word}": (p, b) for word, b in words for name, p in lenses.items()}, 3, 0)


def beetle_figure() -> Image:
    """The beetle's wing cases and those with two pairs of layers, which pass no light, on black and white."""
    whole = beetle()
    few = whole._replace(scene=pl.Scene(whole.scene.layers[:4], whole.scene.substrate))
    views = {"8 pairs of layers": (whole, DARK), "2 pairs": (few, DARK), "8 pairs, white": (whole, LIGHT)}
    return panels(views, 3)


def differences() -> dict[str, float]:
    """Mean ΔE2000 of each picture from spectra in steps of 1 nm."""
    drawn = {"wing": dragonfly_wing(160), "beetle": beetle(120)}
    drawn |= {name: lens(layers, 60) for name, layers in COATINGS.items()}
    return {name: float(np.mean(picture.difference(DARK))) for name, picture in drawn.items()}


PICTURES = {"dragonfly_wing": wing_figure, "coated_lenses": lens_figure, "jewel_beetle": beetle_figure}
