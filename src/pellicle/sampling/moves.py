"""How walkers move: mostly by differences between them, and at times to another minimum altogether."""

from __future__ import annotations

from typing import Any

import numpy as np

from pellicle.sampling.modes import Modes


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
