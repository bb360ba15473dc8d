"""Reflectance, transmittance, ellipsometric angles, Jones and Mueller matrices, as functions of numbers.

Every argument broadcasts and may be traced: `jit`, `vmap`, `grad` and `jacfwd` work through all of
them. The precision follows the input, float32 or float64.
"""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Complex, Float

from pellicle.dispersion.anisotropic import Anisotropic
from pellicle.dispersion.base import AbstractDispersion
from pellicle.errors import UsageError
from pellicle.optics import coherent, response
from pellicle.optics import ellipsometry as waves
from pellicle.optics.anisotropy import is_anisotropic
from pellicle.optics.berreman.matrices import Elements
from pellicle.optics.berreman.slices import DIRECT
from pellicle.optics.berreman.stack import Polarised, most_dichroic, polarised
from pellicle.optics.interface import normal, normal_flux, transverse
from pellicle.optics.pair import abs2, to_complex
from pellicle.optics.response import Response
from pellicle.simulation.arguments import (
    FilmArguments,
    Medium,
    film_arguments,
    floating,
    index_at,
    material_at,
)


def reflectance(
    wavelength: Any,
    thickness: Any,
    layer: Medium,
    substrate: Medium,
    *,
    ambient: Medium = 1.0,
    angle: Any = 0.0,
    polarisation: str = "unpolarised",
) -> Float[Array, "..."]:
    """Power reflectance of one or several layers on a half space.

    **Arguments:**

    - `wavelength`, `thickness`: nm, any shape. For several layers `thickness` has one for each.
    - `layer`, `substrate`: number n + ik (k ≥ 0 absorbs), array, material or name. For several coherent
      layers `layer` is a list from the ambient down.
    - `ambient`: as `layer`, but real.
    - `angle` of incidence in degrees, any shape.
    - `polarisation`: "s", "p" or "unpolarised" (the mean of both).

    **Returns:** a fraction, in the shape that the arguments broadcast to.

    At 90° R is 1 and T is 0, except without any layer between equal media, where R is 0 at every angle.
    Where the substrate is exactly critical the derivatives diverge; those returned are finite.

    **Raises:** ValueError for an absorbing ambient, an unknown polarisation or material, and
    wavelengths outside the data of a material. Under `jit`, where wavelengths are unknown, the result is
    NaN there.

    **Source:** Gerardin et al. 2019, eqs. 11-17, in the form of `pellicle.optics.film`.

    ```python
    >>> round(float(pl.reflectance(550.0, 100.0, 1.46, 4.07 + 0.03j)), 4)
    0.1015

    ```
    """
    return response.reflectance(
        *_responses(wavelength, thickness, layer, substrate, ambient, angle, polarisation)
    )


def transmittance(
    wavelength: Any,
    thickness: Any,
    layer: Medium,
    substrate: Medium,
    *,
    ambient: Medium = 1.0,
    angle: Any = 0.0,
    polarisation: str = "unpolarised",
) -> Float[Array, "..."]:
    """Power transmittance of one or several layers into their substrate.

    **Arguments**, **Returns** and **Raises** as `reflectance`. With an absorbing substrate it is the power
    that enters it.

    **Source:** Gerardin et al. 2019, eq. 21. They use one power weight for both polarisations, which is
    wrong for p with an absorbing substrate; here each has its own.

    ```python
    >>> round(float(pl.transmittance(550.0, 100.0, 1.46, 1.52, angle=60.0, polarisation="p")), 4)
    0.9966

    ```
    """
    return response.transmittance(
        *_responses(wavelength, thickness, layer, substrate, ambient, angle, polarisation)
    )


def ellipsometry(
    wavelength: Any, thickness: Any, layer: Medium, substrate: Medium, *, ambient: Medium = 1.0, angle: Any
) -> tuple[Float[Array, "..."], Float[Array, "..."]]:
    """Ellipsometric angles Ψ and Δ of one or several layers on a half space.

    **Arguments** and **Raises** as `reflectance`; `angle` in degrees has no default.

    **Returns:** Ψ (0 to 90) and Δ (0 to 360) in degrees, in the shape that the arguments broadcast to. Where
    r_p or r_s is 0, Δ is undefined and set to 0; where both are, Ψ is 0 too.

    tan(Ψ) exp(iΔ) = conj(r_p / r_s) for n + ik, as instruments write it: Δ is near 180 for bare
    silicon at small angles. Δ wraps around: fit N, C, S instead (`pellicle.optics.ellipsometry`).

    ```python
    >>> psi, delta = pl.ellipsometry(632.8, 100.0, "SiO2", "Si", angle=70.0)
    >>> round(float(psi), 2), round(float(delta), 2)
    (41.03, 79.72)

    ```
    """
    angle = floating(angle)  # also at 0 both polarisations are needed
    return _psi_delta(*_responses(wavelength, thickness, layer, substrate, ambient, angle, "unpolarised"))


