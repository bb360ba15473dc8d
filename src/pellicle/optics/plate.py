"""Thick plates: the two faces add intensities, not amplitudes."""

from dataclasses import dataclass, field
from typing import Any, NamedTuple

import jax
import numpy as np

from pellicle.optics.pair import namespace


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
    return namespace(normal_extinction, thickness_mm, wavelength).exp(
        -4e6 * np.pi * normal_extinction * thickness_mm / wavelength
    )


def internal_absorptance(normal_extinction: Any, thickness_mm: Any, wavelength: Any) -> Any:
    """Return what one passage absorbs, 1 − `internal_transmittance`, to full precision where it is small."""
    return -namespace(normal_extinction, thickness_mm, wavelength).expm1(
        -4e6 * np.pi * normal_extinction * thickness_mm / wavelength
    )


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Collection:
    """Part of the light from the back face of a plate that reaches the detector.

    `share` of it (None is all), after at most `reflections` at the back face (None is any number).
    Light that leaves the plate otherwise, beside the detector, is lost.
    """

    share: Any = None
    reflections: int | None = field(default=None, metadata={"static": True})


def plate_reflectance(
    front: Face, back_reflectance: Any, internal: Any, part: Collection | None = None
) -> Any:
    """Return R = R_f + T_f² R_b τ²/(1 − R_f′ R_b τ²), all reflections between the faces added.

    The transmittance of the front face is taken to be the same both ways, which is exact for a
    transparent plate. For one that absorbs, the relative error is (k/n)²: at most 1e-5 for plates
    over 10 µm that transmit at all.

    **Arguments:** `back_reflectance` R_b of the back face and what is beneath it; `internal` τ of one
    passage; `part` of the light from the back face that is collected, None for all.
    """
    passed_twice = front.transmittance**2
    return multiple_reflections(
        front.reflectance, passed_twice, front.reflectance_below, back_reflectance, internal, part
    )


def multiple_reflections(
    reflected: Any, passed_twice: Any, below: Any, back: Any, internal: Any, part: Collection | None = None
) -> Any:
    """Return reflected + passed_twice·back·τ²/(1 − below·back·τ²), the sum over all orders in a plate.

    It holds for powers, and for the products conj(x_p) x_s of the amplitudes of two polarisations. Both
    add from order to order, because the interference between orders averages out. With a `part` the orders
    are those that are collected, times their share.
    """
    returned = back * internal**2
    part = part or Collection()
    if part.reflections is None:
        orders = passed_twice * returned / (1 - below * returned)
    else:
        orders = passed_twice * returned * geometric_sum(below * returned, part.reflections)
    return reflected + (orders if part.share is None else part.share * orders)


def plate_transmittance(
    front: Face, back_reflectance: Any, back_transmittance: Any, internal: Any, part: Collection | None = None
) -> Any:
    """Return T = T_f T_b τ/(1 − R_f′ R_b τ²); arguments as for `plate_reflectance`.

    Light that passes without a reflection at the back face is collected whatever the `part`.
    """
    returned = back_reflectance * internal**2
    if part is None:
        return front.transmittance * back_transmittance * internal / (1 - front.reflectance_below * returned)
    round_trip = front.reflectance_below * returned
    if part.reflections is None:
        further = round_trip / (1 - round_trip)
    else:
        further = round_trip * geometric_sum(round_trip, part.reflections)
    further = further if part.share is None else part.share * further
    return front.transmittance * back_transmittance * internal * (1 + further)


def geometric_sum(ratio: Any, count: int) -> Any:
    """Return 1 + x + … + x^(count − 1), by Horner's rule: exact at x = 1 too.

    >>> float(geometric_sum(0.5, 3))
    1.75
    """
    total = namespace(ratio).ones_like(ratio)
    for _ in range(count - 1):
        total = 1 + ratio * total
    return total
