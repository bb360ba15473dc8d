"""Targets of a fit of spectra: values, σ and the scene that is to explain them."""

from __future__ import annotations

from typing import Any, NamedTuple, TypeAlias

import equinox as eqx
import numpy as np

from pellicle.data.colours import Colours
from pellicle.data.ellipsometry_angles import ncs
from pellicle.data.generalised import RATIOS
from pellicle.data.mueller import ELEMENTS
from pellicle.data.spectrum import Spectrum
from pellicle.effects.film_plan import exact
from pellicle.errors import DataError, UsageError
from pellicle.fitting import noise
from pellicle.fitting.film import generalised
from pellicle.fitting.film.colour_targets import MeasuredColours
from pellicle.fitting.problem import Noise
from pellicle.forward_model.film_signal import depolarises
from pellicle.scene.film import Light, Scene
from pellicle.scene.free import free_leaves, is_free
from pellicle.scene.instrument import ONE_NUMBER, Drift, Instrument

ROUGH = 0.01
"""First guess of the noise of N, C, S, of a depolarisation and of Mueller elements."""


class Measured(NamedTuple):
    """Values of one spectrum, and the scene that is to explain them.

    `values` are fractions (points,), or N, C, S (points, 3) for ellipsometry, which have no wrap-around, or N
    and C alone (points, 2) where Δ is folded; `wavelength` (nm) is (points,), `sigma` too or the shape of
    `values`; `independent_fraction` is how many independent points each counts for. Where some light is
    unpolarised and its depolarisation was measured, that follows N, C, S (or N, C), and `depolarisation` is
    its noise. With a `frame` (points, channels, channels) the values are those of N, C, S and depolarisation
    in it. Of a Mueller matrix the values are (points, elements), and `elements` their positions among m12,
    m13, ..., m44. Of generalised Ψ and Δ they are the channels of `fitting.film.generalised`, and `ratios`
    the positions of the ratios.
    """

    scene: Scene
    wavelength: np.ndarray
    values: np.ndarray
    sigma: np.ndarray
    independent_fraction: float = 1.0
    noise: Noise = Noise()
    name: str = ""  # that of one among several
    frame: np.ndarray | None = None
    depolarisation: Noise | None = None
    elements: tuple[int, ...] = ()
    ratios: tuple[int, ...] = ()


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
    source = Noise(data.sigma is not None, data.sigma is None and drifts(scene))
    independent_fraction = 1 / noise.DRIFT_CORRELATION if source.drifting else 1.0
    values, sigma, frame = data.values, _sigma(data, source), None
    depolarisation = None
    if data.ratios:
        frames, spread = ratio_directions(data)
        outwards = np.broadcast_to([0.0, 0.0, 1.0], spread.shape)
        values, sigma = generalised.in_directions(outwards), generalised.in_directions(spread)
        frame = generalised.block_frame(frames)
        known = scene, data.wavelength, values, sigma, independent_fraction, source, name, frame
        return Measured(*known, ratios=tuple(RATIOS.index(ratio) for ratio in data.ratios))
    if data.delta is not None:
        values = ncs(data.values, data.delta)[:, : 2 if data.folded else 3]
    if data.depolarisation is not None and depolarises(exact(scene)):
        depolarisation = Noise(data.depolarisation_sigma is not None)
    if data.delta is not None and data.sigma is not None and not data.folded:
        frame = sphere_frame(data.values, data.delta)
        values = np.einsum("pij,pj->pi", frame, values)
    if depolarisation is not None and data.depolarisation is not None:
        # the last of what is measured: before the direction outwards
        at = values.shape[1] if frame is None else values.shape[1] - 1
        own = ROUGH if data.depolarisation_sigma is None else data.depolarisation_sigma
        sigma = np.broadcast_to(np.reshape(sigma, (len(data), -1)), values.shape)
        values = np.insert(values, at, data.depolarisation, axis=1)
        sigma = np.insert(sigma, at, own, axis=1)
        if frame is not None:
            frame = np.insert(np.insert(frame, at, 0.0, axis=1), 3, 0.0, axis=2)
            frame[:, at, 3] = 1.0
    known = scene, data.wavelength, values, sigma, independent_fraction, source, name, frame
    return Measured(*known, depolarisation, tuple(ELEMENTS.index(name) for name in data.elements))


def ratio_directions(data: Spectrum) -> tuple[np.ndarray, np.ndarray]:
    """Directions of each ratio of generalised Ψ and Δ, (points, ratios, 3, 3), and σ of N, C, S in them,
    (points, ratios, 3): see `generalised.upright`."""
    assert data.delta is not None
    sigma = np.full((*data.values.shape, 3), ROUGH)
    if data.sigma is not None and data.delta_sigma is not None:
        sigma = sphere_sigma(data.values, data.delta, data.sigma, data.delta_sigma)
    return generalised.upright(sphere_frame(data.values, data.delta), sigma, data.values, data.delta)


