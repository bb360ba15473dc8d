"""Response of any number of coherent layers: the closed form of a film, or characteristic matrices.

The fields (E, H) at a layer's lower face give those at its upper face by the elements of
`characteristic.matrix_elements`, times their scale. `few_layers` multiplies these in separate real arrays
(`pellicle.optics.pair`), without a loop and without rescaling: the elements are at most 1 and k₀d, so that
products of a few cannot overflow, and an opaque layer halves the fields.

`stack` divides the fields by their norm after each layer, so that 50 layers with an opaque one among them
stay finite without clamping. Complex arithmetic: separate real arrays bring nothing here. One `lax.scan` runs
over the layers; unrolled, 50 of them do not compile in minutes. A graded layer is a row of slices in that
loop (`pellicle.optics.gradient`). The matrix of a group of layers that repeat is raised to a power
by squaring.

Source: Born and Wolf, Principles of Optics, section 1.6 (characteristic matrices).
"""

from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from pellicle.optics.anisotropy import Index, Principal, mixes_polarisations, seen_by, tangential_permittivity
from pellicle.optics.characteristic import matrix_elements, propagating_elements
from pellicle.optics.film import film
from pellicle.optics.gradient import Gradient, coefficients, faces, is_graded
from pellicle.optics.hoisting import stored_by_cpu
from pellicle.optics.interface import (
    equal_media,
    incident_factor,
    normal,
    normal_flux,
    normal_square,
    transverse,
    zero_where,
)
from pellicle.optics.layer_rows import LayerRows, StackedLayers, full, layer_rows, repeated
from pellicle.optics.pair import (
    Number,
    abs2,
    inverse_root,
    is_real,
    namespace,
    scan,
    stop_gradient,
    times_i,
)
from pellicle.optics.repeats import Repeats, matrix_power
from pellicle.optics.response import Amplitudes, Response


def stack(
    ambient: Index,
    layers: Sequence[Index | Gradient],
    substrate: Index,
    phases: Sequence[Any] | np.ndarray | jax.Array,
    angle: Any = None,
    polarisations: str = "sp",
    roughness: Sequence[Any] | None = None,
    repeats: Repeats | None = None,
) -> tuple[Response, ...]:
    """Return the response of a stack, for each letter of `polarisations`.

    **Arguments:** as for `coherent.responses`. Every array broadcasts against every other.
    """
    a, q0 = transverse(ambient, angle)
    rows = layer_rows((ambient, substrate, a), layers, phases, roughness)
    if repeats is not None and repeats.count > 1:
        rows = repeated(rows, repeats, layers)
    shape, dtype = rows.depth.shape[1:], jnp.promote_types(rows.depth.dtype, jnp.complex64)

    bottom, top, q_top = (full(number, shape, dtype) for number in (substrate, ambient, q0))
    q_bottom: Any = stored_by_cpu(normal(bottom, a))
    xp = namespace(rows, top, bottom, q_top)
    empty = equal_media(top, bottom) & xp.all(equal_media(top, *rows.points), axis=0)
    points = jax.tree.map(lambda x: x[::-1], rows.points[::-1])
    upside_down = LayerRows(points, rows.depth[::-1], None, rows.runs[::-1])
    letters = polarisations[:1] if angle is None else polarisations
    e0, e2 = _weight(top, letters), _weight(bottom, letters)
    down_faces = up_faces = None
    if rows.rough is not None:
        both: Any = faces(rows.points) if len(rows.points) > 1 else rows.points * 2
        upper, lower = both
        faces_above: list[Any] = [q_top[None], normal(lower, a)]
        faces_below: list[Any] = [normal(upper, a), q_bottom[None]]
        q, q_ = stored_by_cpu((xp.concatenate(faces_above), xp.concatenate(faces_below)))
        weight = xp.concatenate([e0[:, None], _weight(lower, letters)], axis=1)
        weight_ = xp.concatenate([_weight(upper, letters), e2[:, None]], axis=1)
        down_faces = _rough_faces(q, weight, q_, weight_, rows.rough)[:, :, ::-1]
        up_faces = _rough_faces(q_, weight_, q, weight, rows.rough)
    # all polarisations at once: the elements of an isotropic layer are the same for s and p
    (E, H), scale_square = _scaled_fields(upside_down, q_bottom / e2, down_faces, a, letters)
    (E_, H_), _ = _scaled_fields(rows, q_top / e0, up_faces, a, letters)
    down, up = q_top * E / e0, q_bottom * E_ / e2
    denominator = down + H
    # both directions have the same denominator except for its scale: rescale the second to the first
    reversed_ = (up - H_) / (up + H_) * denominator
    responses = []
    for row, letter in enumerate(letters):
        flux = incident_factor(ambient, q0, letter) * normal_flux(bottom, q_bottom, letter)
        # one by one: what is not used is not computed
        amplitudes = (
            stored_by_cpu(zero_where(empty, (down - H)[row])),
            stored_by_cpu(reversed_[row]),
            stored_by_cpu(denominator[row]),
        )
        squares = Amplitudes(*(abs2(amplitude) for amplitude in amplitudes))
        flux = flux / abs2(e0 * e2)[row]
        responses.append(Response(*amplitudes, squares, flux, scale_square[row]))
    return tuple(responses)


