"""Simulated spectra of films: the signal of a scene with noise."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import equinox as eqx
import jax
import numpy as np
from numpy.typing import ArrayLike

from pellicle.data.spectrum import Spectrum
from pellicle.effects.film_plan import plan
from pellicle.errors import UsageError
from pellicle.forward_model.elementary_signal import by_numpy, is_elementary
from pellicle.forward_model.film_signal import build, depolarises, tabulated
from pellicle.forward_model.plan import Plan
from pellicle.materials import common_range
from pellicle.scene.film import Scene, with_wavelength
from pellicle.scene.free import insert, start_values
from pellicle.scene.instrument import Drift
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
        known = tabulated(fixed)
        if is_elementary(chosen):
            [signal] = by_numpy(chosen, known, np.empty((1, 0)))
        else:
            signal = np.asarray(jax.jit(build(chosen))(known))
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
    low, high = common_range(scene)
    grid = np.arange(start, stop + step / 2, step)
    return grid[(grid >= low) & (grid <= high)]
