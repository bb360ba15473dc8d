"""A thick plate under the film: its two faces add intensities, not amplitudes."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax.numpy as jnp


class Face(NamedTuple):
    """Power coefficients of a plate's face: from outside, through, and from inside the plate."""

    reflectance: Any
    transmittance: Any
    reflectance_below: Any


def internal_transmittance(normal_extinction, thickness_mm, wavelength):
    """Beer's law for one passage: exp(−4π Im q d/λ), the plate's thickness in mm, λ in nm."""
    return jnp.exp(-4e6 * jnp.pi * normal_extinction * thickness_mm / wavelength)


def plate_reflectance(front: Face, back_reflectance, internal):
    """R = R_f + T_f² R_b τ²/(1 − R_f′ R_b τ²): the bounces between the faces, summed.

    The transmittance of the front face is taken to be the same both ways, which is exact for a
    transparent plate; for one that absorbs, the relative error is (k/n)², at most 1e-5 for plates
    over 10 µm through which anything passes.
    """
    return multiple_reflections(
        front.reflectance, front.transmittance**2, front.reflectance_below, back_reflectance, internal
    )


def multiple_reflections(reflected, passed_twice, below, back, internal):
    """reflected + passed_twice·back·τ²/(1 − below·back·τ²), the orders of light in a plate summed.

    For powers, and for the products conj(x_p) x_s of two polarisations' amplitudes: both add from order to
    order, as what one order has to do with another is washed out.
    """
    seen = back * internal**2
    return reflected + passed_twice * seen / (1 - below * seen)


def plate_transmittance(front: Face, back_reflectance, back_transmittance, internal):
    """T = T_f T_b τ/(1 − R_f′ R_b τ²)."""
    seen = back_reflectance * internal**2
    return front.transmittance * back_transmittance * internal / (1 - front.reflectance_below * seen)
