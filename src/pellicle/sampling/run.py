"""Extend a chain until its checks pass, a limit is reached, or the user interrupts."""

from __future__ import annotations

from collections.abc import Callable
from logging import getLogger
from typing import Any

import numpy as np

from pellicle.fitting.progress import Progress
from pellicle.sampling.chain import Chain
from pellicle.sampling.checks import Checks, check
from pellicle.sampling.modes import Modes
from pellicle.sampling.target import Target

log = getLogger(__name__)

BLOCK = 100
"""Steps between two looks at the clock and the keyboard."""
_GROWTH = 1.25
"""The checks are made again when the chain has grown by this factor."""


def run(
    target: Target,
    modes: Modes,
    chain: Chain,
    steps: int,
    keep: Callable[[Chain], None],
    progress: Progress,
) -> tuple[Chain, Checks]:
    """The chain extended to at most `steps`, and its checks.

    `keep` is called with the chain after every block. Ctrl-C ends the chain with what it has; before the
    first block it is raised again.
    """
    checks, checked = None, 0
    progress("sample", chain.steps, steps)
    try:
        while chain.steps < steps:
            if chain.steps >= 2 * BLOCK and chain.steps >= _GROWTH * checked:
                checks, checked = check(chain, modes), chain.steps
                log.info("chain: %d steps: %s", chain.steps, "; ".join(checks.doubts) or "long enough")
                if checks.trusted:
                    break
            chain = _extended(target, modes, chain, min(BLOCK, steps - chain.steps))
            keep(chain)
            progress("sample", chain.steps, steps)
        progress("sample", chain.steps, chain.steps)
    except KeyboardInterrupt:
        if not chain.steps:
            raise
    if checks is None or chain.steps != checked:
        checks = check(chain, modes)
    return chain, checks


def _extended(target: Target, modes: Modes, chain: Chain, steps: int) -> Chain:
    import emcee

    walkers, size = chain.draws.shape[1:]
    if chain.steps:
        state = emcee.State(chain.draws[-1], log_prob=chain.log_density[-1], random_state=chain.random)
    else:
        random = np.random.RandomState()
        random.set_state(chain.random)
        start = modes.start(walkers, random)
        state = emcee.State(start, log_prob=target(start), random_state=random.get_state(legacy=True))
    sampler = emcee.EnsembleSampler(walkers, size, target, moves=moves(modes), vectorize=True)
    # emcee's wrapper prints to stdout where the target is interrupted
    sampler.log_prob_fn = target  # pyright: ignore[reportAttributeAccessIssue]
    sampler.run_mcmc(state, steps, skip_initial_state_check=True)
    more = Chain(
        np.asarray(sampler.get_chain()),
        np.asarray(sampler.get_log_prob()),
        np.asarray(sampler.backend.accepted),
        tuple(sampler.random_state),
    )
    return chain.extended(more)


def moves(modes: Modes) -> list[tuple[Any, float]]:
    """emcee's moves with their shares.

    Differential evolution (C. J. F. ter Braak, 2006, Stat. Comput. 16, 239) and its snooker update (ter
    Braak and Vrugt, 2008, ibid. 18, 435) need no tuning, but rarely cross from one minimum to another.
    The third proposes a draw from the mixture of all minima, whatever the walker's place (an independence
    sampler: Tierney, 1994, Ann. Stat. 22, 1701, section 2.3.3).
    """
    from emcee.moves import DEMove, DESnookerMove, MHMove

    def jump(walkers: np.ndarray, random: np.random.RandomState) -> tuple[np.ndarray, np.ndarray]:
        there = modes.draw(len(walkers), random)
        return there, modes.log_density(walkers) - modes.log_density(there)

    return [(DEMove(), 0.4), (DESnookerMove(), 0.1), (MHMove(jump), 0.5)]
