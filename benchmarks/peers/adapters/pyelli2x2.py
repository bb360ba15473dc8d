"""pyElli with Solver2x2, which is for isotropic stacks."""

import elli

import adapters.pyelli_any as any_solver


def values(case):
    return any_solver.values(case, elli.Solver2x2)
