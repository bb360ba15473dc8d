"""pellicle in float64, birefringent films."""

import jax
import numpy as np

import adapters.birefringent_any as ours

jax.config.update("jax_enable_x64", True)


def values(case):
    return ours.values(case, np.float64)


def slopes(case):
    return ours.slopes(case, np.float64)
