"""tmm_fast: `coh_tmm` on torch tensors of complex128, metres and radians, n + ik."""

import numpy as np
import torch
from tmm_fast import coh_tmm

from adapters.by_torch import by_autograd, leaves


def _signals(p):
    index = torch.stack([torch.complex(*p[medium]) for medium in ("ambient", "layer", "substrate")])
    infinite = torch.tensor(np.inf, dtype=torch.float64)
    depth = torch.stack([infinite, p["thickness"] * 1e-9, infinite])
    found = {}
    for letter in "sp":
        answer = coh_tmm(
            letter,
            index[None, :, None],
            depth[None, :],
            torch.deg2rad(p["angle"])[None],
            p["wavelength"][None] * 1e-9,
        )
        found |= {kind + letter: answer[kind].reshape(()) for kind in "RT"}
    return found


def values(case):
    return {signal: [x.item()] for signal, x in _signals(leaves(case, torch.float64)).items()}


def slopes(case):
    return by_autograd(_signals, case, torch.float64)
