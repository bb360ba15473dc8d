"""Reflection and transmission of layers of any orientation: the 4×4 method, free of overflow.

From the substrate upwards, each layer turns the reflection matrix Γ of what lies below it into that
of the layer with it. Γ is that of waves against free space at normal incidence, E = d + u and H = d − u in
the tangential fields: for passive media no element exceeds 1, whatever the layers are. The ambient enters
last.

Source: D. W. Berreman, J. Opt. Soc. Am. 62, 502 (1972); L. Li, J. Opt. Soc. Am. A 13, 1024 (1996), for
recursions that stay bounded.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from pellicle.optics.anisotropy import Medium, Tensor, Uniaxial, mixes_polarisations, tensor
from pellicle.optics.berreman import aligned, biaxial, uniaxial
from pellicle.optics.berreman.delta import delta, half_space
from pellicle.optics.berreman.matrices import Matrix, inverse, one_minus, one_plus
from pellicle.optics.berreman.propagation import Propagation, stacked, unstacked
from pellicle.optics.berreman.quartic import downward_pair
from pellicle.optics.berreman.slices import sliced
from pellicle.optics.hoisting import stored
from pellicle.optics.interface import transverse
from pellicle.optics.pair import conj, real, to_pair


class Polarised(NamedTuple):
    """Reflection and transmission of layers that mix s and p. Rows are outgoing, columns incident."""

    reflected: Matrix  # Jones matrix
    fields: tuple[Matrix, Matrix]  # (Ex, Ey) and (Hy, −Hx) at the substrate for unit electric field incident
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
    - `angle` of incidence in radians.
    - `dichroic`: False promises that the attenuations of the two waves in a layer, as exponents of
      amplitudes, differ by less than `slices.DIRECT`.
    """
    a, q0 = transverse(ambient, jnp.asarray(angle) * 1.0)
    reflection = _substrate(substrate, a)
    bottom = reflection
    through: Matrix | None = None
    for medium, k in zip(reversed(layers), reversed(phases), strict=True):
        reflection, layer_through = _add(medium, a, k, reflection, dichroic)
        through = layer_through if through is None else through @ layer_through
    # p of the incident wave: Ex = p cos θ, Hy = n₀ p; of the reflected one: Ex = −r cos θ, Hy = n₀ r
    E, H = one_plus(reflection), one_minus(reflection)
    cosine = q0 / ambient
    tilt = cosine / ambient
    into = inverse(Matrix(E.pp + tilt * H.pp, E.ps + tilt * H.ps, q0 * E.sp + H.sp, q0 * E.ss + H.ss))
    out = Matrix(tilt * H.pp - E.pp, tilt * H.ps - E.ps, q0 * E.sp - H.sp, q0 * E.ss - H.ss)
    into = stored(into)
    r = stored(out @ into)
    waves = Matrix(into.pp * (2 * cosine), into.ps * (2 * q0), into.sp * (2 * cosine), into.ss * (2 * q0))
    waves = waves if through is None else through @ waves
    jones = Matrix(r.pp, r.ps * ambient, r.sp * (1 / ambient), r.ss)
    return Polarised(jones, (one_plus(bottom) @ waves, one_minus(bottom) @ waves), q0)


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
    a, _ = transverse(ambient, jnp.asarray(angle) * 1.0)
    layers_and_phases = zip(layers, phases, strict=True)
    exponents = [_method(m).dichroism(m, a) * k for m, k in layers_and_phases if mixes_polarisations(m)]
    return jnp.max(jnp.stack([jnp.max(x) for x in exponents])) if exponents else jnp.zeros(())


def _method(medium: Medium) -> Any:
    return uniaxial if isinstance(medium, Uniaxial) else biaxial if isinstance(medium, Tensor) else aligned


def _substrate(medium: Medium, a: Any) -> Matrix:
    if isinstance(medium, Uniaxial):
        one, other = uniaxial.downward_roots(medium, a)
        return half_space(delta(tensor(medium), a), one + other, one * other)
    if isinstance(medium, Tensor):
        matrix = delta(medium, a)
        return half_space(matrix, *map(to_pair, downward_pair(medium, a)))
    return aligned.half_space(medium, a)


def _add(medium: Medium, a: Any, k: Any, below: Matrix, dichroic: bool) -> tuple[Matrix, Matrix]:
    """Return the reflection matrix with a layer above, and the downward waves behind it for those before."""
    method = _method(medium)
    if not (dichroic and mixes_polarisations(medium)):
        return _direct(method.propagation(medium, a, k), below)
    exponent = method.dichroism(medium, a) * jax.lax.stop_gradient(k)
    return sliced(partial(method.propagation, medium, a), k, exponent, below)


def _direct(layer: Propagation, below: Matrix) -> tuple[Matrix, Matrix]:
    E, H = one_plus(below), one_minus(below)
    columns = (E.pp, E.ps), (H.pp, H.ps), (E.sp, E.ss), (H.sp, H.ss)
    fields = stored(tuple(stacked(*p_s, like=layer.growth) for p_s in columns))
    Ex, Hy, Ey, Hx = stored(layer.apply(fields))
    down = Matrix(*unstacked(Ex + Hy, 2), *unstacked(Ey + Hx, 2))
    up = Matrix(*unstacked(Ex - Hy, 2), *unstacked(Ey - Hx, 2))
    through = stored(inverse(down))
    loss = 2 * jnp.exp(-layer.growth)
    return stored((up @ through, Matrix(*(x * loss for x in through))))
