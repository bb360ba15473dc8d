"""Derivatives by central differences, against which those by automatic differentiation are tested."""

from collections.abc import Callable
from typing import Any

import jax
import numpy as np


def derivative(function: Callable[[Any], Any], at: Any, step: Any) -> np.ndarray:
    """The slope where a step moves all of `at`."""
    return (np.asarray(function(at + step)) - np.asarray(function(at - step))) / (2 * step)


def jacobian(function: Callable[[Any], Any], at: Any, step: Any) -> np.ndarray:
    """Slopes in each of the numbers `at` (n,), along a new last axis; one step for all, or one for each."""
    at = np.asarray(at)
    steps = np.broadcast_to(step, at.shape)
    sides = ((at + h * axis, at - h * axis, 2 * h) for h, axis in zip(steps, np.eye(len(at)), strict=True))
    return np.stack(
        [(np.asarray(function(up)) - np.asarray(function(down))) / h for up, down, h in sides], -1
    )


def with_slopes(function: Callable[[Any], Any]) -> Callable[[Any], tuple[Any, Any]]:
    """Compile a function and its slopes as one program, which traces the function once: (slopes, value)."""
    return jax.jit(jax.jacfwd(lambda x: (function(x),) * 2, has_aux=True))
