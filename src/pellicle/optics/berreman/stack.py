"""Reflection and transmission of layers of any orientation: the 4×4 method, free of overflow.

From the substrate upwards, each layer turns the reflection matrix Γ of what lies below it into that
of the layer with it. Γ is that of waves against free space at normal incidence, E = d + u and H = d − u in
the tangential fields: for passive media no element exceeds 1, whatever the layers are. The ambient enters
last, by the fields above the uppermost layer: their Γ is not needed.

Source: D. W. Berreman, J. Opt. Soc. Am. 62, 502 (1972); L. Li, J. Opt. Soc. Am. A 13, 1024 (1996), for
recursions that stay bounded.

For light from both sides, as on a plate, each layer has a scattering matrix of waves against free space at
normal incidence, E = d + u and H = d − u in the tangential fields; those of all layers and of both outer
faces are joined by Redheffer's star product.
"""

from collections.abc import Sequence
from functools import partial, reduce
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from pellicle.optics.anisotropy import Index, Medium, Principal, Tensor, Uniaxial, mixes_polarisations, tensor
from pellicle.optics.berreman import biaxial, uniaxial
from pellicle.optics.berreman.biaxial import delta, downward_pair, half_space
from pellicle.optics.berreman.matrices import (
    Elements,
    Fields,
    Propagation,
    elements,
    elements_and_exponents,
    exp,
    full,
    inverse,
    matrix,
    one_minus,
    one_plus,
    product,
    stacked,
    unstacked,
)
from pellicle.optics.berreman.slices import (
    Scattering,
    doubled,
    join,
    scattering,
    slice_count,
    sliced,
    transfer,
)
from pellicle.optics.characteristic import nonzero_root
from pellicle.optics.hoisting import stored
from pellicle.optics.interface import Inside, normal_square, transverse
from pellicle.optics.pair import (
    Number,
    cond,
    conj,
    namespace,
    real,
    stop_gradient,
    times_i,
    to_complex,
    to_pair,
)


class Polarised(NamedTuple):
    """Reflection and transmission of layers that mix s and p. Rows are outgoing, columns incident."""

    reflected: Elements  # Jones matrix
    # (Ex, Ey) and (Hy, −Hx) at the substrate for unit electric field incident
    fields: tuple[Elements, Elements]
    incident: Any  # power flux of a unit electric field, n₀ cos θ


def polarised(
    ambient: Any,
    layers: Sequence[Medium],
    substrate: Medium,
    phases: Sequence[Any],
    angle: Any,
    dichroic: bool = True,
) -> Polarised:
    """Return the response of a stack of isotropic and anisotropic layers.

    **Arguments:** all arrays broadcast.

    - `ambient`: real refractive index.
    - `layers`: from the ambient down, each a number, `Principal`, `Uniaxial` or `Tensor`; `substrate` too.
    - `phases`: k₀d = 2πd/λ of each layer.
    - `angle` of incidence in radians, or `Inside` a plate, whose index as `ambient` may absorb.
    - `dichroic`: False promises that the attenuations of the two waves in a layer, as exponents of
      amplitudes, differ by less than `slices.DIRECT`.
    """
    a, q0 = transverse(ambient, angle if isinstance(angle, Inside) else namespace(angle).asarray(angle) * 1.0)
    a, q0, layers, substrate, phases = stored((a, q0, layers, substrate, phases))
    every = q0, layers, substrate, phases
    bottom = stored(_substrate(substrate, a, every))
    fields = _of_reflection(bottom, None)
    for medium, k in zip(reversed(layers), reversed(phases), strict=True):
        fields = _add(medium, a, k, _normalised(fields), dichroic)
    # p of the incident wave: Ex = p cos θ, Hy = n₀ p; of the reflected one: Ex = −r cos θ, Hy = n₀ r
    E, H, down, _ = fields
    cosine = q0 / ambient
    tilt = cosine / ambient

    def rows(p: Any, s: Any) -> Any:
        return jax.tree.map(lambda x: x[:, None], stacked(p, s, like=every))

    into = stored(inverse(stored(rows(1.0, q0) * E + rows(tilt, 1.0) * H)))
    r = product(rows(-1.0, q0) * E + rows(tilt, -1.0) * H, into)
    units = matrix(1.0, ambient, 1 / ambient, 1.0, like=every)
    waves = into * stacked(2 * cosine, 2 * q0, like=every)
    waves = stored(_behind(down, waves))
    below = product(one_plus(bottom), waves), product(one_minus(bottom), waves)
    return Polarised(elements(stored(r * units)), (elements(below[0]), elements(below[1])), q0)


