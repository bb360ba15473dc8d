"""Directions as unit vectors (..., 3) away from the surface, in a frame whose third axis is the normal.

Every root below has slope zero where it is zero, so that values and gradients are finite at normal
and at grazing incidence.
"""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp
from jaxtyping import Array, Float

from pellicle.optics.pair import sqrt

Vectors = Float[Array, "*shape 3"]


def direction(theta: Any, phi: Any) -> Float[Array, "... 3"]:
    """The unit vector at polar angle `theta` from the normal and azimuth `phi`, both in degrees."""
    theta, phi = jnp.broadcast_arrays(jnp.deg2rad(theta), jnp.deg2rad(phi))
    sine = jnp.sin(theta)
    return jnp.stack([sine * jnp.cos(phi), sine * jnp.sin(phi), jnp.cos(theta)], axis=-1)


def dot(a: Any, b: Any) -> Any:
    """⟨a, b⟩ over the last axis."""
    return a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2]


def length(v: Any) -> Float[Array, "..."]:
    """|v|, with slope zero at v = 0."""
    return sqrt(dot(v, v))


def frame(theta: Any, phi: Any) -> Float[Array, "... 3 3"]:
    """Rows t, b, n of a frame whose normal n is at (theta, phi), degrees: the surface's turned to n.

    It is turned about the axis across the plane of the tilt, so that at theta = 0 it is the
    surface's own frame whatever phi is. `frame @ v` has v's components in it.
    """
    n = direction(theta, phi)
    x, y, z = n[..., 0], n[..., 1], n[..., 2]
    # 1/(1 + z) is (1 − cos θ)/sin² θ without its 0/0 at the normal
    fold = 1 / (1 + z)
    t = jnp.stack([1 - fold * x * x, -fold * x * y, -x], axis=-1)
    b = jnp.stack([-fold * x * y, 1 - fold * y * y, -y], axis=-1)
    return jnp.stack([t, b, n], axis=-2)


def reflect(v: Any, normal: Any) -> Float[Array, "... 3"]:
    """The mirror direction of `v`, which like `v` points away from the surface: 2⟨v, n⟩n − v."""
    return 2 * dot(v, normal)[..., None] * normal - v


def cosine_inside(cosine: Any, index: Any) -> Float[Array, "..."]:
    """cos θ₁ = √(1 − (1 − cos² θ₀)/n²) in a medium of relative index n; 0 where there is total reflection."""
    return sqrt(jnp.maximum(_inside_square(cosine, index), 0.0))


def _inside_square(cosine, index):
    inverse = 1 / (index * index)
    return 1 - inverse + inverse * cosine * cosine


def refract(v: Any, normal: Any, index: Any) -> Float[Array, "... 3"]:
    """The direction into the surface of light from `v`, refracted by the relative index n₁/n₀.

    It points down: −(v − ⟨v, n⟩n)/n₁ − cos θ₁ n. Where there is total reflection no such direction
    exists, and the vector is zero.
    """
    cosine = dot(v, normal)
    inside = cosine_inside(cosine, index)
    down = -(v - cosine[..., None] * normal) / jnp.asarray(index)[..., None] - inside[..., None] * normal
    return jnp.where((_inside_square(cosine, index) >= 0)[..., None], down, 0.0)


def half_vector(i: Any, o: Any) -> Float[Array, "... 3"]:
    """The half vector (i + o)/|i + o|; zero where i = −o."""
    both = i + o
    size = length(both)
    return both / jnp.where(size == 0, 1.0, size)[..., None]


def cosine_to_half(i: Any, o: Any) -> Float[Array, "..."]:
    """⟨i, h⟩ = ⟨o, h⟩ = |i + o|/2: the cosine at which a facet that mirrors i into o is lit."""
    return 0.5 * length(i + o)


def angle_to_half(i: Any, o: Any) -> Float[Array, "..."]:
    """The angle (radians) between i and h. Its slope at i = o is given as zero: use even functions."""
    return jnp.arctan2(length(i - o), length(i + o))
