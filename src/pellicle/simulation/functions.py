"""Reflectance, transmittance, ellipsometric angles, Jones and Mueller matrices, as functions of numbers.

Every argument broadcasts and may be traced: `jit`, `vmap`, `grad` and `jacfwd` work through all of
them. The precision follows the input, float32 or float64.
"""

import warnings
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Complex, Float

from pellicle.dispersion.anisotropic import Anisotropic, principal_media
from pellicle.dispersion.base import AbstractDispersion
from pellicle.errors import UsageError
from pellicle.optics import coherent, interface, response
from pellicle.optics import ellipsometry as waves
from pellicle.optics.anisotropy import is_anisotropic
from pellicle.optics.berreman.matrices import Elements
from pellicle.optics.berreman.slices import DIRECT
from pellicle.optics.berreman.stack import Polarised, most_dichroic, polarised
from pellicle.optics.interface import normal, normal_flux, transverse
from pellicle.optics.pair import Number, abs2, is_real, to_complex, to_pair
from pellicle.optics.response import Response
from pellicle.scene.film import check_polarisation
from pellicle.scene.layers import ambient_medium, medium

Medium = Any
"""A number (n + ik), an array of them, a material, or a material's name."""


class FilmArguments(NamedTuple):
    """A film as `pellicle.optics.coherent.responses` takes it."""

    wavelength: Any  # nm
    thicknesses: list[Any]  # nm
    media: tuple[Number, list[Any], Any]  # ambient, layers and substrate, each of them any medium of optics
    angle: Any  # radians; None is normal incidence
    polarisations: str
    propagating: bool  # no wave is totally reflected in a real layer

    @property
    def phases(self) -> list[Any]:
        """k₀d of each layer."""
        return [2 * jnp.pi / self.wavelength * d for d in self.thicknesses]


def film_arguments(wavelength, thickness, layer, substrate, ambient, angle, polarisation) -> FilmArguments:
    """Evaluate and check the arguments of `pellicle.reflectance`.

    To be called by a helper of the public function: a warning names the line that calls the latter.
    """
    check_polarisation(polarisation)
    for name, value in {"wavelength": wavelength, "thickness": thickness, "angle": angle}.items():
        if isinstance(value, str):
            raise UsageError(f"`{name}` must be a number or an array, not {value!r}")
    check_numbers(wavelength, thickness, angle)
    if _loses_precision(wavelength, thickness, layer, substrate, ambient, angle):
        warnings.warn(
            "float64 input is computed in float32: jax.config.update('jax_enable_x64', True) keeps it",
            stacklevel=4,
        )
    wavelength = floating(wavelength)
    normal = isinstance(angle, int | float) and angle == 0
    several = isinstance(layer, list | tuple)
    propagating = normal or all(
        interface.propagates(n, ambient, angle) for n in (layer if several else [layer])
    )
    into_below = normal or interface.propagates(substrate, ambient, angle)
    named = isinstance(ambient, str | AbstractDispersion)
    ambient = index_at(ambient_medium(ambient) if named else ambient, wavelength)
    substrate = index_at(substrate, wavelength)
    if not is_real(ambient):
        raise ValueError("the ambient must not absorb: give it a real index")
    if not into_below and not is_anisotropic(substrate):
        substrate = interface.allow_tunnelling(substrate)
    theta = None if normal else jnp.deg2rad(floating(angle))
    letters = "sp" if polarisation == "unpolarised" else polarisation
    layers, thicknesses = [layer], [thickness]
    if several:
        layers = layer
        count = len(thickness) if isinstance(thickness, list | tuple) else np.shape(thickness)[:1]
        if count not in (len(layers), (len(layers),)):
            raise ValueError(f"thickness: expected one for each of {len(layers)} layers, got {count}")
        thicknesses = [thickness[i] for i in range(len(layers))]
    media = ambient, [index_at(n, wavelength) for n in layers], substrate
    return FilmArguments(wavelength, thicknesses, media, theta, letters, propagating)


MICROMETRES = 10.0
"""Wavelengths in nm below it are of X-rays, which no catalogue covers; in µm they are of light."""


def check_numbers(wavelength: Any, thickness: Any, angle: Any) -> None:
    """Raise UsageError for impossible numbers; traced ones are not known, and pass."""
    for x in thickness if isinstance(thickness, list | tuple) else [thickness]:
        if (value := _wrong(x, lambda d: d < 0)) is not None:
            raise UsageError(f"`thickness` must not be negative, got {value:g} nm")
    if (value := _wrong(wavelength, lambda nm: ~(nm > 0))) is not None:
        raise UsageError(f"`wavelength` must be above zero, in nm, got {value:g}")
    # not JAX's own array, of which a program would trace the maximum
    known = np.asarray([] if isinstance(wavelength, Tracer) else wavelength)
    if known.size and (most := np.max(known)) < MICROMETRES:
        unit, scale = ("µm", 1e3) if most > 1e-3 else ("m", 1e9)
        raise UsageError(f"`wavelength` is in nm, and {most:g} is like one in {unit}: write {scale * most:g}")
    if (value := _wrong(angle, lambda degrees: ~(np.abs(degrees) <= 90))) is not None:
        raise UsageError(f"`angle` must be 0 to 90 degrees, got {value:g}")


def _wrong(values: Any, test: Callable[[np.ndarray], np.ndarray]) -> Any:
    """The first of some known numbers that fails a test; None where none does, or they are traced."""
    if isinstance(values, Tracer):
        return None
    array = np.asarray(values)
    failing = array[test(array)] if array.dtype.kind in "fiu" else array[:0]
    return failing.flat[0] if failing.size else None


def floating(x: Any):
    """Convert to an array of real or complex floats, weakly typed where it is a Python number."""
    return jnp.asarray(x) * 1.0


def index_at(what: Medium, wavelength) -> Any:
    """Return the index at the wavelengths: arrays and numbers as they are, materials evaluated."""
    if isinstance(what, str | AbstractDispersion):
        return _material_at(what, wavelength).index(wavelength)
    if not isinstance(what, Tracer) and np.iscomplexobj(what):
        known: Any = np.ravel(np.asarray(what, complex))  # JAX's copy would be traced in a program
        if (gain := known[known.imag < 0]).size:
            said = f"index {gain[np.argmin(gain.imag)]:g} has a negative imaginary part, which is gain:"
            raise UsageError(f"{said} absorption is n + ik with k ≥ 0")
    return to_pair(floating(what))


def _material_at(what: str | AbstractDispersion, wavelength: Any) -> AbstractDispersion:
    """A material, with data at the wavelengths where these are known."""
    material = medium(what)
    for principal in [] if isinstance(wavelength, Tracer) else principal_media(material):
        if hasattr(principal, "check_range"):
            principal.check_range(np.asarray(wavelength))
    return material


def _loses_precision(*arguments: Any) -> bool:
    if jax.config.jax_enable_x64:  # pyright: ignore[reportAttributeAccessIssue]
        return False
    double = (np.float64, np.complex128)
    return any(isinstance(a, np.ndarray | np.generic) and a.dtype in double for a in arguments)


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
    if isinstance(what, str | AbstractDispersion):
        value = _material_at(what, wavelength)(wavelength)
    else:
        value = to_complex(index_at(what, floating(wavelength)))
    if isinstance(what, Anisotropic):
        return value
    return jnp.broadcast_to(value, jnp.broadcast_shapes(value.shape, jnp.shape(wavelength)))


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
