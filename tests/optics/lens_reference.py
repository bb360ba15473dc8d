"""Light through a lens on layers of any permittivity, in the laboratory's axes: no plane of incidence turns.

Fields (Ex, Ey, Hx, Hy) obey d/dz = i k₀ D for a transverse wave vector in any direction, and a layer is the
exponential of D by its eigenvectors. The lens turns a ray and its fields as vectors, and the lens behind the
sample is its mirror image.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

TO_STOKES = np.array([[1, 0, 0, 1], [1, 0, 0, -1], [0, 1, 1, 0], [0, -1j, 1j, 0]])
"""From the coherency vector (p p*, p s*, s p*, s s*); S₃ is 2 Im p s*."""
DOWNWARDS = np.array([1.0, 1.0, -1.0])


class Plate(NamedTuple):
    """An incoherent plate without losses: the mean over the phase of the light that crosses it."""

    n: float
    phases: int = 32


class Ray(NamedTuple):
    """A ray behind the lens, with the fields of p and of s of the light before it."""

    direction: np.ndarray
    p: np.ndarray
    s: np.ndarray


def permittivity(indices: Sequence[complex], theta: float, phi: float, psi: float = 0.0) -> np.ndarray:
    """Two indices are ordinary and extraordinary; angles in degrees."""
    own = [indices[0], *indices] if len(indices) == 2 else indices
    turn = Rotation.from_euler("ZYZ", [phi, theta, psi], degrees=True).as_matrix()
    return turn @ np.diag(np.square(own)) @ turn.T


def rays(angle: float, half: float, rings: int, around: int) -> tuple[Ray, np.ndarray]:
    """Rays that fill the pupil evenly, along a first axis, and their weights; angles in degrees."""
    nodes, weights = np.polynomial.legendre.leggauss(rings)
    radius, azimuth = np.meshgrid(
        np.sqrt(0.5 * (nodes + 1)) * np.sin(np.deg2rad(half)),
        2 * np.pi * (np.arange(around) + 0.37) / around,
        indexing="ij",
    )
    c, s = np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle))
    axis, p, s = np.array([s, 0.0, c]), np.array([c, 0.0, -s]), np.array([0.0, 1.0, 0.0])
    about = np.outer(np.cos(azimuth), np.cross(axis, p)) + np.outer(np.sin(azimuth), np.cross(axis, s))
    turn = Rotation.from_rotvec(about * np.arcsin(radius).reshape(-1, 1))
    weight = np.repeat(0.5 * weights, around) / around
    return Ray(turn.apply(axis), turn.apply(p), turn.apply(s)), weight


def seen(
    ray: Ray, layers: Sequence[Any], foot: complex, nm: float, phase: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """Jones matrices of each ray: reflection in the frames of both lenses, and transmission into the foot,
    whose squares are fractions of power. A layer is (permittivity, nm), or a `Plate` that adds `phase`."""
    kx, ky, _ = ray.direction.T
    through = np.broadcast_to(np.eye(4), (len(kx), 4, 4))
    for layer in layers:
        if isinstance(layer, Plate):
            # D² = q² in an isotropic medium
            q = np.sqrt(layer.n**2 - kx**2 - ky**2)[:, None, None]
            one = np.cos(phase) * np.eye(4) - 1j * np.sin(phase) / q * _derivative(
                layer.n**2 * np.eye(3), kx, ky
            )
        else:
            q, modes = np.linalg.eig(_derivative(layer[0], kx, ky))
            one = modes * np.exp(-2j * np.pi / nm * layer[1] * q)[:, None] @ np.linalg.inv(modes)
        through = through @ one
    q = np.sqrt(foot**2 - kx**2 - ky**2 + 0j)
    k = np.stack([kx, ky, q], axis=-1)
    s = np.stack([-ky, kx, 0 * kx], axis=-1) / np.hypot(kx, ky)[:, None]
    up = ray.direction * DOWNWARDS
    out = _fields(up, -ray.p * DOWNWARDS, ray.s * DOWNWARDS)
    found = np.linalg.solve(
        np.concatenate([through @ _fields(k, np.cross(s, k), s), -out], axis=-1),
        _fields(ray.direction, ray.p, ray.s),
    )
    # power of a wave of unit E × n of p, and of unit E of s
    flux = np.stack([np.real(foot**2 * q.conj()), q.real]).T / ray.direction[:, 2:]
    return found[:, 2:], found[:, :2] * np.sqrt(flux)[:, :, None]


def _fields(k: np.ndarray, *electric: np.ndarray) -> np.ndarray:
    magnetic = [np.cross(k, e) for e in electric]
    columns = [np.concatenate([e[:, :2], h[:, :2]], axis=1) for e, h in zip(electric, magnetic, strict=True)]
    return np.stack(columns, axis=-1)


def _derivative(e: np.ndarray, kx: np.ndarray, ky: np.ndarray) -> np.ndarray:
    """D, from curl E = i k₀ H and curl H = −i k₀ ε E with Ez and Hz eliminated."""
    Ex, Ey, Hx, Hy = np.eye(4)
    kx, ky = kx[:, None], ky[:, None]
    Hz = kx * Ey - ky * Ex
    Ez = -(e[2, 0] * Ex + e[2, 1] * Ey + kx * Hy - ky * Hx) / e[2, 2]
    Dx, Dy = (e[i, 0] * Ex + e[i, 1] * Ey + e[i, 2] * Ez for i in range(2))
    return np.stack([Hy + kx * Ez, ky * Ez - Hx, kx * Hz - Dy, ky * Hz + Dx], axis=1).astype(complex)


def muellers(
    angle: float,
    half: float,
    layers: Sequence[Any],
    foot: complex,
    nm: float,
    count: tuple[int, int] = (20, 41),
) -> tuple[np.ndarray, np.ndarray]:
    """Mueller matrices (4, 4) of reflection and transmission, means over the rays of a cone in air."""
    ray, weight = rays(angle, half, *count)
    phases = [x.phases for x in layers if isinstance(x, Plate)]
    steps = np.arange(*phases or (1,)) / max([1, *phases])
    found = [seen(ray, layers, foot, nm, 2 * np.pi * step) for step in steps]
    mean = [
        np.mean([_coherency(weight, jones) for jones in each], axis=0) for each in zip(*found, strict=True)
    ]
    reflected, passed = (np.real(TO_STOKES @ m @ np.linalg.inv(TO_STOKES)) for m in mean)
    return reflected, passed


def _coherency(weight: np.ndarray, jones: np.ndarray) -> np.ndarray:
    return np.einsum("r,rij,rkl->ikjl", weight, jones, jones.conj()).reshape(4, 4)


def berreman(e: np.ndarray, a: float) -> np.ndarray:
    """Δ of the fields (Ex, Hy, Ey, −Hx) in the plane of incidence, by elimination of Ez."""
    z = np.array([-e[2, 0], -a, -e[2, 1], 0]) / e[2, 2]
    unit = np.eye(4)
    displacement = [e[i, 0] * unit[0] + e[i, 1] * unit[2] + e[i, 2] * z for i in range(2)]
    return np.array([unit[1] + a * z, displacement[0], unit[3], displacement[1] - a * a * unit[2]])
