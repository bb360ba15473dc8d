"""Spectra and colours of a sample, their targets and scenes, as a least-squares problem."""

from dataclasses import replace
from typing import Any, NamedTuple, TypeAlias

import equinox as eqx
import numpy as np

from pellicle.data.colours import Colours
from pellicle.data.spectrum import Spectrum
from pellicle.effects.differences import largest_index
from pellicle.effects.film_plan import exact, plan
from pellicle.errors import UsageError
from pellicle.fitting import noise
from pellicle.fitting.coordinates import box
from pellicle.fitting.film.colour_measurements import MeasuredColours, colours_view
from pellicle.fitting.film.nuisance import Data
from pellicle.fitting.film.parameters import anonymous, bounds, shared
from pellicle.fitting.film.sweeps import sweeps_of
from pellicle.fitting.film.view import ROUND, SpectrumView
from pellicle.fitting.problem import Noise, Problem
from pellicle.forward_model.film_signal import depolarises, tabulated
from pellicle.forward_model.plan import Plan
from pellicle.scene.film import Light, Scene, coherent_layers, with_wavelength
from pellicle.scene.free import constant, free_leaves, is_free, remembered
from pellicle.scene.instrument import ONE_NUMBER, Drift, Instrument
from pellicle.signals.base import Signal


class Measured(NamedTuple):
    """Values of one spectrum, and the scene that is to explain them.

    `values` (points,) or (points, channels) are those of `Signal.channels`; `wavelength` (nm) is (points,),
    `sigma` too or the shape of `values`; `independent_fraction` is how many independent points each counts
    for. With a `frame` (points, channels, channels) the values are components in it.
    """

    scene: Scene
    wavelength: np.ndarray
    values: np.ndarray
    sigma: np.ndarray
    signal: Signal
    independent_fraction: float = 1.0
    noise: Noise = Noise()
    name: str = ""  # that of one among several
    frame: np.ndarray | None = None


Target: TypeAlias = Measured | MeasuredColours
"""Data that a scene explains in a fit: a spectrum or colours."""


def measured(data: Spectrum, scene: Scene, name: str = "") -> Measured:
    """A spectrum in numbers, with the scene in its light. Raises UsageError as `fit` does."""
    if data.signal == "T" and scene.light.signal != "T" and scene.substrate.back_collected == 0.0:
        raise UsageError(
            f"{data.path}: is a transmittance, and no light from the back face is collected: that through a"
            ' rough or taped back is not simulated; for a clear back give `signal="T"`, or leave out'
            " `back_collected`"
        )
    scene = seen_as(scene, data)
    _check(data, scene)
    if data.sigma is not None:
        data = replace(data, sigma=np.hypot(data.sigma, noise.rounding(data.values)))
    source = Noise(data.sigma is not None, data.sigma is None and drifts(scene))
    independent_fraction = 1 / noise.DRIFT_CORRELATION if source.drifting else 1.0
    signal = data.kind.seen_in(scene, _depolarised(scene))
    values, sigma, frame = signal.channels(data, _guess(data, source))
    known = values, sigma, signal, independent_fraction, source, name, frame
    return Measured(scene, data.wavelength, *known)


@remembered
def _depolarised(scene: Scene) -> bool:
    return depolarises(exact(scene))


def seen_as(scene: Scene, data: Spectrum) -> Scene:
    """The scene in the light of the spectrum: its signal, wavelengths, polarisation, angles and azimuths."""
    angle: Any = scene.light.angle
    if data.angle is None and np.ndim(angle) and np.size(angle) != len(data):
        raise UsageError(
            f"{data.path}: has no column of angles of incidence, and the scene has several: give `angle=70`,"
            " for instance, or add a column angle_deg"
        )
    if data.angle is not None and is_free(angle):
        if np.ptp(data.angle) > 0:
            raise UsageError(
                f"{data.path}: has several angles of incidence, and one free angle cannot stand for them"
            )
    elif data.angle is not None:
        if np.ndim(angle) == 0 and angle and not np.isclose(data.angle, angle, atol=1e-3).any():
            own = " to ".join(f"{end:g}" for end in np.unique([data.angle.min(), data.angle.max()]))
            raise UsageError(
                f"{data.path}: has its own angles of incidence, {own} degrees, which contradicts "
                f"`angle={float(angle):g}`; leave that out"
            )
        angle = float(data.angle[0]) if np.ptp(data.angle) == 0 else data.angle
    stated = data.polarisation != "unpolarised"
    polarisation = data.polarisation if stated else scene.light.polarisation
    transmission = data.transmission or (data.signal == scene.light.signal and scene.light.transmission)
    return _lit(scene, data.wavelength, angle, data.signal, polarisation, _azimuth(scene, data), transmission)


