"""Absorptance of each layer and field in depth, as functions of numbers.

As in `pellicle.simulation.functions`, every argument broadcasts and may be traced, and the precision follows
the input.
"""

from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Complex, Float

from pellicle.errors import UsageError
from pellicle.optics.field import absorptances, fields
from pellicle.optics.interface import transverse
from pellicle.optics.pair import to_complex
from pellicle.simulation.arguments import Medium, film_arguments, floating


class Field(NamedTuple):
    """Field at a depth, relative to the incident wave.

    x lies in the plane of incidence, along the layers; z points from the ambient into the substrate. The
    components are those for incident waves of |E| = 1: E_y, H_x and H_z of the s-polarised one, E_x, E_z and
    H_y of the p-polarised one, 0 where that polarisation was not asked for. H is in the unit in which a plane
    wave has |H| = |n E|; the phase of the incident E is 0 at the first interface, with exp(−iωt).
    """

    intensity: Float[Array, "..."]
    """|E|² over that of the incident wave; of unpolarised light the mean of s and p."""
    absorbed: Float[Array, "..."]
    """Power absorbed per nm of depth, a share of the incident power: 2π/λ Im ε |E|²/(n₀ cos θ₀)."""
    electric: Complex[Array, "3 ..."]
    magnetic: Complex[Array, "3 ..."]


def absorptance(
    wavelength: Any,
    thickness: Any,
    layer: Medium,
    substrate: Medium,
    *,
    ambient: Medium = 1.0,
    angle: Any = 0.0,
    polarisation: str = "unpolarised",
) -> Float[Array, "layers ..."]:
    """Fraction of the incident power that is absorbed in each coherent layer.

    **Arguments** and **Raises** as `pellicle.reflectance`.

    **Returns:** fractions, (layers, ...): the first axis has the layers from the ambient down, also where
    there is one; the others are what the arguments broadcast to. R + T + their sum is 1.

    T, `pellicle.transmittance`, is the power that enters the substrate: where the substrate absorbs, that is
    what is absorbed in it. A layer whose index is real absorbs exactly 0; where k is small, the absorptance
    is proportional to k and has all digits.

    **Source:** Byrnes, arXiv:1603.02720, section 4; Pettersson, Roman and Inganäs, J. Appl. Phys. 86, 487
    (1999). The integrals over each layer are in closed form (`pellicle.optics.field`).

    ```python
    >>> pl.absorptance(550.0, [100.0, 30.0], [1.46, 0.4 + 2.5j], 1.52).round(4).tolist()
    [0.0, 0.2272]

    ```
    """
    absorbed = _absorptances(wavelength, thickness, layer, substrate, ambient, angle, polarisation)
    return absorbed[0] if len(absorbed) == 1 else 0.5 * (absorbed[0] + absorbed[1])


def _absorptances(*arguments: Any) -> tuple[Any, ...]:
    film = film_arguments(*arguments)
    return _compiled_absorptances(*film.media, film.phases, film.angle, polarisations=film.polarisations)


_compiled_absorptances = jax.jit(absorptances, static_argnames="polarisations")


def field(
    wavelength: Any,
    thickness: Any,
    layer: Medium,
    substrate: Medium,
    depth: Any,
    *,
    ambient: Medium = 1.0,
    angle: Any = 0.0,
    polarisation: str = "unpolarised",
) -> Field:
    """Electric and magnetic field, and absorbed power per depth, at any depth of a film.

    **Arguments** and **Raises** as `pellicle.reflectance`, and `depth` in nm from the uppermost interface
    downwards, any shape: negative in the ambient, beyond the last layer in the substrate. At an interface,
    where E_z jumps, the field is that just below it.

    **Returns:** `Field`, in the shape that the arguments broadcast to: `intensity` |E|² relative to the
    incident wave, `absorbed` power per nm, whose integral over a layer is its `pellicle.absorptance`, and the
    complex components `electric` and `magnetic` with a first axis x, y, z.

    In a real index nothing is absorbed; in an absorbing substrate `absorbed` integrates to T.

    **Source:** Byrnes, arXiv:1603.02720, section 4; Pettersson, Roman and Inganäs, J. Appl. Phys. 86, 487
    (1999).

    ```python
    >>> field = pl.field(550.0, 30.0, 0.4 + 2.5j, 1.52, [0.0, 15.0, 30.0])
    >>> field.intensity.round(3).tolist()
    [0.459, 0.248, 0.195]

    ```
    """
    return _field(wavelength, thickness, layer, substrate, ambient, angle, polarisation, depth)


def _field(*arguments_and_depth: Any) -> Field:
    *arguments, depth = arguments_and_depth
    film = film_arguments(*arguments)
    if isinstance(depth, str):
        raise UsageError(f"`depth` must be a number or an array, not {depth!r}")
    angle = floating(0.0) if film.angle is None else film.angle
    lengths = (2 * jnp.pi / film.wavelength, film.thicknesses, floating(depth))
    return _fields(film.media, *lengths, angle, polarisations=film.polarisations)


@partial(jax.jit, static_argnames="polarisations")
def _fields(
    media: Any, wavenumber: Any, thicknesses: list[Any], depth: Any, angle: Any, polarisations: str
) -> Field:
    ambient, layers, substrate = media
    waves = fields(ambient, layers, substrate, wavenumber, thicknesses, depth, angle, polarisations)
    energy = sum(wave.energy() * (1 / len(waves)) for wave in waves)
    _, q0 = transverse(ambient, angle)
    incident = jnp.sqrt(q0)  # |E| of the incident wave is 1, of each of these 1/√q₀
    turns = [jax.lax.complex(incident * jnp.cos(x.phase), incident * jnp.sin(x.phase)) for x in waves]

    def turned(components: Any) -> Any:
        axes = zip(*components, strict=True)
        return jnp.stack([sum(t * to_complex(x) for t, x in zip(turns, axis, strict=True)) for axis in axes])

    electric, magnetic = turned([x.electric for x in waves]), turned([x.magnetic for x in waves])
    return Field(q0 * energy, wavenumber * waves[0].loss * energy, electric, magnetic)
