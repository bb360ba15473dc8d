"""Directions as unit vectors (..., 3) away from the surface, in a frame whose third axis is the normal.

Every root here has slope zero where it is zero, so that values and gradients are finite at normal and at
grazing incidence.
"""

from typing import Any, TypeAlias

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from pellicle.optics.pair import sqrt

Vectors: TypeAlias = Float[Array | np.ndarray, "... 3"]


def direction(theta: Any, phi: Any, xp: Any = jnp) -> Float[Array | np.ndarray, "... 3"]:
    """Return the unit vector at polar angle `theta` from the normal and azimuth `phi`, both in degrees.

    `xp` is `jax.numpy` or `numpy`, whose kind of array is returned.

    >>> direction(90.0, 0.0).round(6).tolist()
    [1.0, 0.0, 0.0]
    """
    theta, phi = xp.broadcast_arrays(xp.deg2rad(theta), xp.deg2rad(phi))
    sine = xp.sin(theta)
    return xp.stack([sine * xp.cos(phi), sine * xp.sin(phi), xp.cos(theta)], axis=-1)


def dot(a: Vectors, b: Vectors) -> Any:
    """Return ⟨a, b⟩ over the last axis."""
    return a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2]


def length(v: Vectors) -> Float[Array, "..."]:
    """Return |v|, with slope zero at v = 0."""
    v = jnp.asarray(v)
    return sqrt(dot(v, v))


def frame(theta: Any, phi: Any) -> Float[Array, "... 3 3"]:
    """Return the rows t, b, n of the surface's frame tilted to the normal n at (theta, phi), in degrees.

    The axis of rotation is perpendicular to the plane of the tilt, so that at theta = 0 the frame is that
    of the surface for any phi. `frame @ v` has the components of v in it.
    """
    n = direction(theta, phi)
    x, y, z = n[..., 0], n[..., 1], n[..., 2]
    # 1/(1 + z) is (1 − cos θ)/sin² θ without its 0/0 at the normal
    fold = 1 / (1 + z)
    t = jnp.stack([1 - fold * x * x, -fold * x * y, -x], axis=-1)
    b = jnp.stack([-fold * x * y, 1 - fold * y * y, -y], axis=-1)
    return jnp.stack([t, b, n], axis=-2)


def reflect(v: Vectors, normal: Vectors) -> Vectors:
    """Return the mirror direction 2⟨v, n⟩n − v, which like `v` points away from the surface."""
    return 2 * dot(v, normal)[..., None] * normal - v


def cosine_inside(cosine: Any, index: Any) -> Float[Array, "..."]:
    """Return cos θ₁ = √(1 − (1 − cos² θ₀)/n²) in a medium of relative index n; 0 in total reflection."""
    inverse = 1 / (index * index)
    return sqrt(jnp.maximum(1 - inverse + inverse * cosine * cosine, 0.0))


def half_vector(i: Vectors, o: Vectors) -> Vectors:
    """Return the half vector (i + o)/|i + o|; zero where i = −o."""
    both = i + o
    size = length(both)
    return both / jnp.where(size == 0, 1.0, size)[..., None]


def cosine_to_half(i: Vectors, o: Vectors) -> Float[Array, "..."]:
    """Return ⟨i, h⟩ = ⟨o, h⟩ = |i + o|/2, the cosine of incidence on a facet that mirrors i into o."""
    return 0.5 * length(i + o)


def angle_to_half(i: Vectors, o: Vectors) -> Float[Array, "..."]:
    """Return the angle (radians) between i and h. Its slope at i = o is set to zero: use even functions."""
    return jnp.arctan2(length(i - o), length(i + o))
