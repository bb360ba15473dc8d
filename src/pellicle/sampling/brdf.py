"""Sample the posterior of a surface's free numbers, from every minimum that the fit has found."""

from __future__ import annotations

import os
import time
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from pellicle.data.brdf_samples import BrdfSamples
from pellicle.fitting.brdf.coordinates import Box, log_area, values
from pellicle.fitting.brdf.fit import Found, fitted
from pellicle.fitting.brdf.neighbourhood import affine
from pellicle.fitting.brdf.problem import Data, Form, Problem, around, parameters, residual
from pellicle.fitting.brdf.residuals import INVERSES, RESIDUALS
from pellicle.fitting.brdf.result import BrdfFit
from pellicle.fitting.result import Status
from pellicle.fitting.spectra.problem import Box as Priors
from pellicle.fitting.spectra.problem import boxed
from pellicle.fitting.spectra.search import Progress, quiet
from pellicle.sampling.density import bounded, fingerprint, log_prior
from pellicle.sampling.ensemble import STEPS, Subject, installed, sampled
from pellicle.sampling.modes import Modes, confined, mixture
from pellicle.sampling.predict import Axis, Prediction, chosen
from pellicle.sampling.result import Posterior
from pellicle.scene.surface import Surface


def sample_brdf(
    samples: BrdfSamples,
    surface: Surface,
    *,
    residual: str | None = None,
    walkers: int | None = None,
    steps: int = STEPS,
    seed: int = 0,
    chain: str | os.PathLike[str] | None = None,
    progress: Progress = quiet,
) -> Posterior:
    """Fit as `pellicle.fit` does, then sample the posterior between the bounds, as `pellicle.sample`.

    What the `residual` compares (ρ, or its cube root) is taken to have normal errors: of the given σ, or of
    the rms of the best fit's residuals. Where these are alike in neighbouring samples the samples count as
    fewer, as in the fit's own errors. Priors are those of the `Free` numbers, uniform between the bounds by
    default; a deviation and its azimuth are a direction, and all directions are as likely. The posterior
    takes a layer for granted, also where the fit sees none.

    **Raises:** as `fit_brdf` and `pellicle.sample` do.
    """
    began = time.perf_counter()
    installed()
    fit, found = fitted(samples, surface, residual, progress)
    with jax.enable_x64(True):
        subject = _subject(samples, surface, fit, found)
    return sampled(subject, walkers, steps, seed, chain, progress, began)


def _subject(samples: BrdfSamples, surface: Surface, fit: BrdfFit, found: Found) -> Subject:
    own, variance = affine(surface, found.problem), found.at.variance
    form, *rest = own.program
    known = {leaf.name: leaf for leaf in surface.free_numbers()}
    free = [known[name].free for name in form.coordinates.names]
    lower, upper = (np.array([getattr(each, side) for each in free]) for side in ("lower", "upper"))
    held = jax.device_put((*rest, boxed(lower, upper, [each.prior for each in free]), np.float64(variance)))
    unsure = not fit.layered and fit.status is not Status.AMBIGUOUS
    return Subject(
        fit,
        form.coordinates.names,
        lambda units: np.asarray(_log_density(form, *held, units)),
        _modes(found, own),
        partial(_values, own, found.at.numbers),
        _whose(samples, surface, fit.residual),
        own.data.values.size,
        partial(_predictions, own, fit, 1.0 if samples.sigma is not None else found.at.chi2_reduced),
        "there is a layer" if unsure else "",
    )


@partial(jax.jit, static_argnums=0)
def _log_density(
    form: Form,
    data: Data,
    fixed: dict[str, Any],
    box: Box,
    most: Any,
    priors: Priors,
    variance: Any,
    units: Any,
) -> Any:
    """ln posterior at `units` (points, parameters), up to a constant; `variance` multiplies σ²."""

    def one(unit):
        left = residual(form, data, fixed, box, most, unit)
        prior = log_prior(priors, values(form.coordinates, box, unit)) + log_area(form.coordinates, box, unit)
        return bounded(unit, -0.5 * jnp.sum(left**2) / variance + prior)

    return jax.vmap(one)(units)


