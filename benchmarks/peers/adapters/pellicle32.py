"""pellicle in float32."""

import numpy as np

import adapters.pellicle_any as ours


def values(case):
    return ours.values(case, np.float32)


def slopes(case):
    return ours.slopes(case, np.float32)
