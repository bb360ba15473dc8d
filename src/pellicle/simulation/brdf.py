"""Simulated samples of the BRDF of a surface, and the directions where they are taken."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import jax
import numpy as np

from pellicle.data.brdf_samples import CHANNELS, BrdfSamples, angles, from_half_difference
from pellicle.effects import surface_plan
from pellicle.errors import UsageError
from pellicle.forward_model.plan import Plan
from pellicle.forward_model.surface_signal import build
from pellicle.scene.surface import Surface, surface_view

SAMPLES = 1000
"""Default number of pairs of directions."""


class Directions(NamedTuple):
    """Pairs of directions to light and eye.

    `theta_i`, `phi_i` is the direction to the light and `theta_o`, `phi_o` that to the eye, in degrees from
    the normal and around it, each of shape (samples,). The mirror side of phi_i = 0 is phi_o = 180.
    """

    theta_i: np.ndarray
    phi_i: np.ndarray
    theta_o: np.ndarray
    phi_o: np.ndarray


def default_directions(count: int = SAMPLES) -> Directions:
    """Pairs of directions from a Sobol sequence of half and difference angles, the same at every call.

    √θ_h is uniform, as in MERL's grid, so that most pairs lie in the lobe; θ_d and both azimuths are uniform.
    Pairs with a direction below the horizon are left out.
    """
    from scipy.stats import qmc  # takes longer to import than the rest of the package

    unit = qmc.Sobol(4, rng=np.random.default_rng(0)).random_base2(int(np.ceil(np.log2(4 * count))))
    quarter, turn = 0.5 * np.pi, 2 * np.pi
    light, eye = from_half_difference(
        quarter * unit[:, 0] ** 2, turn * unit[:, 1], quarter * unit[:, 2], turn * unit[:, 3]
    )
    above = (light[2] > 0) & (eye[2] > 0)
    return Directions(*(np.rad2deg(x[above][:count]) for vector in (light, eye) for x in angles(vector)))


class SimulatedSamples(NamedTuple):
    """Simulated samples with noise, and the plan of their simulation."""

    samples: BrdfSamples
    plan: Plan


def simulate_samples(
    surface: Surface,
    directions: Directions | BrdfSamples | None = None,
    noise: float | str | Sequence[float | str] = 0.0,
    seed: int = 0,
    tolerance: float = 0.0,
) -> SimulatedSamples:
    """Simulate samples of the BRDF of a surface with normal noise of standard deviation `noise`, 1/sr or a
    share of the signal ("2 %"), for all channels or for each.

    Free parameters take their start values. Without `directions` there are 1000 pairs, spread over the
    lobe and around it. The noise becomes the σ of the samples; values that it takes below zero are set to 0,
    and a note counts them. Effects that change the BRDF by less than the relative `tolerance` are left out
    (see `pellicle.plan`).

    **Raises:** UsageError for a surface that has neither one channel nor R, G and B, or reflects nothing.
    """
    channels = {len(names): names for names in CHANNELS}.get(surface.channels)
    if channels is None:
        raise UsageError(
            f"samples have one channel or R, G and B: the surface has {surface.channels} wavelengths"
        )
    pairs = default_directions() if directions is None else directions
    fixed = surface.at_start()
    plan = surface_plan.plan(surface_view(fixed, pairs), tolerance)
    with jax.enable_x64(True):
        view = surface_view(fixed, pairs, len(pairs.theta_i))
        clean = np.asarray(jax.jit(build(plan.static_key))(view), dtype=float)
    samples = BrdfSamples(
        **{name: getattr(pairs, name) for name in Directions._fields}, values=clean, channels=channels
    )
    if noise == 0:
        return SimulatedSamples(samples, plan)
    sigma = np.asarray(samples.with_noise(noise).sigma)
    noisy = clean + np.random.default_rng(seed).normal(0.0, 1.0, clean.shape) * sigma
    below = int(np.sum(noisy < 0))
    notes = (f"{below} values below zero through noise were set to 0",) if below else ()
    return SimulatedSamples(replace(samples, values=np.maximum(noisy, 0.0), sigma=sigma, notes=notes), plan)