def _weight(index: Any, polarisations: str) -> Any:
    """Return the divisor of q in the boundary condition, (polarisations, ...): 1 for s, ε for p."""
    permittivity: Any = tangential_permittivity(index)
    p = np.array([letter == "p" for letter in polarisations])
    return namespace(permittivity).where(p.reshape(-1, *[1] * permittivity.ndim), permittivity, 1)


def _rough_faces(q: Any, weight: Any, q_below: Any, weight_below: Any, rough: Any) -> Any:
    """Return the factors of the fields (E, H) on their way up through rough faces.

    They have the shape (2, polarisations, faces, ...).

    Névot and Croce 1980 (Rev. Phys. Appl. 15, 761): r exp(−x) with x = 2 k₀²σ² q q′, and
    t exp(k₀²σ² (q − q′)²/2). In terms of fields this is diagonal, with the entire function
    (1 − e^−x)/x, so that a smooth face, or one at a critical angle, is no special case.
    """
    square, xp = rough * rough, namespace(rough, q, q_below, weight, weight_below)
    damping, passed = stored_by_cpu(
        (square * _expm1_ratio(2 * square * q * q_below), xp.exp(-0.5 * square * (q - q_below) ** 2))
    )
    E = 1 + damping * q_below * (q_below * weight / weight_below - q)
    H = 1 + damping * q * (q * weight_below / weight - q_below)
    return stored_by_cpu(xp.stack([E * passed, H * passed]))


def _expm1_ratio(x: Any) -> Any:
    """Return (1 − e^−x)/x, by its Taylor series near 0."""
    xp, near = namespace(x), abs2(x) < 0.01
    small, far = xp.where(near, x, 0), xp.where(near, 1, x)
    taylor = xp.ones_like(x)
    for j in range(12, 1, -1):
        taylor = 1 - small * taylor / j
    return xp.where(near, taylor, (1 - xp.exp(-far)) / far)


def _scaled_fields(rows: LayerRows, admittance: Any, faces: Any, a: Any, polarisations: str) -> Any:
    """Return (E, H) at the far face for a unit wave in the last medium, the first row first, and |scale|²."""
    if rows.runs:
        return _repeated_fields(rows, admittance, a, polarisations)
    xp = namespace(admittance, faces)
    start = (xp.ones_like(admittance), admittance), xp.ones_like(admittance.real)
    inner = None if faces is None else xp.moveaxis(faces[:, :, :-1], 2, 0)
    ((E, H), scale_square), _ = _through(start, rows, inner, a, polarisations)
    return ((E, H) if faces is None else (E * faces[0, :, -1], H * faces[1, :, -1])), scale_square


def _through(start: Any, rows: LayerRows, faces: Any, a: Any, polarisations: str) -> Any:
    """Scan over rows from ((E, H), |scale|²); E and H may have several columns along a further first axis."""
    columns = start[0][0].ndim - start[1].ndim

    def through_layer(carry, layer):
        (E, H), scale_square = carry
        points, k, face = layer
        if face is not None:
            E, H = E * face[0], H * face[1]
        if len(points) == 1:
            square, e = normal_square(points[0], a), _weight(points[0], polarisations)
            c, f, layer_scale, _ = stored_by_cpu(matrix_elements(square, k))
            E, H = E * c - 1j * f * e * H, H * c - 1j * f * (square / e) * E
        else:
            alpha, beta, skew, square = coefficients(
                points, k, a, [_weight(n, polarisations) for n in points]
            )
            c, f, layer_scale, _ = stored_by_cpu(matrix_elements(square, k))
            E, H = E * (c + f * skew) - 1j * (H * (f * alpha)), H * (c - f * skew) - 1j * (E * (f * beta))
        E, H = stored_by_cpu((E, H))
        size = stop_gradient(abs2(E) + abs2(H))
        size = size.sum(axis=0) if columns else size
        shrink = inverse_root(size)
        return ((E * shrink, H * shrink), scale_square * layer_scale / size), None

    return scan(through_layer, start, (rows.points, rows.depth, faces))


