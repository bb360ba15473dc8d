"""Sample the posterior of a scene's free parameters, from every minimum that the fit has found."""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from functools import partial

import jax

from pellicle.data.spectrum import Spectrum
from pellicle.fitting.spectra.fit import fitted, measurements
from pellicle.fitting.spectra.search import Progress, quiet
from pellicle.sampling.density import fingerprint, log_density
from pellicle.sampling.ensemble import STEPS, Subject, installed, sampled
from pellicle.sampling.modes import modes
from pellicle.sampling.predict import predictions
from pellicle.sampling.result import Posterior
from pellicle.scene.film import Scene


def sample(
    data: Spectrum | Sequence[Spectrum],
    scene: Scene | Sequence[Scene],
    *,
    walkers: int | None = None,
    steps: int = STEPS,
    seed: int = 0,
    chain: str | os.PathLike[str] | None = None,
    tolerance: float = 0.0,
    progress: Progress = quiet,
) -> Posterior:
    """Fit as `pellicle.fit` does, then sample the posterior between the bounds, in float64.

    Priors are those of the `Free` parameters, uniform between the bounds by default; scale and offset
    are integrated out. Walkers start in every minimum in proportion to its share and move by
    differential evolution, its snooker update, and jumps between minima. The chain ends when it is 50
    autocorrelation times long and passes the other checks, or after `steps`. With a `chain` file it is
    kept there as it grows, and a run that was cut short goes on where it stopped.

    **Raises:** as `fit` does, and UsageError for too few walkers (two for each parameter at least) or
    more than the machine's memory holds; DataError for a chain of another problem.
    """
    began = time.perf_counter()
    installed()
    fit, weighed = fitted(data, scene, tolerance, progress)
    problem = weighed.problem
    with jax.enable_x64(True):
        subject = Subject(
            fit,
            tuple(p.name for p in problem.parameters),
            log_density(problem),
            modes(weighed),
            problem.box.values,
            fingerprint(measurements(data, scene), tolerance),
            max(len(view.data.values) for view in problem.views),
            partial(predictions, problem, fit.parts),
        )
    return sampled(subject, walkers, steps, seed, chain, progress, began)