@remembered
def _lit(scene: Scene, *light: Any) -> Scene:
    """The scene in the light of these fields."""
    return eqx.tree_at(lambda s: s.light, scene, Light(*light))


def _azimuth(scene: Scene, data: Spectrum) -> Any:
    """The azimuth of the sample, one or one for each point; None where it is 0."""
    stated: Any = scene.light.azimuth
    if data.azimuth is None and np.ndim(stated):
        raise UsageError(
            f"{data.path}: has no column of azimuths, and the scene has several: give `azimuth=45`, for"
            " instance, or add a column azimuth_deg"
        )
    if data.azimuth is None:
        return stated if np.any(stated) else None
    if np.ndim(stated) == 0 and stated and not np.isclose(data.azimuth, stated, atol=1e-3).any():
        own = " to ".join(f"{end:g}" for end in np.unique([data.azimuth.min(), data.azimuth.max()]))
        raise UsageError(
            f"{data.path}: has its own azimuths of the sample, {own} degrees, which contradicts "
            f"`azimuth={float(stated):g}`; leave that out"
        )
    if not np.any(data.azimuth):
        return None
    return float(data.azimuth[0]) if np.ptp(data.azimuth) == 0 else data.azimuth


def without_scale(scene: Scene, data: Spectrum | Colours) -> Scene:
    """A scene that several data share, for one of them: ellipsometry has neither scale nor offset, and of a
    scale that drifts colours have one number."""
    if isinstance(data, Colours):
        kept = {name: value for name, value in vars(scene.instrument).items() if name != "offset"}
        if isinstance(scene.instrument.scale, Drift):
            kept["scale"] = ONE_NUMBER
        return eqx.tree_at(lambda s: s.instrument, scene, Instrument(**kept))
    if data.kind.has_scale:
        return scene
    kept = {name: value for name, value in vars(scene.instrument).items() if name not in ("scale", "offset")}
    return eqx.tree_at(lambda s: s.instrument, scene, Instrument(**kept))


def drifts(scene: Scene) -> bool:
    """True where the scale varies along the spectrum."""
    return isinstance(scene.instrument.scale, Drift) and scene.instrument.scale.degree > 0


def _check(data: Spectrum, scene: Scene) -> None:
    drifting = [x for x in (scene.instrument.scale, scene.instrument.offset) if isinstance(x, Drift)]
    if data.kind.has_scale and not data.calibrated and scene.instrument.scale not in drifting:
        raise UsageError(
            f'{data.path}: an uncalibrated intensity needs a free scale: `scale="slow"` or `scale="free"`'
        )
    name = "ellipsometry" if data.ellipsometric else f"a {data.signal}"
    if not data.kind.has_scale and (
        drifting or scene.instrument.scale != 1.0 or scene.instrument.offset != 0.0
    ):
        raise UsageError(f"{data.path}: {name} has no scale and no offset: leave both out")
    if (
        data.ellipsometric
        and data.angle is None
        and not free_leaves(scene.light)
        and not np.any(scene.light.angle)
    ):
        raise UsageError(
            f"{data.path}: ellipsometry needs its angle of incidence: give `angle=70`, for instance, "
            "angle = 70 under [data] in a recipe, or a column angle_deg"
        )


def _guess(data: Spectrum, source: Noise) -> np.ndarray | None:
    """σ of each point where the data have none: the model's own error, or one for residuals to replace."""
    if data.sigma is not None or data.ellipsometric:
        return None
    if source.drifting:
        return noise.drifting_sigma(data.values)
    guess = max(0.01 * np.ptp(data.values), np.median(noise.local_noise(data.values)), 1e-12)
    return np.full(len(data), float(guess))


