"""Synthetic samples of a surface's BRDF: directions worth looking along, values and noise."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import jax
import numpy as np

from pellicle.data.brdf_samples import CHANNELS, BrdfSamples
from pellicle.data.half_angles import angles, from_half_difference
from pellicle.effects.plan import Plan
from pellicle.errors import UsageError
from pellicle.planning import surface as planning
from pellicle.scene.surface import Surface, surface_view
from pellicle.simulation.surface import build

SAMPLES = 1000
"""Pairs of directions where no data file says which."""


class Directions(NamedTuple):
    """To the light and to the eye: degrees from the normal and around it, each (samples,)."""

    theta_i: np.ndarray
    phi_i: np.ndarray
    theta_o: np.ndarray
    phi_o: np.ndarray


def default_directions(count: int = SAMPLES) -> Directions:
    """Half and difference angles of a Sobol sequence, the same at every call.

    θ_h is spaced as its square root, as MERL's grid, so that most pairs lie where a lobe is; θ_d and
    both azimuths evenly. Pairs with a direction below the horizon are left out.
    """
    from scipy.stats import qmc  # takes longer to import than the rest of the package

    unit = qmc.Sobol(4, rng=np.random.default_rng(0)).random_base2(int(np.ceil(np.log2(4 * count))))
    quarter, turn = 0.5 * np.pi, 2 * np.pi
    light, eye = from_half_difference(
        quarter * unit[:, 0] ** 2, turn * unit[:, 1], quarter * unit[:, 2], turn * unit[:, 3]
    )
    seen = (light[2] > 0) & (eye[2] > 0)
    found = [np.rad2deg(x[seen][:count]) for pair in (light, eye) for x in angles(pair)]
    return Directions(*found)


def simulate_brdf(
    surface: Surface,
    directions: Directions | BrdfSamples | None = None,
    *,
    noise: float = 0.0,
    seed: int = 0,
) -> BrdfSamples:
    """The samples that a surface would give, ready to be fitted; for `directions` see `synthesise`.

    Without directions there are 1000 pairs, spread over the lobe and around it. `noise` (1/sr) is the
    standard deviation of normal noise, and becomes the samples' σ.
    """
    looked = default_directions() if directions is None else directions
    return synthesise(surface, looked, noise, seed).samples


class Synthetic(NamedTuple):
    """Samples with noise, and the plan that they went through."""

    samples: BrdfSamples
    plan: Plan


def synthesise(
    surface: Surface,
    looked: Directions | BrdfSamples,
    noise: float = 0.0,
    seed: int = 0,
    tolerance: float = 0.0,
) -> Synthetic:
    """The BRDF at where free numbers start, with normal noise of standard deviation `noise` (1/sr).

    What noise takes below zero is 0, and a note counts it. Effects that change less than the `tolerance`
    are left out (`pellicle.plan`). **Raises:** UsageError unless the surface has one channel, or R, G
    and B, and for a black one.
    """
    channels = {len(names): names for names in CHANNELS}.get(surface.channels)
    if channels is None:
        raise UsageError(f"samples have one channel or R, G and B: {surface.channels} wavelengths were given")
    numbers = {key: x.tolist() for key, x in surface.start_numbers().items() if key != "wavelengths"}
    fixed = replace(surface, numbers=numbers)
    plan = planning.plan(surface_view(fixed, looked), tolerance)
    with jax.enable_x64(True):
        seen = jax.jit(build(plan.static_key))(surface_view(fixed, looked, len(looked.theta_i)))
    clean = np.asarray(seen, dtype=float)
    noisy = clean + np.random.default_rng(seed).normal(0.0, 1.0, clean.shape) * noise
    below = int(np.sum(noisy < 0))
    samples = BrdfSamples(
        **{name: getattr(looked, name) for name in Directions._fields},
        values=np.maximum(noisy, 0.0),
        channels=channels,
        sigma=np.full(clean.shape, noise) if noise > 0 else None,
        notes=(f"{below} values that noise took below zero are 0",) if below else (),
    )
    return Synthetic(samples, plan)
