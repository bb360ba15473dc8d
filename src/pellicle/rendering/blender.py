"""Blender: a Python script that makes the material, and a `.blend` file where the package bpy is installed.

A metal or semiconductor is a Metallic BSDF with n + ik per channel, whose film needs Blender 5.0; a
transparent base is a Principled BSDF that transmits, with a film since Blender 4.2. Thicknesses are in nm; a
map of them is a grey image of 16 bits. The film is drawn by Cycles; EEVEE leaves it out.
"""

from __future__ import annotations

import subprocess
import sys
from importlib.resources import files
from importlib.util import find_spec
from pathlib import Path
from pprint import pformat
from textwrap import fill

import numpy as np

from pellicle.errors import UsageError
from pellicle.files import replacing, write_text
from pellicle.rendering.cycles_formula import cycles_formula
from pellicle.rendering.material import Material
from pellicle.rendering.targets import Target


def write(path: Path, material: Material) -> tuple[Path, ...]:
    """Write the script, the image of a map, and a `.blend` if the path ends so.

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
        written.append(_write_image(path.with_name(f"{path.stem}_thickness.png"), material.thickness_map))
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
    }
    body = [f"{key} = {pformat(value, width=100, sort_dicts=False)}" for key, value in constants.items()]
    template = files("pellicle.rendering").joinpath("blender_script.txt").read_text("utf-8")
    return template.replace("# ERRORS", fill(heading, 100), 1).replace("# CONSTANTS", "\n".join(body), 1)


def _write_image(path: Path, thickness: np.ndarray) -> Path:
    """Write a grey image of 16 bits from the least thickness (0) to the largest (65535)."""
    from PIL import Image  # a requirement of Matplotlib

    span = np.ptp(thickness)
    share = (thickness - thickness.min()) / (span if span > 0 else 1.0)
    with replacing(path) as temporary:
        Image.fromarray(np.round(65535 * share).astype(np.uint16)).save(temporary, format="PNG")
    return path


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
