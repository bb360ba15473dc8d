"""Reflectance, transmittance and ellipsometric angles of coherent layers, as functions of numbers.

Every argument broadcasts and may be traced: `jit`, `vmap`, `grad` and `jacfwd` work through all of
them. The precision follows the input, float32 or float64.
"""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Complex, Float

from pellicle.dispersion.anisotropic import Anisotropic
from pellicle.optics import coherent, response
from pellicle.optics.ellipsometry import normalised, psi_delta, stokes
from pellicle.optics.pair import to_complex
from pellicle.optics.response import Response
from pellicle.scene.layers import medium
from pellicle.simulation.film_arguments import Medium, film_arguments, floating, index_at


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
    wavelength: Any,
    thickness: Any,
    layer: Medium,
    substrate: Medium,
    *,
    ambient: Medium = 1.0,
    angle: Any,
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
    s, p = _responses(wavelength, thickness, layer, substrate, ambient, angle, "unpolarised")
    return _psi_delta(s, p)


@jax.jit
def _psi_delta(s: Response, p: Response) -> tuple[Any, Any]:
    return psi_delta(*normalised(stokes(s, p)))


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
    wavelength = floating(wavelength)
    if isinstance(what, Anisotropic):
        index_at(what, wavelength)  # which raises for wavelengths outside the data
        return medium(what)(wavelength)
    value = to_complex(index_at(what, wavelength))
    return jnp.broadcast_to(value, jnp.broadcast_shapes(value.shape, wavelength.shape))


def _responses(wavelength, thickness, layer, substrate, ambient, angle, polarisation):
    film = film_arguments(wavelength, thickness, layer, substrate, ambient, angle, polarisation)
    phases = [2 * jnp.pi / film.wavelength * d for d in film.thicknesses]
    media = (film.ambient, film.layers, film.substrate)
    static = {"polarisations": film.polarisations, "propagating": film.propagating}
    return _compiled_responses(*media, phases, film.angle, **static)


_compiled_responses = jax.jit(coherent.responses, static_argnames=("polarisations", "propagating"))
