"""Synthetic measurements: a scene's signal with noise, and the truth written beside it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import equinox as eqx
import jax
import numpy as np

from pellicle.data.spectrum import Spectrum
from pellicle.dispersion.base import AbstractDispersion
from pellicle.effects.plan import Plan
from pellicle.optics.ellipsometry import psi_delta
from pellicle.planning.film import plan
from pellicle.scene.film import Scene, with_wavelength
from pellicle.scene.free import insert, is_free, start_values
from pellicle.scene.instrument import Drift, Instrument
from pellicle.simulation.film import build, tabulated

VISIBLE = (380.0, 780.0, 2.0)
"""Default wavelengths: start, stop and step in nm."""


class Synthetic(NamedTuple):
    """What was simulated: the signal with and without noise, and the plan it went through."""

    wavelength: np.ndarray
    values: np.ndarray
    clean: np.ndarray
    plan: Plan


def simulate(scene: Scene, wavelength: Any = None, *, noise: float = 0.0, seed: int = 0) -> Spectrum:
    """The spectrum that a scene would give, ready to be fitted.

    **Arguments:** `wavelength` in nm (380 to 780 every 2 nm where the materials have data); `noise` the
    standard deviation of normal noise, in the unit of the signal (a fraction; degrees for Ψ and Δ), which
    becomes the spectrum's σ; `seed` of the noise. Free parameters take their values, and a free scale or
    offset is 1 or 0.

    **Raises:** ValueError where a material has no data at a wavelength.
    """
    wavelength = default_wavelengths(scene) if wavelength is None else np.asarray(wavelength, dtype=float)
    light, ellipsometric = scene.light, scene.light.signal == "psi-delta"
    made = (synthesise_angles if ellipsometric else synthesise)(scene, wavelength, noise, seed)
    psi_or_power, delta = made.values.T if ellipsometric else (made.values, None)
    sigma = np.full(wavelength.shape, noise) if noise > 0 else None
    angle = getattr(light.angle, "start", light.angle)
    return Spectrum(
        wavelength,
        psi_or_power,
        light.signal,
        sigma=sigma,
        polarisation=light.polarisation,
        angle=np.broadcast_to(angle, wavelength.shape),
        delta=delta,
        delta_sigma=sigma if ellipsometric else None,
    )


def synthesise(
    scene: Scene, wavelength: Any, noise: float = 0.0, seed: int = 0, tolerance: float = 0.0
) -> Synthetic:
    """The signal of a scene at `wavelength` (nm) with normal noise of standard deviation `noise`.

    Free parameters take their values, scale and offset that are free are 1 and 0. Effects that change
    less than the `tolerance` are left out (`pellicle.plan`). Raises ValueError
    where a material has no data at a wavelength.
    """
    wavelength = np.asarray(wavelength, dtype=float)
    with jax.enable_x64(True):
        fixed = with_wavelength(insert(scene, start_values(scene)), wavelength)
        fixed = eqx.tree_at(lambda s: s.instrument, fixed, _settled(fixed.instrument))
        chosen = plan(fixed, tolerance)
        signal = np.asarray(jax.jit(build(chosen))(tabulated(fixed, chosen.on("coherence"))))
    clean = float(fixed.instrument.scale) * signal + float(fixed.instrument.offset)
    random = np.random.default_rng(seed).normal(0.0, 1.0, clean.shape)
    return Synthetic(wavelength, clean + noise * random, clean, chosen)


def synthesise_angles(
    scene: Scene, wavelength: Any, noise: float = 0.0, seed: int = 0, tolerance: float = 0.0
) -> Synthetic:
    """The same for ellipsometry as Ψ and Δ in degrees, (wavelengths, 2), with noise in degrees."""
    exact = synthesise(scene, wavelength, tolerance=tolerance)
    clean = np.stack(np.broadcast_arrays(*psi_delta(*exact.clean.reshape(-1, 3).T)), axis=1)
    noisy = clean + np.random.default_rng(seed).normal(0.0, noise, clean.shape)
    psi, delta = np.clip(noisy[:, 0], 0.0, 90.0), np.mod(noisy[:, 1], 360.0)
    return exact._replace(values=np.stack([psi, delta], axis=1), clean=clean)


def _settled(instrument: Instrument) -> Instrument:
    return replace(
        instrument,
        scale=1.0 if isinstance(instrument.scale, Drift) else instrument.scale,
        offset=0.0 if isinstance(instrument.offset, Drift) else instrument.offset,
    )


def default_wavelengths(scene: Scene) -> np.ndarray:
    """380 to 780 nm every 2 nm, clipped to where every material has data."""
    low, high, step = VISIBLE
    for material in _media(scene):
        first, last = getattr(material, "wavelength_range", (0.0, np.inf))
        low, high = max(low, first), min(high, last)
    grid = np.arange(VISIBLE[0], VISIBLE[1] + step / 2, step)
    return grid[(grid >= low) & (grid <= high)]


def _media(scene: Scene) -> list[AbstractDispersion]:
    """Every material with a range of its own, however deep it lies."""
    has_range = lambda x: hasattr(x, "wavelength_range")  # noqa: E731
    leaves = jax.tree_util.tree_leaves(scene, is_leaf=lambda x: has_range(x) or is_free(x))
    return [leaf for leaf in leaves if has_range(leaf)]
