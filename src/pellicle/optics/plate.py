"""Thick plates: the two faces add intensities, not amplitudes."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax.numpy as jnp


class Face(NamedTuple):
    """Power coefficients of one face of a plate."""

    reflectance: Any  # from outside
    transmittance: Any
    reflectance_below: Any  # from inside the plate


def internal_transmittance(normal_extinction: Any, thickness_mm: Any, wavelength: Any) -> Any:
    """Return exp(−4π Im q d/λ), the transmittance of one passage (Beer's law).

    **Arguments:** `normal_extinction` Im q of the plate, `thickness_mm` in mm, `wavelength` in nm.

    >>> round(float(internal_transmittance(1e-6, 1.0, 500.0)), 6)
    0.97518
    """
    return jnp.exp(-4e6 * jnp.pi * normal_extinction * thickness_mm / wavelength)


def internal_absorptance(normal_extinction: Any, thickness_mm: Any, wavelength: Any) -> Any:
    """Return what one passage absorbs, 1 − `internal_transmittance`, to full precision where it is small."""
    return -jnp.expm1(-4e6 * jnp.pi * normal_extinction * thickness_mm / wavelength)


def plate_reflectance(front: Face, back_reflectance: Any, internal: Any) -> Any:
    """Return R = R_f + T_f² R_b τ²/(1 − R_f′ R_b τ²), all reflections between the faces added.

    The transmittance of the front face is taken to be the same both ways, which is exact for a
    transparent plate. For one that absorbs, the relative error is (k/n)²: at most 1e-5 for plates
    over 10 µm that transmit at all.

    **Arguments:** `back_reflectance` R_b of the back face and what is beneath it; `internal` τ of one
    passage.
    """
    passed_twice = front.transmittance**2
    return multiple_reflections(
        front.reflectance, passed_twice, front.reflectance_below, back_reflectance, internal
    )


def multiple_reflections(reflected: Any, passed_twice: Any, below: Any, back: Any, internal: Any) -> Any:
    """Return reflected + passed_twice·back·τ²/(1 − below·back·τ²), the sum over all orders in a plate.

    It holds for powers, and for the products conj(x_p) x_s of the amplitudes of two polarisations. Both
    add from order to order, because the interference between orders averages out.
    """
    returned = back * internal**2
    return reflected + passed_twice * returned / (1 - below * returned)


def plate_transmittance(front: Face, back_reflectance: Any, back_transmittance: Any, internal: Any) -> Any:
    """Return T = T_f T_b τ/(1 − R_f′ R_b τ²); arguments as for `plate_reflectance`."""
    returned = back_reflectance * internal**2
    return front.transmittance * back_transmittance * internal / (1 - front.reflectance_below * returned)
