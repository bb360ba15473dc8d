"""Triangles of a sphere, on which exported materials are shown."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class Mesh(NamedTuple):
    """Unit sphere: `positions` (vertices, 3), which are the normals too, `texture` coordinates (vertices, 2)
    from the upper left of an image, and `triangles` (triangles, 3), counterclockwise from outside."""

    positions: np.ndarray
    texture: np.ndarray
    triangles: np.ndarray


def sphere_mesh(rows: int = 48, columns: int = 96) -> Mesh:
    """Return a sphere of `rows` from the upper pole (+y) to the lower one, and `columns` around it."""
    v, u = np.meshgrid(np.linspace(0, 1, rows + 1), np.linspace(0, 1, columns + 1), indexing="ij")
    theta, phi = np.pi * v, 2 * np.pi * u
    positions = np.stack(
        [-np.sin(theta) * np.cos(phi), np.cos(theta), np.sin(theta) * np.sin(phi)], axis=-1
    ).reshape(-1, 3)
    texture = np.stack([u, v], axis=-1).reshape(-1, 2)
    upper_left = (np.arange(rows)[:, None] * (columns + 1) + np.arange(columns)).reshape(-1)
    right, below = upper_left + 1, upper_left + columns + 1
    first = np.stack([upper_left, below, right], axis=-1)[columns:]  # at the upper pole it has no area
    second = np.stack([right, below, below + 1], axis=-1)[:-columns]
    return Mesh(positions, texture, np.concatenate([first, second]))