def _values(own: Problem, best: np.ndarray, units: np.ndarray) -> np.ndarray:
    """Points (..., parameters) of the unit cube in the parameters' own units, the azimuth within half a turn
    of the best one's."""
    c = own.form.coordinates
    flat = jnp.asarray(units.reshape(-1, units.shape[-1]))
    found = np.array(jax.vmap(lambda unit: values(c, own.box, unit))(flat)).reshape(units.shape)
    if c.tilt is not None:
        at = c.tilt[1]
        found[..., at] = best[at] + (found[..., at] - best[at] + 180) % 360 - 180
    return found


def _modes(found: Found, own: Problem) -> Modes:
    """The fit's minima, each with the covariance of its own Jacobian and the best one's noise."""
    variance = found.at.variance
    units = np.array([_moved(found.problem, own, unit) for unit in found.minima.units])

    def covariance(unit: np.ndarray) -> np.ndarray:
        return confined(np.asarray(around(*own.program, unit)[1]) / np.sqrt(variance), len(unit))

    return mixture(units, found.minima.chi2 / variance, covariance)


def _moved(searched: Problem, own: Problem, unit: np.ndarray) -> np.ndarray:
    """A point of the unit cube that was searched in the one that is sampled."""
    c, count = searched.form.coordinates, len(searched.form.coordinates.names)
    numbers = np.array([*values(c, searched.box, unit[:count]), *(unit[count:] * searched.most)])
    for at in c.tilt or ():
        numbers[at] = searched.box.lower[at] + unit[at] * (searched.box.upper[at] - searched.box.lower[at])
    if c.folded and c.tilt is not None:
        numbers[c.tilt[1]] = np.sqrt(numbers[c.tilt[1]])
    return np.clip((numbers - own.box.lower) / (own.box.upper - own.box.lower), 0.0, 1.0)


def _whose(samples: BrdfSamples, surface: Surface, compared: str) -> str:
    seen = (samples.theta_i, samples.phi_i, samples.theta_o, samples.phi_o, samples.values, samples.sigma)
    return fingerprint([seen, (dict(surface.numbers), surface.channel_wavelengths)], surface.model, compared)


@partial(jax.jit, static_argnums=0)
def _curves(form: Form, data: Data, fixed: dict[str, Any], box: Any, most: Any, units: Any) -> Any:
    """The BRDF of each candidate, (candidates, samples, channels)."""
    return jax.vmap(lambda u: form.evaluate(parameters(form, fixed, box, most, u), data.i, data.o))(units)


def _predictions(
    own: Problem, fit: BrdfFit, variance: float, units: np.ndarray, seed: int
) -> tuple[Prediction, ...]:
    """One for each channel, its samples from the darkest to the brightest of the fitted surface."""
    random, keep = np.random.default_rng(seed), slice(own.samples)
    with jax.enable_x64(True):
        model = np.asarray(_curves(*own.program, chosen(units, random)))[:, keep]
        look = own.data.i[keep, 2:3], own.data.floor
        spread = np.sqrt(variance) / np.asarray(own.data.weight)[keep]
        compared = RESIDUALS[own.form.residual](model, *look) + spread * random.standard_normal(model.shape)
        noisy = np.asarray(INVERSES[own.form.residual](compared, *look))
    rank = fit.model.argsort(axis=0).argsort(axis=0)
    return tuple(
        Prediction(
            name,
            f"{name} (1/sr)",
            Axis(f"rank_{name}", "samples, from the darkest to the brightest", rank[:, c]),
            fit.samples.values[:, c],
            model[..., c],
            noisy[..., c],
            decades=True,
        )
        for c, name in enumerate(fit.samples.channels)
    )