@jax.jit
def _psi_delta(s: Response, p: Response) -> tuple[Any, Any]:
    return waves.psi_delta(*waves.normalised(waves.stokes(s, p)))


def refractive_index(wavelength: Any, what: Medium) -> Complex[Array, "..."]:
    """Complex refractive index n + ik of a material, or of anything that a layer may be made of.

    **Arguments:** `wavelength` in nm, any shape; `what`: material, name, number or array.

    **Returns:** complex, in the shape that the arguments broadcast to. Of a `pellicle.Anisotropic` the
    principal indices, (n_o, n_e) or (n_x, n_y, n_z), along one more axis, the last.

    **Raises:** ValueError for an unknown material and for wavelengths outside its data.

    ```python
    >>> print(f"{complex(pl.refractive_index(550.0, 'Au')):.2f}")
    0.42+2.47j

    ```
    """
    if isinstance(wavelength, list | tuple):
        wavelength = np.asarray(wavelength)
    if isinstance(what, str | AbstractDispersion):
        value = material_at(what, wavelength)(wavelength)
    else:
        value = to_complex(index_at(what, floating(wavelength)))
    if isinstance(what, Anisotropic):
        return value
    return jnp.broadcast_to(value, jnp.broadcast_shapes(value.shape, np.shape(wavelength)))


def _responses(*arguments: Any) -> tuple[Response, ...]:
    film = film_arguments(*arguments)
    static = {"polarisations": film.polarisations, "propagating": film.propagating}
    return _compiled_responses(*film.media, film.phases, film.angle, **static)


_compiled_responses = jax.jit(coherent.responses, static_argnames=("polarisations", "propagating"))


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
    arguments = (wavelength, thickness, layer, substrate, ambient, angle, "unpolarised")
    film, response = _polarised_response(side, *arguments)
    return _array(response.reflected if side == "reflection" else _transmitted(film, response))


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
    arguments = (wavelength, thickness, layer, substrate, ambient, angle, "unpolarised")
    film, response = _polarised_response(side, *arguments)
    amplitudes = response.reflected
    if side == "transmission":
        # power in place of the electric field, p and s apart
        ambient, _, substrate = film.media
        q = normal(substrate, transverse(ambient, film.angle)[0])
        flux = [normal_flux(substrate, q, letter) for letter in "ps"]
        per_field = flux[0] / abs2(substrate), flux[1]
        p, s = (jnp.sqrt(jnp.maximum(x, 0.0) / response.incident) for x in per_field)
        t = _transmitted(film, response)
        amplitudes = Elements(t.pp * p, t.ps * p, t.sp * s, t.ss * s)
    matrix = waves.mueller(_array(amplitudes))
    return waves.normalised_mueller(matrix) if normalised else matrix


def _polarised_response(side: str, *arguments: Any) -> tuple[FilmArguments, Polarised]:
    if side not in ("reflection", "transmission"):
        raise UsageError(f'`side` must be "reflection" or "transmission", not {side!r}')
    film = film_arguments(*arguments)
    if side == "transmission" and is_anisotropic(film.media[-1]):
        raise ValueError(
            'a birefringent substrate transmits neither p nor s waves: `side` must be "reflection"'
        )
    film = film._replace(angle=jnp.zeros_like(film.wavelength) if film.angle is None else film.angle)
    numbers = (*film.media, film.phases, film.angle)
    traced = any(isinstance(x, Tracer) for x in jax.tree.leaves(numbers))
    dichroic = traced or bool(jnp.any(_dichroism(*film.media[:2], film.phases, film.angle) > DIRECT))
    return film, _polarised(*numbers, dichroic=dichroic)


_polarised = jax.jit(polarised, static_argnames="dichroic")
_dichroism = jax.jit(most_dichroic)


def _transmitted(film: FilmArguments, response: Polarised) -> Elements:
    """Return the Jones matrix of transmission: of the electric field of p and s in the substrate."""
    E, H = response.fields
    index = 1 / film.media[-1]
    return Elements(index * H.pp, index * H.ps, E.sp, E.ss)


def _array(elements: Elements) -> Any:
    each = jnp.stack(jnp.broadcast_arrays(*map(to_complex, elements)), axis=-1)
    return each.reshape(*each.shape[:-1], 2, 2)
