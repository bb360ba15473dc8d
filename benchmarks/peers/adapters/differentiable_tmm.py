"""differentiable_tmm: `TMM.tmm` in complex128, nanometres and degrees, n + ik."""

import torch
from differentiable_tmm import TMM

from adapters.by_torch import by_autograd, leaves


def _signals(p):
    index = torch.complex(*p["layer"]).reshape(1, 1)
    outside = torch.stack([torch.complex(*p["ambient"]), torch.complex(*p["substrate"])])[None]
    found = {}
    for letter in "sp":
        simulator = TMM.tmm(
            pol=letter,
            datatype="complex128",
            theta_array=p["angle"][None],
            wv_array=p["wavelength"][None],
        )
        answer = simulator(n=index, d=p["thickness"].reshape(1, 1), n0=outside, c_list=["c"])
        found |= {kind + letter: answer[kind].reshape(()) for kind in "RT"}
    return found


def values(case):
    return {signal: [x.item()] for signal, x in _signals(leaves(case, torch.float64)).items()}


def slopes(case):
    return by_autograd(_signals, case, torch.float64)
