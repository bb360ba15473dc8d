"""Simulated spectra of films: the signal of a scene with noise."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import equinox as eqx
import jax
import numpy as np
from numpy.typing import ArrayLike

from pellicle.data import generalised, mueller
from pellicle.data.spectrum import Spectrum
from pellicle.effects.film_plan import plan
from pellicle.errors import UsageError
from pellicle.forward_model.film_signal import build, depolarises, tabulated
from pellicle.forward_model.plan import Plan
from pellicle.optics.ellipsometry import psi_delta
from pellicle.scene.film import Scene, with_wavelength
from pellicle.scene.free import insert, is_free, start_values
from pellicle.scene.instrument import Drift

VISIBLE = (380.0, 780.0, 2.0)
"""Default wavelengths: start, stop and step in nm."""


class SimulatedSignal(NamedTuple):
    """A simulated signal with and without noise, and its plan: (wavelengths,), Ψ and Δ (wavelengths, 2), Ψ
    and Δ of each ratio of `data.generalised` (wavelengths, 6), or Mueller elements m12 to m44
    (wavelengths, 15).

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
    light, ellipsometric = scene.light, scene.light.signal == "psi-delta"
    if depolarisation_noise is not None and not ellipsometric:
        raise UsageError('`depolarisation_noise` goes with `signal="psi-delta"`: leave it out')
    if elements is not None and light.signal not in (mueller.SIGNAL, generalised.SIGNAL):
        raise UsageError('`elements` go with `signal="mueller"`: leave them out')
    for name, given in (("angle", light.angle), ("azimuth", light.azimuth)):
        if np.ndim(given) and np.shape(given) != nm.shape:
            raise UsageError(
                f"`{name}` has {np.size(given)} numbers and there are {nm.size} wavelengths: give one number,"
                " or one for each wavelength"
            )
    simulated = simulate_signal(scene, nm, noise, seed, depolarisation_noise=depolarisation_noise)
    angle = np.broadcast_to(getattr(light.angle, "start", light.angle), nm.shape)
    azimuth = None if light.azimuth is None else np.broadcast_to(light.azimuth, nm.shape)
    if light.signal == generalised.SIGNAL:
        ratios = generalised.RATIOS if elements is None else tuple(elements)
        generalised.check_ratios(ratios)
        psi, delta = (
            np.stack([simulated.values[:, 2 * generalised.RATIOS.index(name) + i] for name in ratios], axis=1)
            for i in (0, 1)
        )
        sigma = np.full(psi.shape, noise) if noise > 0 else None
        return Spectrum(
            nm,
            psi,
            light.signal,
            sigma=sigma,
            angle=angle,
            azimuth=azimuth,
            delta=delta,
            delta_sigma=None if sigma is None else generalised.delta_sigma(psi, sigma),
            ratios=ratios,
        )
    if light.signal == mueller.SIGNAL:
        chosen = mueller.ELEMENTS if elements is None else tuple(elements)
        mueller.check_elements(chosen)
        values = simulated.values[:, [mueller.ELEMENTS.index(name) for name in chosen]]
        sigma = np.full(values.shape, noise) if noise > 0 else None
        about = {"angle": angle, "azimuth": azimuth, "elements": chosen}
        return Spectrum(nm, values, light.signal, sigma=sigma, **about)
    values, share, share_noise = simulated.values, simulated.depolarisation, simulated.depolarisation_noise
    share_sigma = np.full(nm.shape, share_noise) if share is not None and share_noise > 0 else None
    psi_or_power, delta = values.T if ellipsometric else (values, None)
    sigma = np.full(nm.shape, noise) if noise > 0 else None
    return Spectrum(
        nm,
        psi_or_power,
        light.signal,
        sigma=sigma,
        polarisation=light.polarisation,
        angle=angle,
        azimuth=azimuth,
        delta=delta,
        folded=False,
        delta_sigma=sigma if ellipsometric else None,
        depolarisation=share,
        depolarisation_sigma=share_sigma,
    )


