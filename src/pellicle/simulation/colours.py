"""Interference colours of a film against thickness and angle, and simulated measurements of them."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import ArrayLike

from pellicle.colour import integration_bands, sensor
from pellicle.colour.film import Colour
from pellicle.colour.film import film_colour as colour_of_film
from pellicle.colour.observers import Sensor, srgb_sensor
from pellicle.colour.observers import sensor as observer
from pellicle.colour.spaces import measured_encoding
from pellicle.colour.table import REFERENCE, TOLERANCE, FilmColourTable
from pellicle.data.colours import CameraMatrix, Colours
from pellicle.data.options import SPACES
from pellicle.effects.differences import signals
from pellicle.effects.film_plan import exact
from pellicle.errors import UsageError
from pellicle.forward_model.film_signal import build, tabulated
from pellicle.forward_model.plan import Plan
from pellicle.optics.pair import real
from pellicle.scene.film import Scene, with_wavelength
from pellicle.scene.free import Free, insert, start_values
from pellicle.scene.layers import Layer, medium
from pellicle.simulation.arguments import check_index, check_numbers
from pellicle.simulation.spectra import simulate_signal

BANDS = "uniform-64"
"""Integration over the spectrum: colours within ΔE2000 = 0.02 of steps of 1 nm, for films up to 5 µm."""


def film_colour(
    thickness: Any,
    layer: Any,
    substrate: Any,
    *,
    ambient: Any = 1.0,
    angle: Any = 0.0,
    method: str | None = None,
    illuminant: str = "D65",
    observer: str = "1931",
) -> Colour:
    """Colour of one or several layers on a half space in unpolarised light.

    **Arguments:** `thickness` in nm, `layer`, `substrate`, `ambient` and `angle` in degrees as
    `pellicle.reflectance` takes them: names, materials, numbers n + ik, and lists for several layers.
    `method`: see `pellicle.colour.integration_bands`; "gaussians-8" if None, or "uniform-64" for several
    layers. `illuminant`, `observer`: see `pellicle.colour.sensor`.

    **Returns:** `Colour`, with `xyz`, `lab`, `linear_srgb` and `srgb`, each in the shape that the arguments
    broadcast to, and one more axis.

    **Raises:** as `pellicle.reflectance`, and ValueError for an unknown method, observer or illuminant.

    ```python
    >>> [round(float(x), 2) for x in pl.film_colour(300.0, "SiO2", "Si").srgb]
    [0.3, 0.42, 0.68]

    ```
    """
    several = isinstance(layer, list | tuple)
    layers, below, above = (_media(x) for x in (layer if several else [layer], [substrate], [ambient]))
    for d in thickness if several else [thickness]:
        check_numbers(550.0, d, angle)
    for index in (*layers, *below, *above):
        if np.ndim(index) or np.isscalar(index):
            check_index(index)
    chosen = method or (BANDS if several else "gaussians-8")
    how: dict[str, Any] = {"angle": angle, "method": chosen, "illuminant": illuminant, "observer": observer}
    return colour_of_film(thickness, layers if several else layers[0], below[0], ambient=above[0], **how)


def _media(media: Sequence[Any]) -> list[Any]:
    """Media with materials in place of their names."""
    return [medium(x) if isinstance(x, str) else x for x in media]


def interference_colours(
    scene: Scene,
    thickness: np.ndarray,
    angle: np.ndarray,
    layer: str | None = None,
    *,
    observer: str = "1931",
    illuminant: str = "D65",
) -> Colour:
    """Colours of a film, reflected or transmitted as the scene's signal says.

    **Arguments:** `thickness` in nm, (thicknesses,), of the `layer` of that name (the free one or else the
    first if None); `angle` of incidence in degrees, (angles,); both rising. `observer` and `illuminant` as in
    `pellicle.colour.sensor`. Other free parameters take their start values.

    **Returns:** `Colour` with XYZ of shape (angles, thicknesses, 3).

    **Raises:** UsageError for ellipsometry and for an unknown layer; ValueError where a material has
    no data between 380 and 730 nm.
    """
    bands, white = integration_bands(BANDS, observer, illuminant), sensor(observer, illuminant).white
    spectra = interference_spectra(scene, bands.wavelength, thickness, angle, layer)
    with jax.enable_x64(True):
        xyz = jnp.asarray(spectra @ bands.weights)
    return Colour(xyz, (float(white[0]), float(white[1]), float(white[2])))


def interference_spectra(
    scene: Scene, wavelength: np.ndarray, thickness: np.ndarray, angle: np.ndarray, layer: str | None = None
) -> np.ndarray:
    """Reflectance or transmittance of a film, (angles, thicknesses, wavelengths), wavelengths in nm.

    The rest as for `interference_colours`.
    """
    if scene.light.kind.ellipsometric:
        raise UsageError("ellipsometry has no colour: chart a recipe with signal R or T")
    with jax.enable_x64(True):
        position = varied_layer(scene, layer)
        varying = _over(with_wavelength(scene, wavelength), thickness, angle, position)
        grid = np.stack(np.meshgrid(thickness, angle), axis=-1).reshape(-1, 2)
        spectra = signals(exact(varying), tabulated(varying), grid, build)
    return spectra.reshape(len(angle), len(thickness), len(wavelength))


def colour_table(
    scene: Scene,
    thickness: tuple[float, float],
    angle: tuple[float, float] = (0.0, 80.0),
    layer: str | None = None,
    *,
    observer: str = "1931",
    illuminant: str = "D65",
    eye: Sensor | None = None,
    tolerance: float = TOLERANCE,
) -> FilmColourTable:
    """Table of a film's colours over thickness and angle, for lookups and for the inverse from colours.

    **Arguments:** `thickness` (nm) and `angle` (degrees) are ranges; `eye` is a sensor in place of `observer`
    and `illuminant`, with whose channels the table then has "XYZ"; `tolerance` is the largest ΔE*ab; the rest
    as for `interference_colours`. The spectrum is integrated in the steps of the sensor, 1 nm.

    **Raises:** as `interference_colours` and `FilmColourTable.from_colours` do.
    """
    if scene.light.kind.ellipsometric:
        raise UsageError("ellipsometry has no colour: use a recipe with signal R or T")
    eye = sensor(observer, illuminant) if eye is None else eye
    position = varied_layer(scene, layer)
    at_eye = with_wavelength(scene, eye.wavelength)
    varying = _over(at_eye, np.array(thickness), np.array(angle), position)
    with jax.enable_x64(True):
        plan, evaluated = exact(varying), tabulated(varying)
        varied: Any = scene.layers[position]
        media = (varied.material, scene.ambient)
        n1, n0 = (float(real(insert(m, start_values(m)).index(REFERENCE))[0]) for m in media)

    def colours(thickness: np.ndarray, cosine: np.ndarray) -> np.ndarray:
        grid = np.stack([thickness, np.rad2deg(np.arccos(cosine))], axis=-1)
        with jax.enable_x64(True):
            return signals(plan, evaluated, grid, build) @ eye.weights

    return FilmColourTable.from_colours(
        colours, thickness, white=eye.white, angle=angle, index=n1 / n0, tolerance=tolerance
    )


def varied_layer(scene: Scene, layer: str | None = None) -> int:
    """Position of the layer whose thickness a chart varies. Raises UsageError for an unknown name."""
    coherent = {i: x for i, x in enumerate(scene.layers) if isinstance(x, Layer)}
    if layer is not None:
        named = [i for i, x in coherent.items() if x.name == layer]
        if not named:
            known = ", ".join(x.name for x in coherent.values() if x.name) or "no layer has a name"
            raise UsageError(f"no layer {layer!r} to vary; known: {known}")
        return named[0]
    free = [i for i, x in coherent.items() if isinstance(x.thickness, Free)]
    candidates = [*free, *coherent]
    if not candidates:
        raise UsageError("there is no coherent layer whose thickness could vary")
    return candidates[0]


def _over(scene: Scene, thickness: np.ndarray, angle: np.ndarray, position: int) -> Scene:
    """The scene with one thickness and the angle free over these values, and all else fixed."""

    def between(values: np.ndarray) -> Free:
        low, high = float(values[0]), float(values[-1])
        return Free(low, high if high > low else low + 1e-9)

    fixed = insert(scene, start_values(scene))
    where: Any = lambda s: (s.layers[position].thickness, s.light)  # noqa: E731
    return eqx.tree_at(where, fixed, (between(thickness), replace(fixed.light, angle=between(angle))))


def simulate_colours(
    scene: Scene,
    sensor: tuple[np.ndarray, np.ndarray] | None = None,
    space: str = "srgb",
    angle: ArrayLike | None = None,
    *,
    gamma: float = 1.0,
    camera: CameraMatrix | None = None,
    noise: float = 0.0,
    seed: int = 0,
    tolerance: float = 0.0,
) -> tuple[Colours, Plan]:
    """Simulate the colours of a film, and return them with the plan of the simulation.

    The spectrum is integrated over the sensor's wavelengths. The instrument's scale is the exposure.

    **Arguments:**

    - `sensor`: wavelengths (N,) in nm and weights (N, 3), as of `pellicle.colour.sensor`; None for the CIE
      observer 1931 under D65 and, in "rgb", linear sRGB.
    - `space`: "srgb", "rgb", "xyz" or "lab"; `gamma` of "rgb", and `camera` with its matrix.
    - `angle` of incidence in degrees, (colours,); None for that of the scene.
    - `noise`: standard deviation of the values, which becomes their σ; `seed` of it.
    - `tolerance`: largest error of the spectrum (see `pellicle.plan`).

    **Raises:** UsageError for ellipsometry and an unknown space; ValueError where a material has no data at a
    wavelength of the sensor.
    """
    if scene.light.kind.ellipsometric:
        raise UsageError("ellipsometry has no colour: use a scene with signal R or T")
    if space not in SPACES:
        raise UsageError(f"`space` must be one of {', '.join(SPACES)}, not {space!r}")
    seen = sensor or (srgb_sensor(observer()) if space == "rgb" else observer())
    nm, weights = (np.asarray(x, float) for x in seen)
    if angle is None:
        angle = getattr(scene.light.angle, "start", scene.light.angle)
    angles = np.atleast_1d(np.asarray(angle, float))
    grid = np.tile(nm, angles.size)
    scene = with_wavelength(scene, grid, np.repeat(angles, nm.size))
    simulated = simulate_signal(scene, grid, tolerance=tolerance)
    matrix = None if camera is None else camera.matrix
    coding = measured_encoding(space, weights.sum(axis=0), gamma, matrix)
    channels = coding.channels(simulated.clean.reshape(angles.size, nm.size) @ weights)
    values = coding.encode(channels, coding.roots(channels))
    values = values + noise * np.random.default_rng(seed).normal(0.0, 1.0, values.shape)
    if coding.clips:
        values = np.clip(values, 0.0, 1.0)
    light, sigma = scene.light, np.full(values.shape, noise) if noise > 0 else None
    described = {"angle": angles, "polarisation": light.polarisation, "gamma": gamma, "camera": camera}
    return Colours(values, (nm, weights), space, light.signal, sigma=sigma, **described), simulated.plan
