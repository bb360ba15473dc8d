"""Blender: a Python script that makes the material, and a `.blend` file where the package bpy is installed.

A metal or semiconductor is a Metallic BSDF with n + ik per channel, whose film needs Blender 5.0; a
transparent base is a Principled BSDF that transmits, with a film since Blender 4.2. Thicknesses are in nm; a
map of them is a grey image of 16 bits, one of n or k of a base an image of three channels of 8 bits. The film
is drawn by Cycles; EEVEE leaves it out.

`cycles_formula` is the film colour of Cycles 5: Airy's series with the Fourier transforms of red, green and
blue. Interference of Belcour and Barla with three orders, Fresnel's equations for s and p, and one index n +
ik of the base per channel. The film is transparent and without dispersion. Light is white of equal energy,
whose colour is taken for that of D65. Blender 4.2 has films on dielectrics only, with the Gaussians of glTF
in place of the transforms.

Source: Blender 5.0.1, `intern/cycles/kernel/closure/bsdf_util.h` (`fresnel_iridescence`) and
`intern/cycles/doc/precompute/thin_film_table.py`; renders agree with this module to 1e-6.
"""

import subprocess
import sys
from functools import cache
from importlib.resources import files
from importlib.util import find_spec
from pathlib import Path
from pprint import pformat
from textwrap import fill
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float

from pellicle.colour.observers import columns
from pellicle.errors import UsageError
from pellicle.files import replacing, write_text
from pellicle.optics.orders import airy_series
from pellicle.optics.pair import Pair, abs2, real
from pellicle.rendering.appearance import Appearance
from pellicle.rendering.formula import Formula, Key, Numbers
from pellicle.rendering.gltf import XYZ_TO_REC709
from pellicle.rendering.targets import Material, Target
from pellicle.rendering.textures import share_of_range, write_image

ORDERS = 3
_POINTS = 1022
_LONGEST = 60_000 / (2 * np.pi)
"""Optical path (nm) at the end of the table; longer paths take its last entry."""


@cache
def _transforms() -> Complex[np.ndarray, "512 3"]:
    """Transforms of red, green and blue at equal steps of the optical path from 0; 1 at path 0."""
    from scipy.interpolate import CubicSpline  # slow to import

    table = columns("observers.csv")
    nm = table["wavelength_nm"]
    observer = np.stack([table[f"{axis}_1931"] for axis in "xyz"], axis=1)
    ended = np.pad(observer, ((1, 1), (0, 0)))
    spline = CubicSpline(np.concatenate([[nm[0] - 1], nm, [nm[-1] + 1]]), ended, extrapolate=False)
    wavenumber = np.linspace(0.0, np.pi * (_POINTS - 1) / 60, _POINTS)[1:]  # 1/µm
    resampled = np.nan_to_num(spline(1000 / wavenumber)) / wavenumber[:, None] ** 2
    rgb = np.conj(np.fft.rfft(np.pad(resampled, ((1, 0), (0, 0))), axis=0)) @ XYZ_TO_REC709.T
    return rgb / rgb[0].real


def sensitivity(path: Any) -> Pair:
    """Transforms (..., 3) of red, green and blue at optical paths (...) in nm, interpolated as in Cycles."""
    table = _transforms()
    last = len(table) - 1
    at = jnp.clip(path * (last / _LONGEST), 0.0, last)
    row = jnp.minimum(at.astype(int), last - 1)
    step = (at - row)[..., None]
    both = [
        jnp.asarray(part)[row] * (1 - step) + jnp.asarray(part)[row + 1] * step
        for part in (np.real(table), np.imag(table))
    ]
    return Pair(*both)


def film(index: Any, base: Pair, thickness: Any, cosine: Any) -> Float[Array, "... 3"]:
    """Linear sRGB (..., 3) of a film of one `index` in air on a base of three indices n + ik."""
    ratio = jnp.clip(thickness, 0.0, 1.0)  # below 1 nm the film becomes air
    index = 1 + (index - 1) * ratio**2 * (3 - 2 * ratio)
    path = 2 * thickness * jnp.sqrt(index**2 - (1 - cosine**2))
    waves = sensitivity(path * np.arange(1, ORDERS + 1).reshape(-1, *[1] * jnp.ndim(path)))
    angle, total = jnp.arccos(cosine)[..., None], 0.0
    for letter in "sp":
        series = airy_series(1.0, index[..., None], base, 0.0, angle, letter)
        upper, lower = real(series.upper), series.lower
        into = 1 - upper**2
        returned = into**2 * abs2(lower) / (1 - upper**2 * abs2(lower))
        seen = upper**2 + returned
        term, step = lower * (upper * (into - returned)), -(lower * upper)
        for re, im in zip(waves.re, waves.im, strict=True):
            seen = seen + 2 * real(term * Pair(re, im))
            term = term * step
        total = total + 0.5 * seen
    return jnp.clip(total, 0.0, 1.0)


