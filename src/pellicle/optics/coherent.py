"""Response of any number of coherent layers: the closed form of a film, or characteristic matrices.

`few_layers` is the same as `pellicle.optics.stack` in separate real arrays (`pellicle.optics.pair`), without
a loop and without rescaling: the elements of `characteristic.matrix_elements` are at most 1 and k₀d, so that
products of a few cannot overflow, and an opaque layer halves the fields.

Source: Born and Wolf, Principles of Optics, section 1.6 (characteristic matrices).
"""

from collections.abc import Sequence
from typing import Any

from pellicle.optics.anisotropy import Principal, mixes_polarisations, seen_by, tangential_permittivity
from pellicle.optics.characteristic import matrix_elements, propagating_elements
from pellicle.optics.film import film
from pellicle.optics.gradient import is_graded
from pellicle.optics.interface import (
    equal_media,
    incident_factor,
    normal,
    normal_flux,
    normal_square,
    transverse,
    zero_where,
)
from pellicle.optics.pair import Number, abs2, is_real, times_i
from pellicle.optics.response import Amplitudes, Response
from pellicle.optics.stack import stack

FEW = 3
"""Layers up to which the product is multiplied out; a scan over so few takes several times as long."""


def few_layers(
    ambient: Any,
    layers: Sequence[Number],
    substrate: Number,
    phases: Sequence[Any],
    angle: Any = None,
    polarisations: str = "sp",
    propagating: bool = False,
) -> tuple[Response, ...]:
    """Return the response of up to `FEW` layers, for each letter of `polarisations`.

    **Arguments:** as for `coherent.responses`.
    """
    a, q0 = transverse(ambient, angle)
    q2, squares = normal(substrate, a), [normal_square(n, a) for n in layers]
    elements = [
        (propagating_elements if propagating and is_real(Q) else matrix_elements)(Q, k)
        for Q, k in zip(squares, phases, strict=True)
    ]
    scale_square = 1.0
    for element in elements:
        scale_square = scale_square * element.scale_square
    empty = equal_media(ambient, substrate, *layers)
    responses = []
    for polarisation in polarisations[:1] if angle is None else polarisations:
        s = polarisation == "s"
        e0, e2 = (1.0, 1.0) if s else (tangential_permittivity(ambient), tangential_permittivity(substrate))
        # −if times ε and Q/ε: the elements off the diagonal
        matrices = []
        for n, Q, element in zip(layers, squares, elements, strict=True):
            g = times_i(-element.f)
            e = 1.0 if s else tangential_permittivity(n)
            matrices.append((element.c, g, g * Q) if s else (element.c, g * e, g * (Q / e)))
        E, H = _fields(q2 / e2, matrices[::-1])
        E_, H_ = _fields(q0 / e0, matrices)
        down, up = (q0 / e0) * E, (q2 / e2) * E_
        flux = incident_factor(ambient, q0, polarisation) * normal_flux(substrate, q2, polarisation)
        amplitudes = (zero_where(empty, down - H), up - H_, down + H)
        power = Amplitudes(*(abs2(amplitude) for amplitude in amplitudes))
        responses.append(Response(*amplitudes, power, flux / abs2(e0 * e2), scale_square))
    return tuple(responses)


def _fields(admittance: Number, matrices: Sequence[tuple[Number, Number, Number]]) -> tuple[Number, Number]:
    """Return (E, H) at the far face for a unit wave in the last medium."""
    E, H = 1.0, admittance
    for c, across, back in matrices:
        E, H = c * E + across * H, c * H + back * E
    return E, H


def responses(
    ambient: Number,
    layers: Sequence[Number],
    substrate: Number,
    phases: Sequence[Any],
    angle: Any = None,
    polarisations: str = "sp",
    *,
    propagating: bool = False,
    roughness: Sequence[Any] | None = None,
) -> tuple[Response, ...]:
    """Return the response of coherent layers between two half spaces, for each polarisation.

    One smooth layer takes the closed form of `pellicle.optics.film`; none, two or three of them take their
    product of matrices in `pellicle.optics.coherent`; more, or rough interfaces, take the loop of
    `pellicle.optics.stack`.

    **Arguments:** all arrays broadcast.

    - `ambient`, `substrate`: refractive indices, or `Principal` ones of a medium with its axes along those of
      the laboratory. A real index promises that the wave propagates there;
      `interface.allow_tunnelling` turns it into one that may be totally reflected. The ambient is real,
      except for light from within a plate.
    - `layers`: refractive indices from the ambient down, or `Principal` ones. In a real one the wave may be
      evanescent. A graded layer is a `pellicle.optics.gradient.Gradient`.
    - `phases`: k₀d = 2πd/λ of each layer.
    - `angle`: of incidence in radians, or `interface.Inside` for light from within a plate. None is
      normal incidence, where s and p are equal and only the first polarisation is computed.
    - `polarisations`: "s", "p" or "sp".
    - `propagating`: promises that no wave is totally reflected in a real layer: a cheaper film.
    - `roughness`: k₀σ of each interface from the top down, one more than there are layers.

    **Returns:** one `Response` for each polarisation, in their order. With a `Principal` medium s and p
    differ at normal incidence too, and each of `polarisations` has its own.

    ```python
    >>> from pellicle.optics.response import reflectance
    >>> round(float(reflectance(*responses(1.0, [1.38], 1.52, [1.138]))), 4)
    0.0126

    ```
    """
    if mixes_polarisations(ambient, *layers, substrate):
        raise ValueError("s and p mix where an optic axis is tilted: take pl.jones or pl.mueller, or a scene")

    def of(ambient: Number, layers: Sequence[Any], substrate: Number, letters: str) -> tuple[Response, ...]:
        if roughness is not None or is_graded(layers) or len(layers) > FEW:
            return stack(ambient, layers, substrate, phases, angle, letters, roughness)
        if len(layers) == 1:
            return film(ambient, layers[0], substrate, phases[0], angle, letters, propagating)
        return few_layers(ambient, layers, substrate, phases, angle, letters, propagating)

    if not any(isinstance(n, Principal) for n in (ambient, *layers, substrate)):
        return of(ambient, layers, substrate, polarisations)
    each = []
    for letter in polarisations:
        above, *between, below = (seen_by(n, letter) for n in (ambient, *layers, substrate))
        each += of(above, between, below, letter)
    return tuple(each)