def _repeated_fields(rows: LayerRows, admittance: Any, a: Any, polarisations: str) -> Any:
    """`_scaled_fields` of smooth rows, some of which are repeated: the matrix of a run to the power of its
    repeats, by squaring, divided by its norm at each step."""
    xp = namespace(admittance, rows)
    one, zero = xp.ones_like(admittance), xp.zeros_like(admittance)
    (E, H), scale_square = (one, admittance), xp.ones_like(admittance.real)
    first = 0
    for count, length in rows.runs:
        points, depth = jax.tree.map(lambda x: x[first : first + length], (rows.points, rows.depth))  # noqa: B023
        own, first = LayerRows(points, depth, None), first + length
        if count == 1:
            ((E, H), scale_square), _ = _through(((E, H), scale_square), own, None, a, polarisations)
            continue
        identity = (xp.stack([one, zero]), xp.stack([zero, one])), xp.ones_like(scale_square)
        period = _through(identity, own, None, a, polarisations)[0]
        ((e, h), (e_, h_)), scale = matrix_power(identity, period, count)
        E, H = e * E + h * H, e_ * E + h_ * H
        size = stop_gradient(abs2(E) + abs2(H))
        E, H, scale_square = (*(x * inverse_root(size) for x in (E, H)), scale_square * scale / size)
    return (E, H), scale_square


FEW = 3
"""Layers up to which the product is multiplied out; a scan over so few takes several times as long."""


def few_layers(
    ambient: Index,
    layers: Sequence[Index],
    substrate: Index,
    phases: Sequence[Any] | np.ndarray | jax.Array,
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
    ambient: Index,
    layers: Sequence[Index | Gradient],
    substrate: Index,
    phases: Sequence[Any] | np.ndarray | jax.Array,
    angle: Any = None,
    polarisations: str = "sp",
    *,
    propagating: bool = False,
    roughness: Sequence[Any] | None = None,
    repeats: Repeats | None = None,
    few: int = FEW,
) -> tuple[Response, ...]:
    """Return the response of coherent layers between two half spaces, for each polarisation in its order.

    **Arguments:** all arrays broadcast.

    - `ambient`, `substrate`: refractive indices, or `Principal` ones of a medium with its axes along those of
      the laboratory. A real index promises that the wave propagates there (`interface.allow_tunnelling` takes
      that back). The ambient is real, except for light from within a plate.
    - `layers`: refractive indices from the ambient down, or `Principal` ones. In a real one the wave may be
      evanescent. A graded layer is a `pellicle.optics.gradient.Gradient`.
    - `phases`: k₀d = 2πd/λ of each layer; an array (layers, ...) beside `StackedLayers`.
    - `angle`: of incidence in radians, or `interface.Inside` for light from within a plate. None is
      normal incidence, where s and p are equal and, without a `Principal` medium, only the first is computed.
    - `polarisations`: "s", "p" or "sp".
    - `propagating`: promises that no wave is totally reflected in a real layer: a cheaper film.
    - `roughness`: k₀σ of each interface from the top down, one more than there are layers.
    - `repeats`: groups of layers that are repeated, each of which is in `layers` once. The face above such a
      layer is as rough in all repeats.
    - `few`: layers up to which the product is multiplied out.

    ```python
    >>> from pellicle.optics.response import reflectance
    >>> round(float(reflectance(*responses(1.0, [1.38], 1.52, [1.138]))), 4)
    0.0126

    ```
    """
    if isinstance(layers, StackedLayers):
        return stack(ambient, layers, substrate, phases, angle, polarisations, roughness, repeats)
    if mixes_polarisations(ambient, *layers, substrate):
        raise ValueError("s and p mix where an optic axis is tilted: take pl.jones or pl.mueller, or a scene")
    apart = any(isinstance(n, Principal) for n in (ambient, *layers, substrate))
    results: list[Response] = []
    for letters in polarisations if apart else [polarisations]:
        above, *between, below = (seen_by(n, letters) for n in (ambient, *layers, substrate))
        several = repeats is not None and repeats.count > 1
        if several or roughness is not None or is_graded(layers) or len(layers) > few:
            results += stack(above, between, below, phases, angle, letters, roughness, repeats)
        elif len(layers) == 1:
            results += film(above, between[0], below, phases[0], angle, letters, propagating)
        else:
            results += few_layers(above, between, below, phases, angle, letters, propagating)
    return tuple(results)
