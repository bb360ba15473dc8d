"""Targets of a fit of spectra: values, σ and the scene that is to explain them."""

from __future__ import annotations

from typing import Any, NamedTuple

import equinox as eqx
import numpy as np

from pellicle.data.spectrum import Spectrum
from pellicle.errors import DataError, UsageError
from pellicle.fitting import noise
from pellicle.fitting.problem import Noise
from pellicle.scene.film import Light, Scene
from pellicle.scene.free import free_leaves, is_free
from pellicle.scene.instrument import Drift, Instrument


class Measured(NamedTuple):
    """Values of one spectrum, and the scene that is to explain them.

    `values` are fractions (points,), or N, C, S (points, 3) for ellipsometry, which have no wrap-around,
    or N and C alone (points, 2) where Δ is folded;
    `wavelength` (nm) is (points,), `sigma` too or the shape of `values`; `independent_fraction` is
    how many independent points each counts for. With a `frame` (points, 3, 3) the values are those of
    N, C, S in it.
    """

    scene: Scene
    wavelength: np.ndarray
    values: np.ndarray
    sigma: np.ndarray
    independent_fraction: float = 1.0
    noise: Noise = Noise()
    name: str = ""  # that of one among several
    frame: np.ndarray | None = None


def measured(data: Spectrum, scene: Scene, name: str = "") -> Measured:
    """A spectrum in numbers, with the scene in its light. Raises UsageError as `fit` does."""
    scene = seen_as(scene, data)
    _check(data, scene)
    source = Noise(data.sigma is not None, data.sigma is None and drifts(scene))
    independent_fraction = 1 / noise.DRIFT_CORRELATION if source.drifting else 1.0
    values, sigma, frame = _values(data), _sigma(data, source), None
    if data.delta is not None and data.sigma is not None and not data.folded:
        frame = _frame(data)
        values = np.einsum("pij,pj->pi", frame, values)
    return Measured(scene, data.wavelength, values, sigma, independent_fraction, source, name, frame)


def seen_as(scene: Scene, data: Spectrum) -> Scene:
    """The scene in the light of the spectrum: its signal, wavelengths, polarisation and angles."""
    angle: Any = scene.light.angle
    if data.angle is not None and is_free(angle):
        if np.ptp(data.angle) > 0:
            raise UsageError(
                f"{data.path}: has several angles of incidence, and one free angle cannot stand for them"
            )
    elif data.angle is not None:
        angle = float(data.angle[0]) if np.ptp(data.angle) == 0 else data.angle
    stated = data.polarisation != "unpolarised"
    polarisation = data.polarisation if stated else scene.light.polarisation
    return eqx.tree_at(lambda s: s.light, scene, Light(data.wavelength, angle, data.signal, polarisation))


def without_scale(scene: Scene, data: Spectrum) -> Scene:
    """A scene that several spectra share, for one of them: Ψ and Δ have neither scale nor offset."""
    if data.delta is None:
        return scene
    kept = {name: value for name, value in vars(scene.instrument).items() if name not in ("scale", "offset")}
    return eqx.tree_at(lambda s: s.instrument, scene, Instrument(**kept))


def drifts(scene: Scene) -> bool:
    """True where the scale varies along the spectrum."""
    return isinstance(scene.instrument.scale, Drift) and scene.instrument.scale.degree > 0


def _check(data: Spectrum, scene: Scene) -> None:
    if data.delta is None and len(data) < 2:
        raise DataError(f"{data.path}: holds one point of {data.signal}; a fit needs a spectrum")
    drifting = [x for x in (scene.instrument.scale, scene.instrument.offset) if isinstance(x, Drift)]
    if data.delta is None and not data.calibrated and scene.instrument.scale not in drifting:
        raise UsageError(
            f'{data.path}: an uncalibrated intensity needs a free scale: `scale="slow"` or `scale="free"`'
        )
    if data.delta is None:
        return
    if drifting or scene.instrument.scale != 1.0 or scene.instrument.offset != 0.0:
        raise UsageError(f"{data.path}: Ψ and Δ have no scale and no offset: leave both out")
    if data.angle is None and not free_leaves(scene.light) and not np.any(scene.light.angle):
        raise UsageError(
            f"{data.path}: ellipsometry needs its angle of incidence: give `angle=70`, for instance, "
            "angle = 70 under [data] in a recipe, or a column angle_deg"
        )