_KEPT_EFFECTS = ("precision", "dispersion")
"""Effects that a tolerance does not remove: a fit stops by differences below single precision, and its media
are evaluated once in any case."""


def shortest_wavelength(problem: Problem) -> float:
    """The shortest wavelength (nm) inside a layer that any spectrum and the bounds allow."""
    return min(v.scene.light.wavelength.min() / v.largest_index for v in problem.views)


class Structure(NamedTuple):
    """Structure of a view that scene and grid alone determine: the same for every spectrum.

    `scene` has padded wavelengths, sampled media and anonymous parameters; `largest_index` is that of its
    coherent layers over the bounds, times the repeats of a layer in a group, which share its thickness.
    """

    plan: Plan
    scene: Scene
    largest_index: float
    sweeps: list[np.ndarray]


@remembered
def structure(scene: Scene, tolerance: float) -> Structure:
    """The structure of a spectrum that `scene` explains, at the wavelengths of its light."""
    light = scene.light
    parts = sweeps_of(light, len(light.wavelength))
    extra = -len(light.wavelength) % ROUND
    wavelength = _pad(light.wavelength, extra)
    turns = (_pad(x, extra) if np.ndim(x) else x for x in (light.angle, light.azimuth))
    scene = with_wavelength(scene, wavelength, *turns)
    chosen = plan(scene, tolerance, _KEPT_EFFECTS)
    scene = tabulated(scene, chosen.on("coherence") or scene.instrument.wavelength_shift is not None)
    steepest = max(
        (x.repeats * largest_index(x.material, wavelength) for x in coherent_layers(scene)), default=1.0
    )
    return Structure(chosen, constant(anonymous(scene)), steepest, parts)


def make(*spectra: Target, tolerance: float = 0.0) -> Problem:
    """The problem of explaining these spectra and colours of one sample.

    The models may be off by up to `tolerance`. Raises ValueError where a material has no data at a
    wavelength.
    """
    free, positions = shared(tuple(m.name for m in spectra), *(m.scene for m in spectra))
    views = tuple(
        colours_view(spectrum, takes, tolerance, _KEPT_EFFECTS)
        if isinstance(spectrum, MeasuredColours)
        else _view(spectrum, takes, tolerance)
        for spectrum, takes in zip(spectra, positions, strict=True)
    )
    return Problem(views, free, box(*bounds(free), [p.prior for p in free]))


def _view(spectrum: Measured, takes: tuple[int, ...], tolerance: float) -> SpectrumView:
    chosen, scene, steepest, parts = structure(spectrum.scene, tolerance)
    points, wavelength = len(spectrum.wavelength), scene.light.wavelength
    channels, extra = spectrum.values.size // points, len(wavelength) - points
    values = _pad(spectrum.values, extra)
    span = max(wavelength.max() - wavelength.min(), 1e-9)  # one wavelength at many angles has none
    sigma = np.reshape(spectrum.sigma, (-1, 1)) if np.ndim(spectrum.sigma) < 2 else spectrum.sigma
    weight = np.concatenate([1 / np.broadcast_to(sigma, (points, channels)), np.zeros((extra, channels))])
    data = Data(
        values=values.reshape(-1),
        weight=weight.reshape(-1),
        position=np.repeat(2 * (wavelength - wavelength.min()) / span - 1, channels),
        independent_fraction=np.float64(spectrum.independent_fraction),
        level=np.float64(max(float(np.median(np.abs(spectrum.values))), 1e-12)),
        frame=None if spectrum.frame is None else _pad(spectrum.frame, extra),
    )
    return SpectrumView(
        spectrum.name,
        chosen,
        scene,
        data,
        takes,
        spectrum.noise,
        points * channels,
        channels,
        steepest,
        spectrum.signal,
        parts,
    )


def _pad(x: np.ndarray, extra: int) -> np.ndarray:
    return np.concatenate([x, np.repeat(x[-1:], extra, axis=0)])
