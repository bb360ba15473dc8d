"""refellips: the amplitudes of its `coh_tmm`, nanometres and radians, n + ik.

Its public interface returns Ψ and Δ; R is the square of the amplitude. It computes no transmittance.
"""

import numpy as np
from refellips.reflect_modelSE import coh_tmm


def values(case):
    index = [
        case["ambient_n"],
        complex(case["layer_n"], case["layer_k"]),
        complex(case["substrate_n"], case["substrate_k"]),
    ]
    depth = [np.inf, case["thickness"], np.inf]
    answer = coh_tmm(index, depth, np.deg2rad(case["angle"]), case["wavelength"])
    return {"R" + letter: [abs(np.ravel(answer[f"r_{letter}"])[0]) ** 2] for letter in "sp"}
