"""Render a heat-tinted steel blade by Mitsuba 3: the exact colours of its oxide, and those of glTF's formula.

The oxide is that of `docs/surfaces/tempered_steel.toml`, from 10 nm at the tip to 58 nm at the handle. The
upper image is rendered spectrally, with the reflectance of the film at each wavelength; the lower one in
RGB, with the formula that `KHR_materials_iridescence` publishes and the numbers of the film as they are.

python scripts/render_blade.py [--spp 256] [--width 1000]

It writes docs/figures/heat_tinted_blade.png. It takes some minutes on two cores where Dr.Jit finds LLVM 16 or
newer (`DRJIT_LIBLLVM_PATH`), and ten times as long without. It needs `pip install 'pellicle[render]'`.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path
from typing import Any

import matplotlib
import mitsuba as mi
import numpy as np

import pellicle as pl
from pellicle.colour import srgb
from pellicle.rendering import gltf as gltf_formula
from pellicle.rendering import mitsuba_plugin
from pellicle.rendering.appearance import appearance
from pellicle.rendering.mitsuba import lookup

matplotlib.use("Agg")
from matplotlib.figure import Figure

FIGURE = Path(__file__).parents[1] / "docs" / "figures" / "heat_tinted_blade.png"
THINNEST, THICKEST = 10.0, 58.0
OXIDE, STEEL = 2.9, 2.7 + 2.8j
ALPHA = 0.16
TITLES = (
    "pellicle: reflectance of the film at each wavelength",
    "glTF: the same film by the formula of KHR_materials_iridescence",
)
TICKS = np.arange(10.0, 51.0, 10.0)
EYE, TARGET, FIELD = np.array([0.35, -8.0, 9.6]), np.array([0.1, 0.02, 0.0]), 34.5
"""Camera: position, what it looks at, and its horizontal field of view in degrees."""


def variants() -> tuple[str, str]:
    """Spectral and RGB variants of Mitsuba, compiled by LLVM where it is found."""
    try:
        mi.set_variant("llvm_ad_spectral")
        return "llvm_ad_spectral", "llvm_ad_rgb"
    except ImportError:
        return "scalar_spectral", "scalar_rgb"


def tables(folder: Path) -> dict[str, Path]:
    """Write lookups of the exact colours and of glTF's formula."""
    look = appearance(pl.Scene(pl.Layer(OXIDE, THICKEST), STEEL))
    exact = lookup(look).arrays()
    count, cosines, _ = exact["rgb"].shape
    nm, cosine = np.linspace(*exact["thickness"], count), np.linspace(0.0, 1.0, cosines) ** 2
    gltf = gltf_formula.colour(gltf_formula.physical(look), nm[:, None], cosine)
    arrays: dict[str, dict[str, Any]] = {
        "exact": exact,
        "gltf": exact | {"rgb": np.asarray(gltf, np.float32)},
    }
    for name, each in arrays.items():
        np.savez(folder / f"{name}.npz", **each)
    return {name: folder / f"{name}.npz" for name in arrays}