def simulate_signal(
    scene: Scene,
    wavelength: ArrayLike,
    noise: float = 0.0,
    seed: int = 0,
    tolerance: float = 0.0,
    depolarisation_noise: float | None = None,
) -> SimulatedSignal:
    """Simulate the signal of a film at `wavelength` (nm) with normal noise of standard deviation `noise`.

    Free parameters take their start values; a free scale is 1 and a free offset 0. Effects that change
    the signal by less than the `tolerance` are left out (see `pellicle.plan`). The signal of ellipsometry is
    Ψ and Δ in degrees, or the elements m12 to m44 of the normalised Mueller matrix. The noise of generalised
    Ψ and Δ is `noise` in Ψ and the same across it (`data.generalised.delta_sigma`). The depolarisation comes
    with Ψ and Δ where the scene depolarises or a `depolarisation_noise` is given, None for the usual one.

    **Raises:** ValueError where a material has no data at a wavelength.
    """
    wavelength = np.asarray(wavelength, dtype=float)
    with jax.enable_x64(True):
        fixed = with_wavelength(insert(scene, start_values(scene)), wavelength)
        scale: Any = 1.0 if isinstance(fixed.instrument.scale, Drift) else fixed.instrument.scale
        offset: Any = 0.0 if isinstance(fixed.instrument.offset, Drift) else fixed.instrument.offset
        instrument = replace(fixed.instrument, scale=scale, offset=offset)
        fixed = eqx.tree_at(lambda s: s.instrument, fixed, instrument)
        chosen = plan(fixed, tolerance)
        signal = np.asarray(jax.jit(build(chosen))(tabulated(fixed, chosen.on("coherence"))))
    clean, share, share_noise = float(scale) * signal + float(offset), None, 0.0
    if scene.light.signal == "psi-delta":
        if depolarises(chosen) or depolarisation_noise is not None:
            given = depolarisation_noise
            share_noise = usual_depolarisation_noise(noise) if given is None else given
            scatter = np.random.default_rng((seed, 1)).normal(0.0, 1.0, wavelength.shape)
            share = 1 - np.sum(clean.reshape(-1, 3) ** 2, axis=1) + share_noise * scatter
        clean = np.stack(np.broadcast_arrays(*psi_delta(*clean.reshape(-1, 3).T)), axis=1)
    elif scene.light.signal == mueller.SIGNAL:
        clean = clean.reshape(len(wavelength), -1)
    elif scene.light.signal == generalised.SIGNAL:
        sphere = clean.reshape(len(wavelength), -1, 3)
        clean = _angles(sphere)
        return SimulatedSignal(wavelength, _angles(_scattered(sphere, noise, seed)), clean, chosen)
    values = clean + noise * np.random.default_rng(seed).normal(0.0, 1.0, clean.shape)
    if scene.light.signal == "psi-delta":
        values = np.stack([np.clip(values[:, 0], 0.0, 90.0), np.mod(values[:, 1], 360.0)], axis=1)
    return SimulatedSignal(wavelength, values, clean, chosen, share, share_noise)


def _angles(sphere: np.ndarray) -> np.ndarray:
    """Ψ and Δ of each ratio side by side, (wavelengths, 6), of N, C, S (wavelengths, 3, 3)."""
    psi, delta = psi_delta(*np.moveaxis(sphere, -1, 0))
    return np.stack(np.broadcast_arrays(psi, delta), axis=-1).reshape(len(sphere), -1)


def _scattered(sphere: np.ndarray, noise: float, seed: int) -> np.ndarray:
    """N, C, S (..., 3) with noise of 2 · `noise` (degrees of Ψ) in any direction along their sphere."""
    length = np.linalg.norm(sphere, axis=-1, keepdims=True)
    points = sphere / np.where(length > 0, length, 1.0)
    step = 2 * math.radians(noise) * np.random.default_rng(seed).normal(size=points.shape)
    return points + step - points * np.sum(step * points, axis=-1, keepdims=True)


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
