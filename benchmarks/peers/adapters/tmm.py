"""tmm (S. Byrnes): `coh_tmm`, angles in radians, n + ik."""

import numpy as np
import tmm


def values(case):
    index = [
        case["ambient_n"],
        complex(case["layer_n"], case["layer_k"]),
        complex(case["substrate_n"], case["substrate_k"]),
    ]
    depth, angle = [np.inf, case["thickness"], np.inf], np.deg2rad(case["angle"])
    found = {}
    for letter in "sp":
        answer = tmm.coh_tmm(letter, index, depth, angle, case["wavelength"])
        found |= {"R" + letter: [answer["R"]], "T" + letter: [answer["T"]]}
    return found
