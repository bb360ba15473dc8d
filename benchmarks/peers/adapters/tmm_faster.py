"""tmm_faster: `calc_coherent`, nanometres and degrees, n + ik."""

import numpy as np
import tmm_faster


def values(case):
    index = [
        case["ambient_n"],
        complex(case["layer_n"], case["layer_k"]),
        complex(case["substrate_n"], case["substrate_k"]),
    ]
    answer = tmm_faster.calc_coherent(
        np.array([index], dtype=complex),
        [np.inf, case["thickness"], np.inf],
        [case["angle"]],
        [case["wavelength"]],
    )
    return {kind + letter: [np.ravel(answer[f"{kind}_{letter}"])[0]] for kind in "RT" for letter in "sp"}
