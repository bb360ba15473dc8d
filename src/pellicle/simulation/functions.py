"""Reflectance, transmittance and ellipsometric angles of coherent layers, as functions of numbers.

Every argument broadcasts and may be traced: `jit`, `vmap`, `grad` and `jacfwd` work through all of
them. The precision follows the input, float32 or float64.
"""

from __future__ import annotations

import warnings
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Complex, Float

from pellicle.dispersion.base import AbstractDispersion
from pellicle.errors import UsageError
from pellicle.optics import coherent, interface, response
from pellicle.optics.ellipsometry import normalised, psi_delta, stokes
from pellicle.optics.pair import Number, is_real, to_complex, to_pair
from pellicle.scene.film import check_polarisation
from pellicle.scene.layers import ambient_medium, medium

Medium = Any
"""A number (n + ik), an array of them, a material, or a material's name."""


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
    angle = _floating(angle)  # also at 0 both polarisations are needed
    s, p = _responses(wavelength, thickness, layer, substrate, ambient, angle, "unpolarised")
    return psi_delta(*normalised(stokes(s, p)))


def refractive_index(wavelength: Any, what: Medium) -> Complex[Array, "..."]:
    """Complex refractive index n + ik of a material, or of anything that a layer may be made of.

    **Arguments:** `wavelength` in nm, any shape; `what`: material, name, number or array.

    **Returns:** complex, in the shape that the arguments broadcast to.

    **Raises:** ValueError for an unknown material and for wavelengths outside its data.

    ```python
    >>> print(f"{complex(pl.refractive_index(550.0, 'Au')):.2f}")
    0.42+2.47j

    ```
    """
    wavelength = _floating(wavelength)
    value = to_complex(_index(what, wavelength))
    return jnp.broadcast_to(value, jnp.broadcast_shapes(value.shape, wavelength.shape))


def _responses(wavelength, thickness, layer, substrate, ambient, angle, polarisation):
    check_polarisation(polarisation)
    for name, value in {"wavelength": wavelength, "thickness": thickness, "angle": angle}.items():
        if isinstance(value, str):
            raise UsageError(f"`{name}` must be a number or an array, not {value!r}")
    _warn_of_lost_precision(wavelength, thickness, layer, substrate, ambient, angle)
    wavelength = _floating(wavelength)
    normal = isinstance(angle, int | float) and angle == 0
    several = isinstance(layer, list | tuple)
    propagating = normal or all(
        interface.propagates(n, ambient, angle) for n in (layer if several else [layer])
    )
    into_below = normal or interface.propagates(substrate, ambient, angle)
    named = isinstance(ambient, str | AbstractDispersion)
    ambient = _index(ambient_medium(ambient) if named else ambient, wavelength)
    substrate = _index(substrate, wavelength)
    if not is_real(ambient):
        raise ValueError("the ambient must not absorb: give it a real index")
    if not into_below:
        substrate = interface.allow_tunnelling(substrate)
    theta = None if normal else jnp.deg2rad(_floating(angle))
    letters = "sp" if polarisation == "unpolarised" else polarisation
    layers, thicknesses = [layer], [thickness]
    if several:
        layers, thicknesses = layer, thickness
        count = len(thickness) if isinstance(thickness, list | tuple) else np.shape(thickness)[:1]
        if count not in (len(layers), (len(layers),)):
            raise ValueError(f"thickness: expected one for each of {len(layers)} layers, got {count}")
    indices = [_index(n, wavelength) for n in layers]
    phases = [2 * jnp.pi / wavelength * thicknesses[i] for i in range(len(layers))]
    return coherent.responses(ambient, indices, substrate, phases, theta, letters, propagating=propagating)


def _floating(x: Any):
    return jnp.asarray(x) * 1.0


def _index(what: Medium, wavelength) -> Number:
    """The index at the wavelengths: arrays and numbers as they are, materials evaluated."""
    if isinstance(what, str | AbstractDispersion):
        material = medium(what)
        check = getattr(material, "check_range", None)
        if check is not None and not isinstance(wavelength, Tracer):
            check(np.asarray(wavelength))
        return material.index(wavelength)
    return to_pair(_floating(what))


def _warn_of_lost_precision(*arguments: Any) -> None:
    if jax.config.jax_enable_x64:  # pyright: ignore[reportAttributeAccessIssue]
        return
    double = (np.float64, np.complex128)
    if any(isinstance(a, np.ndarray | np.generic) and a.dtype in double for a in arguments):
        warnings.warn(
            "float64 input is computed in float32: jax.config.update('jax_enable_x64', True) keeps it",
            stacklevel=4,
        )