def outline(u: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Position along the blade, and its edge and spine across it; u runs from the tip to the handle."""
    x = 6.2 * (1 - u)
    spine = 0.66 - 0.05 * np.clip(x - 3.0, 0, None) ** 2 / 1.6
    edge = -0.66 + 0.92 * np.clip((x - 2.2) / 4.0, 0, None) ** 2.4
    return x, np.minimum(edge, spine), spine


def blade(folder: Path) -> list[Path]:
    """Write meshes of both ground faces, with the length from the tip as u."""
    u, v = np.meshgrid(np.linspace(0, 1, 400), np.linspace(0, 1, 60), indexing="ij")
    x, edge, spine = outline(u)
    y = edge + (spine - edge) * v
    z = 0.24 * (spine - edge) / 1.32 * (1 - np.abs(2 * v - 1) ** 2.2)
    sides = ((folder / "top.ply", 1), (folder / "bottom.ply", -1))
    return [_write_mesh(path, x, y, side * z, u, v, side) for path, side in sides]


def _write_mesh(path: Path, x: Any, y: Any, z: Any, u: Any, v: Any, side: int) -> Path:
    rows, columns = x.shape
    at = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = at[:-1, :-1], at[1:, :-1], at[:-1, 1:], at[1:, 1:]
    faces = np.concatenate([np.stack(t, -1).reshape(-1, 3) for t in ((a, c, b), (b, c, d))])
    faces = faces[:, ::side]
    tangents = [np.stack([np.gradient(each, axis=k) for each in (x, y, z)], -1) for k in (0, 1)]
    normal = -side * np.cross(*tangents)
    normal /= np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-12)
    names = ("x", "y", "z", "nx", "ny", "nz", "u", "v")
    head = ["ply", "format binary_little_endian 1.0", f"element vertex {x.size}"]
    head += [f"property float {name}" for name in names]
    head += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header", ""]
    vertices = np.stack([x, y, z, *np.moveaxis(normal, -1, 0), u, v], axis=-1).astype("<f4")
    corners = np.zeros(len(faces), dtype=[("count", "u1"), ("at", "<i4", 3)])
    corners["count"], corners["at"] = 3, faces
    path.write_bytes("\n".join(head).encode() + vertices.tobytes() + corners.tobytes())
    return path


def _pose() -> np.ndarray:
    """Turned by 7° on the table, and by 12° about its length to the camera."""
    turn, tilt = np.deg2rad(7.0), np.deg2rad(12.0)
    about_z = np.array([[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1]])
    about_x = np.array([[1, 0, 0], [0, np.cos(tilt), -np.sin(tilt)], [0, np.sin(tilt), np.cos(tilt)]])
    pose = np.eye(4)
    pose[:3, :3] = about_z @ about_x
    pose[:3, 3] = about_z @ [-2.65, 0, 0.32]
    return pose


POSE = _pose()


def seen_at(points: np.ndarray, width: int, height: int) -> np.ndarray:
    """Pixels (N, 2) of points (N, 3) of the blade."""
    away = points @ POSE[:3, :3].T + POSE[:3, 3] - EYE
    ahead = (TARGET - EYE) / np.linalg.norm(TARGET - EYE)
    right = np.cross(ahead, [0, 0, 1])
    right /= np.linalg.norm(right)
    scale = width / 2 / np.tan(np.deg2rad(FIELD) / 2) / (away @ ahead)
    return np.stack([width / 2 + away @ right * scale, height / 2 - away @ np.cross(right, ahead) * scale], 1)


def thickness_map() -> np.ndarray:
    """Thickness over the blade as shares of its range, (rows, columns): rising from the tip, uneven."""
    random = np.random.default_rng(3)
    u, v = np.meshgrid(np.linspace(0, 1, 512), np.linspace(0, 1, 64))
    uneven = sum(
        random.normal()
        / k
        * np.sin(2 * np.pi * (k * u * 1.7 + random.uniform(-0.6, 0.6) * v + random.uniform()))
        for k in range(1, 7)
    )
    return np.clip(u + 0.005 * uneven + 0.04 * v, 0, 1).astype(np.float32)


def environment() -> np.ndarray:
    """A studio, (256, 512, 3): grey walls, darker below, with three soft boxes."""
    polar, azimuth = np.meshgrid(np.linspace(0, np.pi, 256), np.linspace(-np.pi, np.pi, 512), indexing="ij")
    wall = 0.10 + 0.35 * np.clip(np.cos(polar), 0, 1) + 0.12 * np.exp(-(((polar - 1.5) / 0.25) ** 2))
    light = wall * np.where(polar > np.pi / 2, 0.6, 1.0)
    for height, middle, tall, wide, power in (
        (0.75, 0.5, 0.30, 0.8, 3.4),
        (0.95, 2.6, 0.35, 0.35, 2.4),
        (1.1, -1.9, 0.3, 0.5, 2.0),
    ):
        turn = np.angle(np.exp(1j * (azimuth - middle)))
        box = (
            1
            / (1 + np.exp((np.abs(polar - height) - tall) / 0.03))
            / (1 + np.exp((np.abs(turn) - wide) / 0.04))
        )
        light = light + power * box
    return np.repeat(light[..., None], 3, axis=2).astype(np.float32)


def scene(table: Path, width: int, height: int) -> Any:
    """The blade with a handle on a grey table."""
    t = mi.ScalarTransform4f
    pose = mi.ScalarTransform4f(POSE)
    grey = {
        "type": "diffuse",
        "reflectance": {"type": "spectrum", "value": 0.16}
        if mi.is_spectral
        else {"type": "rgb", "value": 0.16},
    }
    film = {
        "type": "twosided",
        "film": {
            "type": mitsuba_plugin.NAME,
            "filename": str(table),
            "alpha": ALPHA,
            "thickness_min": THINNEST,
            "thickness_max": THICKEST,
            "thickness": {
                "type": "bitmap",
                "raw": True,
                "bitmap": mi.Bitmap(thickness_map()[..., None]),
                "wrap_mode": "clamp",
            },
        },
    }
    faces = {
        path.stem: {"type": "ply", "filename": str(path), "to_world": pose, "bsdf": film}
        for path in blade(table.parent)
    }
    wood = {
        "type": "roughplastic",
        "alpha": 0.25,
        "diffuse_reflectance": {"type": "rgb", "value": [0.03, 0.024, 0.02]},
    }
    metal = {"type": "roughconductor", "material": "Cr", "alpha": 0.3}
    handle = {}
    for name, start, end, radius, bsdf in (
        ("grip", -4.0, -0.14, 0.36, wood),
        ("bolster", -0.16, 0.05, 0.39, metal),
    ):
        own = {"to_world": pose, "bsdf": {"type": "twosided", "inside": bsdf}}
        tube = {"type": "cylinder", "p0": [start, 0.1, 0], "p1": [end, 0.1, 0], "radius": radius}
        cap = pose @ t().translate([end, 0.1, 0]).rotate([0, 1, 0], 90).scale(radius)
        handle |= {name: tube | own, f"{name}_end": {"type": "disk"} | own | {"to_world": cap}}
    return mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "path", "max_depth": 5},
            "sensor": {
                "type": "perspective",
                "fov": FIELD,
                "fov_axis": "x",
                "to_world": t().look_at(EYE.tolist(), TARGET.tolist(), [0, 0, 1]),
                "film": {
                    "type": "hdrfilm",
                    "width": width,
                    "height": height,
                    "rfilter": {"type": "gaussian"},
                },
                "sampler": {"type": "independent"},
            },
            "studio": {
                "type": "envmap",
                "bitmap": mi.Bitmap(environment()),
                "to_world": t().rotate([0, 0, 1], 0).rotate([1, 0, 0], 90),
            },
            "table": {"type": "rectangle", "to_world": t().translate([0, 0, -0.35]).scale(40), "bsdf": grey},
            **handle,
            **faces,
        }
    )


def render(table: Path, variant: str, width: int, height: int, spp: int) -> np.ndarray:
    """Linear sRGB of the rendering, (height, width, 3)."""
    mi.set_variant(variant)
    mitsuba_plugin.register()
    shown = scene(table, width, height)
    parts = [np.asarray(mi.render(shown, spp=min(spp, 64), seed=k), float) for k in range(max(1, spp // 64))]
    return np.mean(parts, axis=0)[..., :3]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--spp", type=int, default=256, help="samples of a pixel")
    parser.add_argument("--width", type=int, default=1000, help="pixels")
    parser.add_argument("--out", type=Path, default=FIGURE)
    given = parser.parse_args()
    spectral, rgb = variants()
    with tempfile.TemporaryDirectory() as folder:
        written = tables(Path(folder))
        height = int(0.3 * given.width)
        images = [
            render(written[name], variant, given.width, height, given.spp)
            for name, variant in (("exact", spectral), ("gltf", rgb))
        ]
    draw(images, given.out)


def draw(images: list[np.ndarray], path: Path) -> None:
    """Both renderings below each other, with the same exposure and the thickness along the edge."""
    height, width, _ = images[0].shape
    figure = Figure(figsize=(width / 100, (2 * height + 6) / 100), dpi=100)
    share = height / (2 * height + 6)
    x, edge, _ = outline((TICKS - THINNEST) / (THICKEST - THINNEST))
    places = [seen_at(np.stack([x, edge - off, 0 * x], 1), width, height) for off in (0.06, 0.16, 0.21)]
    size = 13 * width / 1200
    for bottom, image, title in zip((1 - share, 0.0), images, TITLES, strict=True):
        axes = figure.add_axes((0, bottom, 1, share))
        axes.imshow(np.asarray(srgb(image)), interpolation="none", aspect="auto")
        axes.set(xlim=(0, width), ylim=(height, 0))
        axes.set_axis_off()
        axes.text(0.012, 0.95, title, transform=axes.transAxes, color="white", fontsize=1.2 * size, va="top")
        for nm, start, end, label in zip(TICKS, *places, strict=True):
            axes.plot(*zip(start, end, strict=True), color="white", linewidth=1)
            axes.text(*label, f"{nm:.0f} nm", color="white", fontsize=size, ha="center", va="top")
    figure.savefig(path)


if __name__ == "__main__":
    main()
