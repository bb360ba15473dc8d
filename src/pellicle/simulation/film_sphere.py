"""Spheres with smooth films: a solid ball under them, and a soap bubble that drains.

A ray that meets a ball meets it again and again at one angle and in one plane of incidence, so s and p stay
what they are and their spectra multiply. The film has one thickness over the ball.

A line of sight crosses the film of a bubble in front and at the back at one angle, and is mirrored along
further chords within. Its thickness depends on the height.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from pellicle.colour import integration_bands
from pellicle.colour.observers import Sensor, srgb_sensor
from pellicle.dispersion.base import known_index
from pellicle.errors import UsageError
from pellicle.optics import coherent, response
from pellicle.optics.interface import Inside, allow_tunnelling
from pellicle.optics.pair import Number, to_complex
from pellicle.scene.film import Scene
from pellicle.scene.free import insert, start_values
from pellicle.scene.layers import Layer
from pellicle.simulation.colours import BANDS, varied_layer
from pellicle.simulation.environment import Environment, Rendering, sphere

_BATCH = 4096
"""Films in one call: 4096 × 64 wavelengths are 2 MB in double precision."""


class Stack(NamedTuple):
    """Indices of smooth layers between two media at the wavelengths of `eye`, and their thicknesses in nm.

    The thickness of the layer `varied` is given to `spectra` instead.
    """

    eye: Sensor
    ambient: Number
    layers: tuple[Number, ...]
    substrate: Number
    thickness: tuple[float, ...]
    varied: int


class Spectra(NamedTuple):
    """Reflectance from above, transmittance and reflectance from below, each (2, ..., wavelengths), s and p.

    The light from below is that which the layers transmit at the angle above.
    """

    reflected: np.ndarray
    transmitted: np.ndarray
    below: np.ndarray


def stack(
    scene: Scene,
    layer: str | None = None,
    *,
    observer: str = "1931",
    illuminant: str = "D65",
    eye: Sensor | None = None,
) -> Stack:
    """Return the media of a scene at the wavelengths of `BANDS`; free parameters take their start values.

    A back face of the substrate is left out: the substrate is the inside of the sphere.

    **Arguments:** `layer`, `observer` and `illuminant` as for `interference_colours`; `eye` is a sensor in
    place of the last two.

    **Raises:** UsageError for a plate or a mixed interface among the layers, and where a material has no data
    between 380 and 730 nm.
    """
    varied, bands = varied_layer(scene, layer), integration_bands(BANDS, observer, illuminant)
    eye = Sensor(bands.wavelength, bands.weights) if eye is None else eye
    fixed: Any = insert(scene, start_values(scene))
    if not all(x.repeats == 1 for x in fixed.layers if isinstance(x, Layer)):
        raise UsageError("a sphere has no groups of layers: list every layer")
    if not all(isinstance(each, Layer) for each in fixed.layers):
        raise UsageError("a sphere has coherent layers only: leave out plates and mixed interfaces")
    media = [fixed.ambient, *(each.material for each in fixed.layers), fixed.substrate.material]
    indices: list[Any] = [known_index(medium, eye.wavelength) for medium in media]
    if not all(np.all(np.isfinite(part)) for part in jax.tree.leaves(indices)):
        raise UsageError("a material has no data between 380 and 730 nm, which a colour needs")
    ambient, *layers, substrate = jax.tree.map(lambda part: part * np.ones(len(eye.wavelength)), indices)
    thickness = tuple(float(each.thickness) for each in fixed.layers)
    return Stack(eye, ambient, tuple(layers), substrate, thickness, varied)


def spectra(films: Stack, thickness: float | np.ndarray, cosine: np.ndarray) -> Spectra:
    """Compute spectra at thicknesses (nm) of the varied layer and cosines of incidence, which broadcast."""
    return Spectra(*_batched(_spectra, films, thickness, cosine))


def mueller_elements(films: Stack, thickness: float | np.ndarray, transverse: np.ndarray) -> np.ndarray:
    """Mueller matrices of reflection and transmission (2, 4, ..., wavelengths): elements m11, m12, m33, m34.

    `transverse` is n sin θ; Q > 0 is s. An isotropic film has m22 = m11, m21 = m12, m44 = m33, m43 = −m34.
    """
    return _batched(_mueller, films, thickness, transverse)


def _batched(program: Any, films: Stack, thickness: float | np.ndarray, direction: np.ndarray) -> np.ndarray:
    """The program's arrays (kinds, elements, ..., wavelengths), computed in batches of films."""
    points = np.broadcast_arrays(np.asarray(thickness, float), np.asarray(direction, float))
    rows = np.stack([each.ravel() for each in points])
    count = rows.shape[1]
    size = min(_BATCH, 1 << (count - 1).bit_length())  # powers of two: few programs
    rows = np.pad(rows, ((0, 0), (0, -count % size)), "edge").reshape(2, -1, size)
    media = (films.ambient, films.layers, films.substrate, films.eye.wavelength)
    with jax.enable_x64(True):
        fixed = (media, films.thickness, films.varied)
        parts = [np.asarray(program(*fixed, *batch)) for batch in rows.swapaxes(0, 1)]
    whole = np.concatenate(parts, axis=2)
    return whole[:, :, :count].reshape(*whole.shape[:2], *points[0].shape, -1)


