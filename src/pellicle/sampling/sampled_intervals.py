"""Methods of computing 95 % intervals of a fit from samples of its posterior, for `pellicle cost`."""

from functools import partial

import numpy as np

from pellicle.accuracy.cost import Interval
from pellicle.accuracy.registry import Method
from pellicle.fitting.progress import quiet
from pellicle.fitting.reweighting import RankedMinima
from pellicle.sampling.chain import empty, missing
from pellicle.sampling.density import Target, log_density, modes
from pellicle.sampling.sample import run

_WALKERS = 32
_STEPS = 20_000


def _sampled(steps: int, fit: RankedMinima) -> Interval:
    """Intervals by the chain of `pellicle.sample`, of `steps` steps or until it is long enough."""
    size = len(fit.problem.parameters)
    target = Target(log_density(fit.problem), _WALKERS // 2)
    chain, checks = run(target, modes(fit), empty(_WALKERS, size, 0), steps, lambda chain: None, quiet)
    return _quantiles(chain.draws[checks.discard :])


def _stretch(steps: int, fit: RankedMinima) -> Interval:
    """Intervals by the usual chain: stretch moves from a ball around the best fit, half of it burn-in."""
    import emcee

    size = len(fit.problem.parameters)
    target = Target(log_density(fit.problem), _WALKERS // 2)
    random = np.random.default_rng(0)
    start = np.clip(fit.minima.units[0] + 1e-4 * random.standard_normal((_WALKERS, size)), 1e-9, 1 - 1e-9)
    sampler = emcee.EnsembleSampler(_WALKERS, size, target, vectorize=True)
    # emcee's wrapper prints to stdout where the target is interrupted
    sampler.log_prob_fn = target  # pyright: ignore[reportAttributeAccessIssue]
    sampler.run_mcmc(start, steps, skip_initial_state_check=True)
    return _quantiles(np.asarray(sampler.get_chain(discard=steps // 2)))


def _quantiles(draws: np.ndarray) -> Interval:
    lower, upper = np.quantile(draws.reshape(-1, draws.shape[-1]), [0.025, 0.975], axis=0)
    return lower, upper


SAMPLED_INTERVALS = tuple(
    Method(name, leaves_out, apply, missing=next(iter(missing()), None))
    for name, leaves_out, apply in (
        ("emcee, 25 steps", "most of the chain", partial(_sampled, 25)),
        ("emcee, 100 steps", "half of the chain", partial(_sampled, 100)),
        ("emcee, until it is long enough", "nothing: pellicle sample", partial(_sampled, _STEPS)),
        ("emcee, stretch, 500 steps", "other minima: from the best fit", partial(_stretch, 500)),
    )
)
"""Every method of computing intervals from samples, in the order of their cost."""
