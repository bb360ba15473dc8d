"""Simulated spectra of films, the signal of a scene with noise; their colours against thickness and angle."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import ArrayLike

from pellicle.colour import integration_bands, sensor
from pellicle.colour.film import Colour
from pellicle.colour.observers import Sensor, srgb_sensor
from pellicle.colour.observers import sensor as observer
from pellicle.colour.spaces import measured_encoding
from pellicle.colour.table import REFERENCE, TOLERANCE, FilmColourTable
from pellicle.data.colours import CameraMatrix, Colours
from pellicle.data.options import SPACES
from pellicle.data.spectrum import Spectrum
from pellicle.effects.differences import signals
from pellicle.effects.film_plan import exact, plan
from pellicle.errors import UsageError
from pellicle.forward_model.film_signal import build, depolarises, tabulated
from pellicle.forward_model.plan import Plan
from pellicle.optics.pair import real
from pellicle.scene.film import Scene, with_wavelength
from pellicle.scene.free import Free, insert, is_free, start_values
from pellicle.scene.instrument import Drift
from pellicle.scene.layers import Layer
from pellicle.signals.base import Signal
from pellicle.signals.registry import KINDS, of_parts

VISIBLE = (380.0, 780.0, 2.0)
"""Default wavelengths: start, stop and step in nm."""


class SimulatedSignal(NamedTuple):
    """A simulated signal with and without noise, and its plan: (wavelengths,), or (wavelengths, quantities of
    the kind of signal), such as Ψ and Δ.

    `depolarisation` (wavelengths,) is a fraction with noise of the standard deviation `depolarisation_noise`;
    None where nothing in the scene depolarises, and for other signals than Ψ and Δ.
    """

    wavelength: np.ndarray
    values: np.ndarray
    clean: np.ndarray
    plan: Plan
    depolarisation: np.ndarray | None = None
    depolarisation_noise: float = 0.0


def simulate_spectrum(
    scene: Scene,
    wavelength: ArrayLike | None = None,
    *,
    noise: float = 0.0,
    seed: int = 0,
    depolarisation_noise: float | None = None,
    elements: Sequence[str] | None = None,
) -> Spectrum:
    """Simulate a spectrum of a film, as `pellicle.simulate` does.

    **Arguments:** `wavelength` in nm (`default_wavelengths` if None); `noise` the standard deviation of the
    normal noise, in the unit of the signal, which becomes the σ of the spectrum; `seed` of the noise;
    `depolarisation_noise` that of the depolarisation, a fraction, None for `usual_depolarisation_noise`;
    `elements` of a Mueller matrix, all 15 if None, or ratios of generalised Ψ and Δ, all 3 if None.

    **Raises:** ValueError where a material has no data at a wavelength; UsageError for a depolarisation
    or elements of another signal.
    """
    nm = default_wavelengths(scene) if wavelength is None else np.asarray(wavelength, dtype=float)
    light, kind = scene.light, scene.light.kind
    if depolarisation_noise is not None and "depolarisation" not in kind.keywords:
        [word] = [word for word, x in KINDS.items() if "depolarisation" in x.keywords]
        raise UsageError(f'`depolarisation_noise` goes with `signal="{word}"`: leave it out')
    kind = kind if elements is None else of_parts(elements, light.signal)
    for name, given in (("angle", light.angle), ("azimuth", light.azimuth)):
        if np.ndim(given) and np.shape(given) != nm.shape:
            raise UsageError(
                f"`{name}` has {np.size(given)} numbers and there are {nm.size} wavelengths: give one number,"
                " or one for each wavelength"
            )
    simulated = simulate_signal(scene, nm, noise, seed, 0.0, depolarisation_noise, kind)
    share, share_noise = simulated.depolarisation, simulated.depolarisation_noise
    share_sigma = np.full(nm.shape, share_noise) if share is not None and share_noise > 0 else None
    arrays = kind.arrays(simulated.values.reshape(nm.size, -1))
    words: dict[str, Any] = kind.words
    return Spectrum(
        nm,
        signal=light.signal,
        polarisation="unpolarised" if kind.ellipsometric else light.polarisation,
        angle=np.broadcast_to(getattr(light.angle, "start", light.angle), nm.shape),
        azimuth=None if light.azimuth is None else np.broadcast_to(light.azimuth, nm.shape),
        folded=False,
        depolarisation=share,
        depolarisation_sigma=share_sigma,
        transmission=light.transmission,
        **arrays,
        **(kind.errors(arrays["values"], noise) if noise > 0 else {}),
        **words,
    )


def simulate_signal(
    scene: Scene,
    wavelength: ArrayLike,
    noise: float = 0.0,
    seed: int = 0,
    tolerance: float = 0.0,
    depolarisation_noise: float | None = None,
    kind: Signal | None = None,
) -> SimulatedSignal:
    """Simulate the signal of a film at `wavelength` (nm) with normal noise of standard deviation `noise`.

    Free parameters take their start values; a free scale is 1 and a free offset 0. Effects that change
    the signal by less than the `tolerance` are left out (see `pellicle.plan`). The columns are the quantities
    of the `kind`, by default all of that of the light. The noise of generalised Ψ and Δ is `noise` in Ψ and
    the same across it (`signals.generalised.delta_sigma`). The depolarisation comes
    with Ψ and Δ where the scene depolarises or a `depolarisation_noise` is given, None for the usual one.

    **Raises:** ValueError where a material has no data at a wavelength.
    """
    wavelength = np.asarray(wavelength, dtype=float)
    with jax.enable_x64(True):
        fixed = with_wavelength(insert(scene, start_values(scene)), wavelength)
        stated: Any = (fixed.instrument.scale, 1.0), (fixed.instrument.offset, 0.0)
        scale, offset = (usual if isinstance(x, Drift) else x for x, usual in stated)
        instrument = replace(fixed.instrument, scale=scale, offset=offset)
        fixed = eqx.tree_at(lambda s: s.instrument, fixed, instrument)
        chosen = plan(fixed, tolerance)
        signal = np.asarray(jax.jit(build(chosen))(tabulated(fixed, chosen.on("coherence"))))
    rows = (float(scale) * signal + float(offset)).reshape(len(wavelength), -1)
    kind, share, share_noise = kind or scene.light.kind, None, 0.0
    values, clean = kind.synthetic(rows, noise, seed)
    given = depolarisation_noise
    if "depolarisation" in kind.keywords and (depolarises(chosen) or given is not None):
        share_noise = usual_depolarisation_noise(noise) if given is None else given
        scatter = np.random.default_rng((seed, 1)).normal(0.0, 1.0, wavelength.shape)
        share = 1 - np.sum(rows**2, axis=1) + share_noise * scatter
    return SimulatedSignal(wavelength, values, clean, chosen, share, share_noise)


def usual_depolarisation_noise(noise: float) -> float:
    """Return the noise of a depolarisation 1 − N² − C² − S² where that of Ψ is `noise` in degrees.

    N = cos 2Ψ has up to 2 · noise in radians, and so have C and S; the squared length of (N, C, S), which is
    near 1, has twice as much.
    """
    return 4 * math.radians(noise)


def default_wavelengths(scene: Scene) -> np.ndarray:
    """380 to 780 nm every 2 nm, within the data of every material."""
    start, stop, step = VISIBLE
    has_range = lambda x: hasattr(x, "wavelength_range")  # noqa: E731
    leaves = jax.tree_util.tree_leaves(scene, is_leaf=lambda x: has_range(x) or is_free(x))
    low, high = start, stop
    for material in filter(has_range, leaves):
        first, last = material.wavelength_range
        low, high = max(low, first), min(high, last)
    grid = np.arange(start, stop + step / 2, step)
    return grid[(grid >= low) & (grid <= high)]


BANDS = "uniform-64"
"""Integration over the spectrum: colours within ΔE2000 = 0.02 of steps of 1 nm, for films up to 5 µm."""


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
