"""Power absorbed in each layer and plate of a scene, and the field within its coherent groups.

Each group is lit from above with a power F and, by light that a plate returns, from below with a power B;
their intensities add. Between the faces of a plate light is absorbed on its way down and up. In a plate that
absorbs, the incident wave and its reflection at a face also exchange power, of the order of k/n: it counts as
absorbed in the plate, as in Byrnes, arXiv:1603.02720, section 5. So does the difference, (k/n)², that
`plate.plate_reflectance` makes by taking the front face's transmittance to be the same both ways. With the R
and T of the forward model all absorptances then add up to 1.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax.numpy as jnp

from pellicle.forward_model.coherent_groups import CoherentGroup, reflected, response_of, transmitted
from pellicle.forward_model.plan import Plan
from pellicle.optics import interface, plate, response
from pellicle.optics.absorption import absorptances
from pellicle.optics.field import fields
from pellicle.optics.pair import Number, abs2, imag, real
from pellicle.scene.film import Plate


class AbsorbedPower(NamedTuple):
    """Shares of the incident power for one polarisation, at each wavelength."""

    R: Any
    T: Any
    layers: list[Any]  # (layers, ...) of each coherent group
    plates: list[Any]
    down: list[Any]  # power that arrives at each group from above
    up: list[Any]  # and from below, 0 for the last group


def absorbed_power(
    plan: Plan, groups: list[CoherentGroup], plates: tuple[Plate, ...], wavelength: Any, polarisation: str
) -> AbsorbedPower:
    """Return R, T, and what every layer and plate absorbs. `plates` are those between the groups."""
    responses = [response_of(plan, group, polarisation) for group in groups]
    arriving, layers, inner, down, up = jnp.ones_like(wavelength), [], [], [], []
    for i, group in enumerate(groups):
        down.append(arriving)
        absorbed = arriving * _layers(group, polarisation)
        if i == len(plates):
            up.append(jnp.zeros_like(arriving))
            layers.append(absorbed)
            break
        below, passed = reflected(plan, groups[i + 1 :], polarisation), group.internal
        returning = response.reflectance_below(responses[i])
        first = arriving * response.transmittance(responses[i]) / (1 - returning * below * passed**2)
        arriving = first * passed
        back = arriving * below * passed
        up.append(back)
        layers.append(absorbed + back * _layers(upside_down(groups, i), polarisation))
        _, q = interface.transverse(group.below, _inside(groups))
        lost = plate.internal_absorptance(imag(q), plates[i].plate_mm, wavelength)
        faces = back * _upward_difference(groups, i, responses[i], q, polarisation)
        faces += arriving * _exchange(group.below, q, _ratio(responses[i + 1]), polarisation)
        inner.append((first + arriving * below) * lost + faces)
    R, T = reflected(plan, groups, polarisation), transmitted(plan, groups, polarisation)
    return AbsorbedPower(R, T, layers, inner, down, up)


def energy(
    groups: list[CoherentGroup],
    position: int,
    wavelength: Any,
    thicknesses: list[Any],
    depth: Any,
    powers: AbsorbedPower,
    polarisation: str,
) -> tuple[Any, Any]:
    """Return |E|² at a depth of a group for a unit of incident power, and Im ε there.

    **Arguments:** `thicknesses` of the group's layers in nm, each with the shape of `wavelength`; `depth` in
    nm from its uppermost interface, on none of the interfaces.
    """
    k0 = 2 * jnp.pi / wavelength

    def lit(group: CoherentGroup, depths: list[Any], at: Any) -> Any:
        angle = interface.Inside(0.0) if group.angle is None else group.angle
        return fields(group.above, group.layers, group.below, k0, depths, at, angle, polarisation)[0]

    from_above = lit(groups[position], thicknesses, depth)
    found = powers.down[position] * from_above.energy()
    if position < len(groups) - 1:
        total = sum(thicknesses, 0.0 * wavelength)
        from_below = lit(upside_down(groups, position), thicknesses[::-1], total - depth)
        found += powers.up[position] * from_below.energy()
    return found, from_above.loss


def upside_down(groups: list[CoherentGroup], position: int) -> CoherentGroup:
    """Return a group as light from the plate below it meets it."""
    group = groups[position]
    return group._replace(
        above=group.below,
        layers=group.layers[::-1],
        below=group.above,
        phases=group.phases[::-1],
        angle=_inside(groups),
    )


def _inside(groups: list[CoherentGroup]) -> Any:
    """The transverse index in place of an angle, for light from within a plate."""
    angle = groups[0].angle
    return None if angle is None else interface.Inside(interface.transverse(groups[0].above, angle)[0])


def _layers(group: CoherentGroup, polarisation: str) -> Any:
    film = (group.above, group.layers, group.below, group.phases, group.angle)
    return absorptances(*film, polarisation)[0]


def _ratio(found: response.Response, from_below: bool = False) -> Number:
    return (found.below if from_below else found.reflected) / found.denominator


def _exchange(index: Number, q: Number, r: Number, polarisation: str) -> Any:
    """Return 1 − |r|² − (the power through the face) for light from a medium: −2 Im r Im Y/Re Y."""
    admittance = q if polarisation == "s" else q / (index * index)
    flux = real(admittance)
    none = flux == 0
    return jnp.where(none, 0.0, -2 * imag(r) * imag(admittance) / jnp.where(none, 1.0, flux))


def _upward_difference(
    groups: list[CoherentGroup], position: int, found: response.Response, q: Number, polarisation: str
) -> Any:
    """Power that light from a plate loses at the face above it, besides R, A and T of light from above."""
    group = groups[position]
    exchanged = _exchange(group.below, q, _ratio(found, from_below=True), polarisation)
    _, q_above = interface.transverse(group.above, group.angle)
    here, above = _sine_square(group.below, q, polarisation), _sine_square(group.above, q_above, polarisation)
    evanescent = here == 1
    ratio = (here - above) / jnp.where(evanescent, 1.0, 1 - here)
    return exchanged + jnp.where(evanescent, 0.0, response.transmittance(found) * ratio)


def _sine_square(index: Number, q: Number, polarisation: str) -> Any:
    """(Im Y/|Y|)² of a medium's admittance Y."""
    admittance = q if polarisation == "s" else q / (index * index)
    return imag(admittance) ** 2 / abs2(admittance)
