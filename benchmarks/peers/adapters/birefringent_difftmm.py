"""difftmm: `create_jones_matrix_AOIAz`, micrometres and radians, n + ik, complex64 by construction.

Its matrix is that of the tangential fields (Ex, Ey), and its Euler angles are a quarter turn from ours. The
substrate is isotropic, so derivatives in both of its indices cannot be compared.
"""

import math

import numpy as np
import torch
from difftmm import create_jones_matrix_AOIAz


def values(case):
    substrates = [complex(case["substrate_" + x], case["substrate_k"]) for x in ("ordinary", "extraordinary")]
    if substrates[0] != substrates[1]:
        raise ValueError("it has isotropic substrates only")

    def row(number, dtype=torch.float32):
        return torch.tensor([[number]], dtype=dtype)

    ordinary, extraordinary = (complex(case[x + "_n"], case[x + "_k"]) for x in ("ordinary", "extraordinary"))
    turns = math.radians(case["phi"]) + math.pi / 2, math.radians(case["theta"]), 0.0
    angle = math.radians(case["angle"])
    _, reflected = create_jones_matrix_AOIAz(
        row(turns),
        row((ordinary, ordinary, extraordinary), torch.complex64),
        row(case["thickness"] * 1e-3),
        row(case["wavelength"] * 1e-3),
        case["ambient"],
        substrates[0],
        row(angle),
        row(0.0),
    )
    (xx, xy), (yx, yy) = reflected[0, 0, 0, 0].numpy().astype(complex)
    cosine = math.cos(angle)
    return {"r": np.array([-xx, -xy / cosine, yx * cosine, yy]).view(float)}