def _values(data: Spectrum) -> np.ndarray:
    if data.delta is None:
        return data.values
    psi, delta = 2 * np.deg2rad(data.values), np.deg2rad(data.delta)
    sphere = np.stack([np.cos(psi), np.sin(psi) * np.cos(delta), np.sin(psi) * np.sin(delta)], -1)
    return sphere[:, :2] if data.folded else sphere


def _frame(data: Spectrum) -> np.ndarray:
    """At each measured point of the sphere of N, C, S: along Ψ, along Δ, and outwards, (points, 3, 3).

    There the measured point is (0, 0, 1), and errors of Ψ and of Δ are errors of one component each.
    """
    psi, delta = 2 * np.deg2rad(data.values), np.deg2rad(np.asarray(data.delta))
    sine, cosine, zero = np.sin(psi), np.cos(psi), np.zeros_like(psi)
    along = [-sine, cosine * np.cos(delta), cosine * np.sin(delta)]
    across = [zero, -np.sin(delta), np.cos(delta)]
    outwards = [cosine, sine * np.cos(delta), sine * np.sin(delta)]
    return np.moveaxis(np.array([along, across, outwards]), 2, 0)


def _sigma(data: Spectrum, source: Noise) -> np.ndarray:
    """σ of each point: given, the model's own error, or a guess that the residuals will replace."""
    if data.sigma is not None and data.delta is not None:
        given = data.sigma if data.delta_sigma is None else data.delta_sigma
        psi, delta, psi_sigma, delta_sigma = np.deg2rad([data.values, data.delta, data.sigma, given])
        if not data.folded:
            return _sigma_in_frame(psi, psi_sigma, delta_sigma)
        return _sigma_folded(psi, delta, psi_sigma, delta_sigma)
    if data.sigma is not None:
        return data.sigma
    if data.delta is not None:
        return np.full(len(data), 0.01)
    if source.drifting:
        return noise.drifting_sigma(data.values)
    guess = max(0.01 * float(np.ptp(data.values)), float(np.median(noise.local_noise(data.values))), 1e-12)
    return np.full(len(data), guess)


def _sigma_in_frame(psi: np.ndarray, psi_sigma: np.ndarray, delta_sigma: np.ndarray) -> np.ndarray:
    """Along Ψ, along Δ and outwards, (points, 3), all in radians.

    An error of Ψ moves a point of the sphere by 2σ_Ψ along its meridian, one of Δ by sin(2Ψ) σ_Δ across it,
    of which Ψ's own error leaves something at the poles. Outwards there is no first order: the mean serves.
    """
    along = 2 * psi_sigma
    across = np.hypot(np.sin(2 * psi), along) * delta_sigma
    return np.stack([along, across, np.sqrt(0.5 * (along**2 + across**2))], axis=1)


def _sigma_folded(
    psi: np.ndarray, delta: np.ndarray, psi_sigma: np.ndarray, delta_sigma: np.ndarray
) -> np.ndarray:
    """Where only N and C are visible: the mean square of what errors of Ψ and of Δ move, all in radians.

    An error of Δ at 0 or 180° moves neither to first order; the second order of σ_Ψ keeps σ above zero.
    """
    along, across = 2 * psi_sigma, np.sin(2 * psi) * delta_sigma
    visible = np.sin(2 * psi) ** 2 + (np.cos(2 * psi) * np.cos(delta)) ** 2
    return np.sqrt(0.5 * (visible * along**2 + (across * np.sin(delta)) ** 2 + along**4))