def transmittances(response: Polarised) -> tuple[Any, Any]:
    """Return the power that enters the substrate for p and for s incident, as fractions."""
    E, H = response.fields
    p = real(E.pp * conj(H.pp)) + real(E.sp * conj(H.sp))
    s = real(E.ps * conj(H.ps)) + real(E.ss * conj(H.ss))
    return p / response.incident, s / response.incident


def most_dichroic(ambient: Any, layers: Sequence[Medium], phases: Sequence[Any], angle: Any) -> Any:
    """Return the largest difference of the attenuations of the two waves in any of the layers.

    As exponents of amplitudes. Above `slices.DIRECT` the layer is cut into slices.
    """
    a, _ = transverse(ambient, namespace(angle).asarray(angle) * 1.0)
    exponents = [
        jnp.max(_method(medium).dichroism(medium, a) * k)
        for medium, k in zip(layers, phases, strict=True)
        if mixes_polarisations(medium)
    ]
    return jnp.max(jnp.stack(exponents)) if exponents else jnp.zeros(())


def _method(medium: Medium) -> Any:
    """Return the module that computes layers of this medium, in which s and p mix."""
    return uniaxial if isinstance(medium, Uniaxial) else biaxial


def _substrate(medium: Medium, a: Any, like: Any) -> Number:
    """Return the reflection matrix of a substrate against free space at normal incidence."""
    if isinstance(medium, Uniaxial):
        one, other = uniaxial.downward_roots(medium, a)
        return half_space(delta(tensor(medium), a), one + other, one * other, like)
    if isinstance(medium, Tensor):
        total, both = downward_pair(medium, a)
        return half_space(delta(medium, a), to_pair(total), to_pair(both), like)
    Q_p, Q_s, epsilon = _squares(medium, a)
    p, s = nonzero_root(full(Q_p)), nonzero_root(full(Q_s))
    zero = 0.0 * p
    return matrix((p - epsilon) / (p + epsilon), zero, zero, (1 - s) / (1 + s), like=like)


def _squares(medium: Index, a: Any) -> tuple[Number, Number, Number]:
    """Return q² of p and of s, and ε along x, of a medium with its axes along those of the laboratory."""
    x, y, z = medium if isinstance(medium, Principal) else (medium, medium, medium)
    ratio = x * x / (z * z) if isinstance(medium, Principal) else 1.0
    return normal_square(z, a) * ratio, normal_square(y, a), x * x


def _propagation(medium: Index, a: Any, k: Any) -> Propagation:
    """Return the propagation through a layer in which s and p each have a 2×2 matrix, of k = k₀d."""
    Q_p, Q_s, epsilon = _squares(medium, a)
    squares = (Q_p, Q_s) if isinstance(medium, Principal) else (Q_p,)
    waves = list(elements_and_exponents(squares, k))
    growths = [-real(exponent) for *_, exponent in waves]
    growth = stop_gradient(reduce(namespace(growths).maximum, growths))
    factors = [exp(-exponent - growth) for *_, exponent in waves]
    scaled = [(c * factor, times_i(-f) * factor) for (c, f, _), factor in zip(waves, factors, strict=True)]
    (c, f), (c_s, f_s) = scaled[0], scaled[-1]
    down_p, up_p, down_s = f * (Q_p / epsilon), f * epsilon, f_s * Q_s

    def apply(fields: Fields) -> Fields:
        Ex, Hy, Ey, Hx = fields
        return c * Ex + down_p * Hy, c * Hy + up_p * Ex, c_s * Ey + f_s * Hx, c_s * Hx + down_s * Ey

    return Propagation(apply, growth)


class _Fields(NamedTuple):
    """Tangential fields above some layers, of two independent waves: (Ex, Ey) and (Hy, −Hx) in columns."""

    E: Number
    H: Number
    down: Any  # downward waves behind the layers: a matrix, a multiple of the unit matrix, or None for that
    reflection: Number | None  # Γ, where the waves are unit waves incident from free space


def _of_reflection(reflection: Number, down: Any) -> _Fields:
    return _Fields(one_plus(reflection), one_minus(reflection), down, reflection)


def _normalised(fields: _Fields) -> _Fields:
    """Return the fields of unit waves incident from free space: Γ = (E − H)(E + H)⁻¹."""
    if fields.reflection is not None:
        return fields
    through = stored(inverse(fields.E + fields.H))
    reflection, down = stored((product(fields.E - fields.H, through), _behind(fields.down, 2 * through)))
    return _of_reflection(reflection, down)


def _behind(down: Any, waves: Number) -> Number:
    if down is None:
        return waves
    return product(down, waves) if jnp.ndim(real(down)) == jnp.ndim(real(waves)) else down * waves


