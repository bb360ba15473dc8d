"""Shared by the packages on torch: a case as leaf tensors, and reverse-mode derivatives."""

import torch
from cases import FREE


def leaves(case, dtype):
    """Return {parameter: tensor}, with each medium as a pair of n and k."""
    p = {name: torch.tensor(x, dtype=dtype, requires_grad=True) for name, x in case.items()}
    zero = torch.zeros((), dtype=dtype)
    p["ambient"] = p["ambient_n"], zero
    return p | {medium: (p[medium + "_n"], p[medium + "_k"]) for medium in ("layer", "substrate")}


def by_autograd(signals, case, dtype):
    """Return {signal: derivatives in FREE}; 0 for a parameter without influence."""
    p = leaves(case, dtype)
    wanted = [p[name] for name in FREE]
    found = {}
    for signal, x in signals(p).items():
        columns = torch.autograd.grad(x, wanted, retain_graph=True, allow_unused=True)
        found[signal] = [0.0 if c is None else c.item() for c in columns]
    return found