@jax.jit
def _spectra(media: Any, fixed: Any, varied: Any, thickness: Any, cosine: Any) -> Any:
    """Spectra (3, 2, films, wavelengths)."""
    each = _responses(media, fixed, varied, thickness, jnp.arccos(cosine)[:, None])
    quantities = (response.reflectance, response.transmittance, response.reflectance_below)
    return jnp.stack([jnp.stack([quantity(one) for one in each]) for quantity in quantities])


@jax.jit
def _mueller(media: Any, fixed: Any, varied: Any, thickness: Any, transverse: Any) -> Any:
    """Elements (2, 4, films, wavelengths) of reflection and transmission."""
    s, p = _responses(media, fixed, varied, thickness, Inside(transverse[:, None]))
    passed = [jnp.sqrt(jnp.maximum(x.flux * x.scale_square, 0.0)) for x in (s, p)]
    kinds = []
    for on_s, on_p in ((s.reflected, p.reflected), passed):
        a, b = (to_complex(x) / to_complex(one.denominator) for x, one in ((on_s, s), (on_p, p)))
        both, powers = a * jnp.conj(b), (jnp.abs(a) ** 2, jnp.abs(b) ** 2)
        mean, half = 0.5 * (powers[0] + powers[1]), 0.5 * (powers[0] - powers[1])
        kinds.append(jnp.stack([mean, half, both.real, both.imag]))
    return jnp.stack(kinds)


def _responses(
    media: Any, fixed: tuple[Any, ...], varied: Any, thickness: Any, angle: Any
) -> tuple[response.Response, ...]:
    """Responses to s and p of films (films, wavelengths)."""
    ambient, layers, substrate, wavelength = media
    turns = 2 * jnp.pi / wavelength
    phases = [turns * jnp.where(varied == i, thickness, nm)[:, None] for i, nm in enumerate(fixed)]
    inner = [allow_tunnelling(index) for index in layers]
    return coherent.responses(ambient, inner, allow_tunnelling(substrate), phases, angle)


def linear_srgb(films: Stack, spectrum: np.ndarray) -> np.ndarray:
    """Linear sRGB (..., 3) of spectra (2, ..., wavelengths) in unpolarised light, the mean of s and p.

    The white of the illuminant is (1, 1, 1).
    """
    return spectrum.mean(axis=0) @ srgb_sensor(films.eye).weights


COSINES = 256
"""Nodes of the cosine between which colours are interpolated: within 0.001 of white for films to 1 µm."""
CHORDS = 5
"""Most chords within the ball: under a film that reflects a quarter, further ones have 0.1 % of the light."""
OPAQUE = 1e-4
"""Extinction from which a ball is opaque: 0.2 mm of it then pass less than 60 % at 500 nm."""


class Ball(NamedTuple):
    """Renderings of a ball: in reflection alone, and of the light through it (None if it is opaque)."""

    reflected: Rendering
    transmitted: Rendering | None

    @property
    def whole(self) -> Rendering:
        """Both together."""
        if self.transmitted is None:
            return self.reflected
        return self.reflected._replace(linear=self.reflected.linear + self.transmitted.linear)


