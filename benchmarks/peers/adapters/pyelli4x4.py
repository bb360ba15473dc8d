"""pyElli with Solver4x4, its default."""

import elli

import adapters.pyelli_any as any_solver


def values(case):
    return any_solver.values(case, elli.Solver4x4)