def _add(medium: Medium, a: Any, k: Any, below: _Fields, dichroic: bool) -> _Fields:
    """Return the fields above a layer; those below it are of unit waves."""
    if not isinstance(medium, Uniaxial | Tensor):
        return _direct(_propagation(medium, a, k), below)
    method = _method(medium)
    if not dichroic:
        return _direct(method.propagation(medium, a, k), below)
    assert below.reflection is not None
    exponent = method.dichroism(medium, a) * stop_gradient(k)
    reflection, through = sliced(partial(method.propagation, medium, a), k, exponent, below.reflection)
    return _of_reflection(*stored((reflection, _behind(below.down, through))))


def _direct(layer: Propagation, below: _Fields) -> _Fields:
    (Ex, Ey), (Hy, Hx) = unstacked(below.E, 2), unstacked(below.H, 2)
    Ex, Hy, Ey, Hx = layer.apply(stored((Ex, Hy, Ey, Hx)))
    loss = namespace(layer.growth).exp(-layer.growth)
    down = loss if below.down is None else below.down * loss
    E, H, down = stored((stacked(Ex, Ey), stacked(Hy, Hx), down))
    return _Fields(E, H, down, None)


def two_sided(
    above: Number,
    layers: Sequence[Medium],
    below: Number,
    phases: Sequence[Any],
    angle: Any,
    dichroic: bool = True,
) -> Scattering:
    """Return the Jones matrices of reflection and transmission of layers between two isotropic media.

    **Arguments** as for `pellicle.optics.berreman.stack.polarised`; `above` and `below` are indices
    and may absorb.

    **Returns:** complex arrays (2, 2, ...) for electric fields of p and s, rows outgoing, columns incident:
    from above `reflected` and `down`, from below `below` and `up`. The field of a p wave along x is p cos θ
    where it travels down and −p cos θ where it travels up.
    """
    a, q_above = transverse(
        above, angle if isinstance(angle, Inside) else namespace(angle).asarray(angle) * 1.0
    )
    _, q_below = transverse(below, Inside(a))
    every = a, q_above, q_below, above, below, list(layers), list(phases)
    shape = jnp.broadcast_shapes(*(jnp.shape(x) for x in jax.tree.leaves(every)))
    whole = _upper_face(above, q_above, shape)
    for medium, k in zip(layers, phases, strict=True):
        whole = stored(join(whole, _layer(medium, a, k, shape, dichroic)))
    # from free space into the half space below: an upper face from its other side, where p waves change the
    # sign of Ex
    reflected, down, up, below_ = _upper_face(below, q_below, shape)
    signs = namespace(up).array([-1.0, 1.0], real(up).dtype).reshape(2, 1, *[1] * len(shape))
    face = Scattering(reflected=below_, down=up * signs, up=down * signs, below=reflected)
    return stored(join(whole, face))


def _layer(medium: Medium, a: Any, k: Any, shape: tuple[int, ...], dichroic: bool) -> Scattering:
    method = _method(medium)
    mixes = isinstance(medium, Uniaxial | Tensor)
    xp = namespace(k, a)
    k = xp.broadcast_to(k, shape)
    count = None
    if dichroic and mixes:
        count = slice_count(method.dichroism(medium, a) * stop_gradient(k), shape)
        k = k * xp.exp2(-count)
    direction = xp.array([1.0, -1.0], k.dtype).reshape(2, *[1] * len(shape))
    # waves along the axes of the laboratory are alike in both directions
    propagation = method.propagation(medium, a, k, direction) if mixes else _propagation(medium, a, k)
    loss = xp.broadcast_to(xp.exp(-propagation.growth), (2, *shape))
    waves = transfer(propagation, direction)
    one = scattering(xp.broadcast_to(waves, (4, 4, 2, *shape)), loss)
    if count is None:
        return one
    return cond(xp.any(count > 0), lambda s: doubled(s, count), lambda s: s, stored(one))


def _upper_face(index: Number, q: Number, shape: tuple[int, ...]) -> Scattering:
    """From a half space above into free space: the admittance is ε/q for p and q for s."""
    index, q = to_complex(index), to_complex(q)
    epsilon = index * index
    p, s = 1 / (q + epsilon), 1 / (q + 1)
    r_p, r_s = (q - epsilon) * p, (q - 1) * s
    return Scattering(
        reflected=_diagonal(r_p, r_s, shape),
        down=_diagonal(2 * index * q * p, 2 * q * s, shape),
        up=_diagonal(-2 * index * p, 2 * s, shape),
        below=_diagonal(r_p, -r_s, shape),
    )


def _diagonal(p: Any, s: Any, shape: tuple[int, ...]) -> Any:
    xp = namespace(p, s)
    p, s = xp.broadcast_to(p, shape), xp.broadcast_to(s, shape)
    zero = xp.zeros_like(p)
    return xp.stack([p, zero, zero, s]).reshape(2, 2, *shape)