def sphere_frame(psi: np.ndarray, delta: np.ndarray) -> np.ndarray:
    """Directions of N, C, S along Ψ, along Δ and outwards, (..., 3, 3), at Ψ and Δ in degrees (...).

    In them the measured point is (0, 0, 1), and errors of Ψ and of Δ are errors of one component each.
    """
    outwards = ncs(psi, delta)
    psi, delta = 2 * np.deg2rad(psi), np.deg2rad(delta)
    zero = np.zeros_like(psi)
    along = np.stack([-np.sin(psi), np.cos(psi) * np.cos(delta), np.cos(psi) * np.sin(delta)], axis=-1)
    across = np.stack([zero, -np.sin(delta), np.cos(delta)], axis=-1)
    return np.stack([along, across, outwards], axis=-2)


def sphere_sigma(
    psi: np.ndarray, delta: np.ndarray, psi_sigma: np.ndarray, delta_sigma: np.ndarray, folded: bool = False
) -> np.ndarray:
    """σ of N, C, S in their `sphere_frame`, (..., 3), of Ψ and Δ and their σ in degrees (...).

    On the sphere of N, C, S an error of Ψ moves a point by 2σ_Ψ along its meridian, one of Δ by sin(2Ψ) σ_Δ
    across it, of which Ψ's own error leaves something at the poles. Outwards there is no first order: the
    mean serves. A folded Δ leaves N and C, which share one σ (...): the mean square of what both errors move.
    An error of Δ at 0 or 180° moves neither to first order; the second order of σ_Ψ keeps σ above zero.
    """
    psi, delta, psi_sigma, delta_sigma = (np.deg2rad(x) for x in (psi, delta, psi_sigma, delta_sigma))
    along, sine = 2 * psi_sigma, np.sin(2 * psi)
    if folded:
        visible = sine**2 + (np.cos(2 * psi) * np.cos(delta)) ** 2
        return np.sqrt(0.5 * (visible * along**2 + (sine * delta_sigma * np.sin(delta)) ** 2 + along**4))
    across = np.hypot(sine, along) * delta_sigma
    return np.stack([along, across, np.sqrt(0.5 * (along**2 + across**2))], axis=-1)


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
    light = Light(data.wavelength, angle, data.signal, polarisation, _azimuth(scene, data))
    return eqx.tree_at(lambda s: s.light, scene, light)


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
    if not data.ellipsometric:
        return scene
    kept = {name: value for name, value in vars(scene.instrument).items() if name not in ("scale", "offset")}
    return eqx.tree_at(lambda s: s.instrument, scene, Instrument(**kept))


def drifts(scene: Scene) -> bool:
    """True where the scale varies along the spectrum."""
    return isinstance(scene.instrument.scale, Drift) and scene.instrument.scale.degree > 0


def _check(data: Spectrum, scene: Scene) -> None:
    if not data.ellipsometric and len(data) < 2:
        raise DataError(f"{data.path}: holds one point of {data.signal}; a fit needs a spectrum")
    drifting = [x for x in (scene.instrument.scale, scene.instrument.offset) if isinstance(x, Drift)]
    if not data.ellipsometric and not data.calibrated and scene.instrument.scale not in drifting:
        raise UsageError(
            f'{data.path}: an uncalibrated intensity needs a free scale: `scale="slow"` or `scale="free"`'
        )
    if not data.ellipsometric:
        return
    if drifting or scene.instrument.scale != 1.0 or scene.instrument.offset != 0.0:
        raise UsageError(f"{data.path}: ellipsometry has no scale and no offset: leave both out")
    if data.angle is None and not free_leaves(scene.light) and not np.any(scene.light.angle):
        raise UsageError(
            f"{data.path}: ellipsometry needs its angle of incidence: give `angle=70`, for instance, "
            "angle = 70 under [data] in a recipe, or a column angle_deg"
        )


def _sigma(data: Spectrum, source: Noise) -> np.ndarray:
    """σ of each point: the data's, the model's own error, or a guess that the residuals will replace."""
    if data.sigma is None and data.ellipsometric:
        return np.full(len(data), ROUGH)
    if data.sigma is None and source.drifting:
        return noise.drifting_sigma(data.values)
    if data.sigma is None:
        guess = max(0.01 * np.ptp(data.values), np.median(noise.local_noise(data.values)), 1e-12)
        return np.full(len(data), float(guess))
    if data.delta is None:
        return data.sigma
    delta_sigma = data.sigma if data.delta_sigma is None else data.delta_sigma
    return sphere_sigma(data.values, data.delta, data.sigma, delta_sigma, bool(data.folded))
