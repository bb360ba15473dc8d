"""Numbers tied to the parameters of a fit: their values and errors by the gradient of the expression."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import jax
import numpy as np

from pellicle.fitting.result import Estimate
from pellicle.scene import expressions
from pellicle.scene.expressions import Expression


class TiedNumber(NamedTuple):
    """A number of a scene that is an expression of parameters: its text, and its tree of their full names."""

    name: str
    unit: str
    lower: float
    upper: float
    text: str
    expression: Expression


def estimate(
    tied: TiedNumber, parameters: Mapping[str, Estimate], names: Sequence[str], correlation: np.ndarray
) -> Estimate:
    """The estimate of a tied number: value, and errors √(gᵀ C g) with the gradient g of its expression.

    C is the covariance of the parameters by their standard errors and the `correlation` (parameters and
    nuisances, twice) of `names`. The error is infinite where it depends on a parameter whose own is.
    """
    takes = [str(x) for x in expressions.names(tied.expression)]
    own = [parameters[name] for name in takes]
    at = {p.name: float(p.value) for p in own}

    def of(numbers: Mapping[str, Any]) -> Any:
        return expressions.value(tied.expression, numbers.__getitem__) + 0.0

    slopes = jax.grad(of)(at) if takes else {}
    slope = np.array([float(slopes[name]) for name in takes])
    rows = [list(names).index(name) for name in takes]
    common = np.asarray(correlation)[np.ix_(rows, rows)]

    def error(stderr: list[float]) -> float:
        each = np.array(stderr)
        if np.any(np.isinf(each) & (slope != 0)):
            return np.inf
        change = slope * np.where(np.isinf(each), 0.0, each)
        return float(np.sqrt(max(change @ common @ change, 0.0)))

    return Estimate(
        tied.name,
        float(of(at)),
        error([p.stderr for p in own]),
        tied.unit,
        tied.lower,
        tied.upper,
        False,
        stderr_noise=error([p.stderr_noise for p in own]),
        degrees_of_freedom=min((p.degrees_of_freedom for p in own), default=np.inf),
        tied=tied.text,
    )
