"""Identity of a map: hashes of what it is computed from, which decide whether a store can be continued."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping
from importlib.metadata import version
from typing import Any

import numpy as np

from pellicle.data.cube import Cube
from pellicle.data.fingerprint import fingerprint
from pellicle.mapping.blocks import BYTES
from pellicle.scene.film import Scene

FORMAT = "pellicle.map-store/1"
"""Version of the layout of a store."""

_OTHERWISE = {
    "format": "has the layout of another version of pellicle",
    "version": "was made by another version of pellicle",
    "input": "is of another input, or of one that was read otherwise",
    "scene": "is of another scene",
    "options": "was made with other options",
}


def identity(cube: Cube, scene: Scene, options: Mapping[str, Any]) -> dict[str, str]:
    """Hash the input, the scene and the options of a map.

    The content of a cube without a `fingerprint` is read once, slab by slab.
    """
    read = cube.signal, cube.polarisation, cube.calibrated, cube.dims, cube.wavelength, cube.angle, cube.mask
    return {
        "format": FORMAT,
        "version": version("pellicle"),
        "input": fingerprint(cube.fingerprint or _content(cube), cube.shape, *read),
        "scene": fingerprint(scene),
        "options": fingerprint(dict(options)),
    }


def difference(stored: Mapping[str, str], wanted: Mapping[str, str]) -> str:
    """The first difference of two identities in words, empty where they are equal."""
    return next((words for key, words in _OTHERWISE.items() if stored.get(key) != wanted[key]), "")


def _content(cube: Cube) -> list[str]:
    """Hashes of all arrays, read in slabs along the first axis of pixels."""
    found = []
    for name, array in sorted(cube.arrays.items()):
        digest = hashlib.sha256(f"{name} {array.dtype} {array.shape}".encode())
        rows = max(1, int(BYTES * array.shape[0] / (np.dtype(array.dtype).itemsize * math.prod(array.shape))))
        for start in range(0, array.shape[0], rows):
            digest.update(np.ascontiguousarray(array[start : start + rows]).tobytes())
        found.append(digest.hexdigest())
    return found