def ball(films: Stack, thickness: float, environment: Environment, size: int) -> Ball:
    """Render a ball under a film of this thickness (nm), size × size pixels.

    Colours are integrals of the spectra in steps of 1 nm. Within the ball each ray runs as its refractive
    index at 550 nm bends it: the ball disperses no colours.
    """
    pixels = sphere(size)
    cosine = np.linspace(0.0, 1.0, COSINES + 1)[1:]
    light = spectra(films, thickness, cosine)

    def colour(spectrum: np.ndarray) -> np.ndarray:
        return pixels.interpolated(cosine, linear_srgb(films, spectrum))

    seen = environment.radiance(pixels.mirrored())[:, None]
    reflected = pixels.rendering(colour(light.reflected) * seen)
    if np.max(np.imag(to_complex(films.substrate))) > OPAQUE:
        return Ball(reflected, None)
    media = (np.real(to_complex(medium)) for medium in (films.substrate, films.ambient))
    n2, n0 = (float(np.interp(550.0, films.eye.wavelength, index)) for index in media)
    # light after one chord, two, ...: T² R′^(chords − 1) of what lies where it leaves
    outside = np.arccos(pixels.cosine)
    inside = np.arcsin(np.clip(np.sin(outside) / (n2 / n0), -1.0, 1.0))
    total = np.zeros((len(outside), 3))
    spectrum = light.transmitted**2
    for chord in range(CHORDS):
        turned = 2 * (outside - inside) + chord * (np.pi - 2 * inside)
        total += colour(spectrum) * environment.radiance(pixels.deflected(-turned))[:, None]
        spectrum = spectrum * light.below
    return Ball(reflected, pixels.rendering(total))


CROSSINGS = 4
"""Crossings of the film on one line of sight: a further one has less than 1 % of the light up to 80°."""
LOWEST = np.deg2rad(172.0)
"""Angle from the top beyond which the film has one thickness: at the bottom the profile rises without end."""


def drained_thickness(angle: Any, top: float) -> Any:
    """Thickness (nm) of a bubble's film at an angle (radians) from its top, where it is `top` nm thick.

    Liquid between two immobile surfaces flows down a sphere of radius R by ∂d/∂t + ∂(sin²θ ρg d³/12η)/∂θ /
    (R sin θ) = 0. Its similarity solution, d = f(θ)/√t, is
    f/f(0) = √(4/3 ∫₀^θ sin^⅓ dφ) / sin^⅔ θ: the film thins everywhere in proportion.
    """
    from scipy.special import beta, betainc  # slow to import

    angle = np.clip(angle, 1e-6, LOWEST)
    half = 0.5 * beta(2 / 3, 0.5) * betainc(2 / 3, 0.5, np.sin(angle) ** 2)  # of sin^⅓ from 0 to θ or π − θ
    integral = np.where(angle <= np.pi / 2, half, beta(2 / 3, 0.5) - half)
    return top * np.sqrt(4 / 3 * integral) / np.sin(angle) ** (2 / 3)


def bubble(films: Stack, top: float, environment: Environment, size: int) -> Rendering:
    """Render a bubble whose film is `top` nm thick at its top, size × size pixels.

    **Raises:** UsageError where the media on both sides differ.
    """
    if np.max(np.abs(to_complex(films.ambient) - to_complex(films.substrate))) > 1e-3:
        raise UsageError("a bubble has the same medium on both sides: make the substrate that of the ambient")
    pixels = sphere(size)
    angle = np.arccos(pixels.cosine)
    step = np.pi - 2 * angle  # along the sphere, from one crossing to the next
    linear = np.zeros((len(angle), 3))
    passed = np.ones((2, 1, 1))
    for crossing in range(CROSSINGS):
        along = angle + crossing * step
        height = np.sin(along) * pixels.outward[:, 1]
        nm = drained_thickness(np.arccos(np.clip(height, -1.0, 1.0)), top)
        light = spectra(films, nm, pixels.cosine)
        if crossing == 0:
            linear += linear_srgb(films, light.reflected) * environment.radiance(pixels.mirrored())[:, None]
            passed = light.transmitted
            continue
        seen = environment.radiance(pixels.deflected(-(crossing - 1) * step))
        linear += linear_srgb(films, passed * light.transmitted) * seen[:, None]
        passed = passed * light.reflected
    return pixels.rendering(linear)
