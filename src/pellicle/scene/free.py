"""Free parameters: they stand in a pytree wherever its number would."""

from __future__ import annotations

import math
from typing import Any, final

import equinox as eqx
import jax
import numpy as np


@final
class Normal(eqx.Module):
    """A normal prior on a free parameter, in the parameter's unit; its bounds cut it off."""

    mean: float = eqx.field(static=True)
    sd: float = eqx.field(static=True)

    def __check_init__(self):
        _positive(self.sd)

    @property
    def row(self) -> tuple[float, float]:
        """What least squares take: the mean, and the weight 1/sd of the distance from it."""
        return self.mean, 1 / self.sd


@final
class HalfNormal(eqx.Module):
    """A normal prior around zero for a parameter that is never negative: a roughness, an extinction."""

    sd: float = eqx.field(static=True)

    def __check_init__(self):
        _positive(self.sd)

    @property
    def row(self) -> tuple[float, float]:
        return 0.0, 1 / self.sd


@final
class LogUniform(eqx.Module):
    """Every factor of two is as likely as any other between the bounds, which must be above zero.

    For posteriors only: the best fit is the one in the logarithm of the parameter, where this is flat.
    """

    @property
    def row(self) -> tuple[float, float]:
        return 0.0, 0.0


Prior = Normal | HalfNormal | LogUniform


def _positive(sd: float) -> None:
    if not sd > 0:
        raise ValueError(f"a prior's standard deviation must be positive, not {sd}")


@final
class Free(eqx.Module):
    """A parameter to be fitted, placed where its number would stand.

    **Arguments:** `lower` and `upper` bounds, `start` value (the middle of the bounds if None) and `prior`
    (uniform between the bounds if None), all in the parameter's own unit.

    **Raises:** ValueError where bounds are reversed or infinite, or the start or the prior is outside them.

    ```python
    >>> Free(10, 3000).start
    1505.0

    ```
    """

    lower: float = eqx.field(static=True)
    upper: float = eqx.field(static=True)
    start: float = eqx.field(static=True)
    prior: Prior | None

    def __init__(self, lower: float, upper: float, *, start: float | None = None, prior: Prior | None = None):
        if not lower < upper:
            raise ValueError(f"bounds are reversed or equal: lower {lower:g} is not below upper {upper:g}")
        if not (math.isfinite(lower) and math.isfinite(upper)):
            raise ValueError("a free parameter needs two finite bounds: give lower and upper")
        start = 0.5 * (lower + upper) if start is None else start
        if not lower <= start <= upper:
            raise ValueError(f"the start value {start:g} is outside its bounds {lower:g} to {upper:g}")
        _check_prior(prior, lower, upper)
        self.lower, self.upper, self.start, self.prior = float(lower), float(upper), float(start), prior


def _check_prior(prior: Prior | None, lower: float, upper: float) -> None:
    if isinstance(prior, Normal) and not lower <= prior.mean <= upper:
        raise ValueError(f"the prior's mean {prior.mean:g} is outside the bounds {lower:g} to {upper:g}")
    if isinstance(prior, HalfNormal) and not lower <= 0 < upper:
        raise ValueError(f"a half-normal prior starts at 0, outside the bounds {lower:g} to {upper:g}")
    if isinstance(prior, LogUniform) and not lower > 0:
        raise ValueError(f"a log-uniform prior needs a lower bound above 0, not {lower:g}")


def is_free(leaf: Any) -> bool:
    """True for a `Free`, which a pytree's traversal must take as one leaf."""
    return isinstance(leaf, Free)


def free_leaves(tree: Any) -> list[tuple[Any, Free]]:
    """(path, Free) for every free parameter in a pytree, in the pytree's own order."""
    leaves = jax.tree_util.tree_leaves_with_path(tree, is_leaf=is_free)
    return [(path, leaf) for path, leaf in leaves if is_free(leaf)]


def insert(tree: Any, values: Any) -> Any:
    """The pytree with its free parameters replaced by `values`, in the order of `free_leaves`."""
    leaves, structure = jax.tree_util.tree_flatten(tree, is_leaf=is_free)
    numbers = iter(values)
    return jax.tree_util.tree_unflatten(structure, [next(numbers) if is_free(x) else x for x in leaves])


def start_values(tree: Any) -> np.ndarray:
    """The start value of each free parameter, shape (parameters,)."""
    return np.array([free.start for _, free in free_leaves(tree)])
