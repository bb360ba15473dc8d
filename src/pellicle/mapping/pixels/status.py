"""Status of each pixel: the first that holds, by the rules of `fitting.status.judge`."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pellicle.fitting.parameter import Parameter
from pellicle.fitting.result import Status
from pellicle.fitting.status import RIVAL, WELL_KNOWN
from pellicle.mapping.pixels.results import CODES

_ON_BOUND = 1e-6


def judge(
    parameters: Sequence[Parameter],
    values: np.ndarray,
    stderr: np.ndarray,
    converged: np.ndarray,
    misfit: np.ndarray,
    rivals: np.ndarray,
    delta_chi2: np.ndarray,
) -> np.ndarray:
    """Codes of the status (pixels,) from `values` and `stderr` (pixels, parameters).

    `rivals` (pixels, orders, parameters) are other minima, `delta_chi2` (pixels, orders) how much worse they
    are, infinite where there are none.
    """
    own = np.array([not p.name.startswith("instrument.") for p in parameters], bool)
    depth = own & np.array([p.name.split(".")[-1] == "thickness" for p in parameters], bool)
    unseen = ~np.isfinite(stderr)
    if depth.any():
        not_seen = unseen[:, depth].any(axis=1)
    else:
        not_seen = unseen[:, own].all(axis=1) if own.any() else np.zeros(len(values), bool)
    close = (delta_chi2 < RIVAL) & _outside(values, stderr, rivals)
    return np.select(
        [~converged, misfit, not_seen, close.any(axis=1), _at_bound(parameters, values, stderr, own, depth)],
        [
            CODES[str(status)]
            for status in (
                Status.NOT_CONVERGED,
                Status.MISFIT,
                Status.NOT_IDENTIFIABLE,
                Status.AMBIGUOUS,
                Status.AT_BOUND,
            )
        ],
        CODES[str(Status.CONVERGED)],
    ).astype(np.uint8)


def _outside(values: np.ndarray, stderr: np.ndarray, rivals: np.ndarray) -> np.ndarray:
    """Rivals (pixels, orders) that lie outside the errors of the answer."""
    finite = np.isfinite(stderr)
    reach = np.where(finite, 3 * stderr, np.inf)
    return np.any(np.abs(rivals - values[:, None]) > reach[:, None], axis=2)


def _at_bound(
    parameters: Sequence[Parameter],
    values: np.ndarray,
    stderr: np.ndarray,
    own: np.ndarray,
    depth: np.ndarray,
) -> np.ndarray:
    """Pixels of which a parameter of the sample rests on a bound that matters."""
    result, depths = np.zeros(len(values), bool), np.flatnonzero(depth).tolist()
    lead = depths[0] if len(depths) else int(np.argmax(own))
    for i in np.flatnonzero(own).tolist():
        p, value = parameters[i], values[:, i]
        margin = np.minimum(value - p.lower, p.upper - value)
        resting = (margin <= _ON_BOUND * (p.upper - p.lower)) & (not p.periodic)
        if p.natural[0] and p.lower == 0 and p.key != "thickness":
            resting &= value > _ON_BOUND * p.upper
        if p.natural[1] and p.upper == 1:
            resting &= value < 1 - _ON_BOUND * (1 - p.lower)
        if p.limits is not None:
            # a default bound beside a thickness that is well determined is a remark
            if i in depths or not len(depths):
                remark = np.full(len(values), i != lead and not len(depths))
            else:
                layer = {j: parameters[j].name.removesuffix("thickness") for j in depths}
                near = [j for j, name in layer.items() if p.name.startswith(name)] or depths
                remark = np.all(stderr[:, near] <= WELL_KNOWN * values[:, near], axis=1)
            resting &= ~remark
        result |= resting
    return result
