"""Jones and Mueller matrices of layers, which may be birefringent, as functions of numbers."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
from jax.core import Tracer
from jaxtyping import Array, Complex, Float

from pellicle.errors import UsageError
from pellicle.optics import mueller as mueller_matrices
from pellicle.optics.anisotropy import is_anisotropic
from pellicle.optics.berreman.matrices import Elements
from pellicle.optics.berreman.slices import DIRECT
from pellicle.optics.berreman.stack import Polarised, most_dichroic, polarised
from pellicle.optics.interface import normal, normal_flux, transverse
from pellicle.optics.pair import abs2, to_complex
from pellicle.simulation.film_arguments import FilmArguments, Medium, film_arguments


def jones(
    wavelength: Any,
    thickness: Any,
    layer: Medium,
    substrate: Medium,
    *,
    ambient: Medium = 1.0,
    angle: Any,
    side: str = "reflection",
) -> Complex[Array, "... 2 2"]:
    """Jones matrix of one or several layers on a half space, isotropic or birefringent.

    **Arguments** as for `pellicle.reflectance`; a layer and the substrate may also be `pellicle.Anisotropic`.
    `angle` of incidence in degrees has no default. `side`: "reflection", or "transmission" into an isotropic
    substrate.

    **Returns:** complex, in the shape that the arguments broadcast to, with two more axes:
    [[r_pp, r_ps], [r_sp, r_ss]] for electric fields. Rows are outgoing and columns incident: r_ps is the
    reflected p wave for incident s (Woollam's instruments write r_sp for it). The signs are those of
    `pellicle.ellipsometry`: r_pp/r_ss is near −1 for bare silicon at small angles, and the time factor is
    exp(−iωt), so that tan(Ψ) exp(iΔ) = conj(r_pp/r_ss). The azimuth of an optic axis counts from the plane of
    incidence, from x (the direction of the light along the surface) towards y = z × x with z into the sample;
    s is along y.

    **Raises:** as `pellicle.reflectance`; ValueError for transmission into a birefringent substrate, whose
    two waves are neither p nor s.

    **Source:** D. W. Berreman, J. Opt. Soc. Am. 62, 502 (1972), in the form of `pellicle.optics.berreman`.

    ```python
    >>> calcite = pl.Anisotropic(1.658, 1.486, axis=(45.0, 30.0))
    >>> matrix = pl.jones(589.3, 500.0, calcite, 1.52, angle=60.0)
    >>> print(" ".join(f"{abs(x):.3f}" for x in matrix.ravel()))
    0.026 0.039 0.012 0.500

    ```
    """
    film, response = _response(wavelength, thickness, layer, substrate, ambient, angle, side)
    amplitudes = response.reflected if side == "reflection" else _transmitted(film, response)
    return _array([to_complex(x) for x in amplitudes])


def mueller(
    wavelength: Any,
    thickness: Any,
    layer: Medium,
    substrate: Medium,
    *,
    ambient: Medium = 1.0,
    angle: Any,
    side: str = "reflection",
    normalised: bool = True,
) -> Float[Array, "... 4 4"]:
    """Mueller matrix of one or several layers on a half space, isotropic or birefringent.

    **Arguments** and **Raises** as `jones`. `normalised`: divided by its element m11, as instruments
    write it. Otherwise m11 is the reflectance or transmittance for unpolarised light.

    **Returns:** real, in the shape that the arguments broadcast to, with two more axes. An isotropic sample
    has m12 = m21 = −N, m33 = m44 = C and m34 = −m43 = S, with N = cos 2Ψ, C = sin 2Ψ cos Δ and
    S = sin 2Ψ sin Δ. Where there is no light, the normalised matrix is 0.

    Mueller matrices of incoherent contributions add before they are normalised; Jones matrices do not.

    ```python
    >>> silicon = pl.mueller(632.8, 100.0, "SiO2", "Si", angle=70.0)
    >>> print(np.round(silicon[0] + 0.0, 3))
    [ 1.    -0.138  0.     0.   ]

    ```
    """
    film, response = _response(wavelength, thickness, layer, substrate, ambient, angle, side)
    amplitudes = response.reflected
    if side == "transmission":
        # power in place of the electric field, p and s apart
        flux = [normal_flux(film.substrate, _normal(film), letter) for letter in "ps"]
        per_field = flux[0] / abs2(film.substrate), flux[1]
        p, s = (jnp.sqrt(jnp.maximum(x, 0.0) / response.incident) for x in per_field)
        t = _transmitted(film, response)
        amplitudes = Elements(t.pp * p, t.ps * p, t.sp * s, t.ss * s)
    matrix = mueller_matrices.mueller(_array([to_complex(x) for x in amplitudes]))
    return mueller_matrices.normalised(matrix) if normalised else matrix


def _response(
    wavelength: Any, thickness: Any, layer: Any, substrate: Any, ambient: Any, angle: Any, side: str
) -> tuple[FilmArguments, Polarised]:
    if side not in ("reflection", "transmission"):
        raise UsageError(f'`side` must be "reflection" or "transmission", not {side!r}')
    film = film_arguments(wavelength, thickness, layer, substrate, ambient, angle, "unpolarised")
    if side == "transmission" and is_anisotropic(film.substrate):
        raise ValueError(
            'a birefringent substrate transmits neither p nor s waves: `side` must be "reflection"'
        )
    angle = jnp.zeros_like(film.wavelength) if film.angle is None else film.angle
    film = film._replace(angle=angle)
    phases = [2 * jnp.pi / film.wavelength * d for d in film.thicknesses]
    numbers = (film.ambient, film.layers, film.substrate, phases, angle)
    traced = any(isinstance(x, Tracer) for x in jax.tree.leaves(numbers))
    dichroic = traced or bool(jnp.any(_dichroism(film.ambient, film.layers, phases, angle) > DIRECT))
    return film, _polarised(*numbers, dichroic=dichroic)


_polarised = jax.jit(polarised, static_argnames="dichroic")
_dichroism = jax.jit(most_dichroic)


def _normal(film: FilmArguments) -> Any:
    return normal(film.substrate, transverse(film.ambient, film.angle)[0])


def _transmitted(film: FilmArguments, response: Polarised) -> Elements:
    """Return the Jones matrix of transmission: of the electric field of p and s in the substrate."""
    E, H = response.fields
    index = 1 / film.substrate
    return Elements(index * H.pp, index * H.ps, E.sp, E.ss)


def _array(elements: list[Any]) -> Any:
    pp, ps, sp, ss = jnp.broadcast_arrays(*elements)
    return jnp.stack([jnp.stack([pp, ps], axis=-1), jnp.stack([sp, ss], axis=-1)], axis=-2)