def _colour(numbers: Numbers, thickness: Any, cosine: Any) -> Float[Array, "... 3"]:
    """Linear sRGB of a film on a metal, or on a dielectric, whose base has no extinction."""
    n = jnp.asarray(numbers["base_ior"]) * jnp.ones(3)
    k = jnp.asarray(numbers.get("base_extinction", jnp.zeros(3)))
    return film(jnp.asarray(numbers["ior"]), Pair(n, k), *jnp.broadcast_arrays(thickness, cosine))


_FILM = Key("ior", 1.0, 4.0)
METAL = Formula(
    "film of Cycles 5 on a metal",
    (_FILM, Key("base_ior", 0.05, 8.0, 3), Key("base_extinction", 0.0, 10.0, 3)),
    _colour,
    lambda look: {"ior": look.index, "base_ior": np.real(look.base), "base_extinction": np.imag(look.base)},
)
DIELECTRIC = Formula(
    "film of Cycles 5 on a dielectric",
    (_FILM, Key("base_ior", 1.0, 4.0)),
    _colour,
    lambda look: {"ior": look.index, "base_ior": np.real(look.base[..., 1])},
)


def cycles_formula(look: Appearance) -> Formula:
    """Return the formula for the base of a film."""
    return METAL if look.metallic else DIELECTRIC


def write(path: Path, material: Material) -> tuple[Path, ...]:
    """Write the script, the images of maps, and a `.blend` if the path ends so.

    **Raises:** UsageError for a `.blend` without bpy, and where bpy fails.
    """
    script = path.with_suffix(".py")
    if path != script and find_spec("bpy") is None:
        raise UsageError(
            f"{path}: needs the package bpy, which runs on Python 3.11 with NumPy 1; write {script.name},"
            f" and run it where bpy is installed: python {script.name} --save {path.name}"
        )
    written = [script]
    write_text(script, script_text(material, path.stem))
    if material.thickness_map is not None:
        image = path.with_name(f"{path.stem}_thickness.png")
        written.append(write_image(image, share_of_range(material.thickness_map)))
    if material.roughness_map is not None:
        image = path.with_name(f"{path.stem}_roughness.png")
        written.append(write_image(image, np.sqrt(material.roughness_map)))
    for key, values in material.base_images.items():
        written.append(write_image(path.with_name(f"{path.stem}_{key}.png"), share_of_range(values)))
    if path != script:
        written.insert(0, _save(script, path))
    return tuple(written)


def script_text(material: Material, stem: str) -> str:
    """Return the script of a material, whose files are named `stem`."""
    errors = " and ".join(
        f"{each.error.mean:.2g} (largest {each.error.largest:.2g}) with the {name} numbers"
        for name, each in material.drawn.sets.items()
    )
    heading = f"Mean ΔE2000 from the exact colours, 0 to 80 degrees: {errors}."
    constants = {
        "RECORD": material.record(),
        "METALLIC": material.look.metallic,
        "ROUGHNESS": float(np.sqrt(material.look.roughness)),  # Blender squares it to GGX's α
        "THICKNESS_MAP": None if material.thickness_map is None else f"{stem}_thickness.png",
        "ROUGHNESS_MAP": None if material.roughness_map is None else f"{stem}_roughness.png",
        "BASE_MAPS": {key: f"{stem}_{key}.png" for key in material.base_images},
    }
    body = [f"{key} = {pformat(value, width=100, sort_dicts=False)}" for key, value in constants.items()]
    template = files("pellicle.rendering").joinpath("blender_script.txt").read_text("utf-8")
    return template.replace("# ERRORS", fill(heading, 100), 1).replace("# CONSTANTS", "\n".join(body), 1)


def _save(script: Path, path: Path) -> Path:
    """Run the script by bpy in a process of its own: it ends the program where it fails."""
    with replacing(path) as temporary:
        ran = subprocess.run(
            [sys.executable, str(script), "--save", str(temporary)],
            capture_output=True,
            text=True,
            check=False,
        )
        if ran.returncode != 0 or temporary.stat().st_size == 0:
            last = (ran.stderr.strip() or ran.stdout.strip()).rpartition("\n")[2]
            raise UsageError(f"{path}: bpy did not write it ({last}); {script} is written")
    return path


TARGET = Target("blender", "Blender", (".py", ".blend"), (), cycles_formula, write, takes_map=True)
