"""What the data of a simulated measurement can show, by the independent model.

`bound` is the Cramér-Rao bound of the thickness for the noise alone, `evidence` the misfit that remains
of a flaw when the scene's free numbers have adapted to it. Neither uses pellicle.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from family import Bounds, Family, Theta
from scipy.optimize import least_squares

SHOWN = 9.0
"""Least misfit that residuals show: three standard deviations of its own pattern."""


def residuals(family: Family, found: np.ndarray, data: np.ndarray, sigma: np.ndarray) -> np.ndarray:
    """Data less model in standard deviations, after the best scale and offset where these are free."""
    if family.view.signal == "psi-delta":
        return ((data - found + 180) % 360 - 180).ravel() / sigma.ravel()
    left = data / sigma
    columns = _linear(family, found, sigma)
    if columns is None:
        return left - found / sigma
    return left - columns @ np.linalg.lstsq(columns, left, rcond=None)[0]


def _linear(family: Family, found: np.ndarray, sigma: np.ndarray) -> np.ndarray | None:
    """Columns of a free scale and offset, polynomials in wavelength; None where both are fixed."""
    if family.gain is None:
        return None
    x = family.view.position
    scale = [found * x**j for j in range(family.gain + 1)]
    dark = [] if family.dark is None else [x**j for j in range(family.dark + 1)]
    return np.stack([*scale, *dark], axis=1) / sigma[:, None]


def bound(family: Family, theta: Theta, data: np.ndarray, sigma: np.ndarray) -> float:
    """Cramér-Rao bound of the thickness in nm at `theta`, which explains the noise-free `data` exactly.

    A free scale and offset have no prior here: where pellicle's have one, its errors may be smaller.
    """

    def at(point: np.ndarray) -> np.ndarray:
        return residuals(family, family.signal(tuple(point)), data, sigma)

    centre, columns = np.array(theta), []
    for i, value in enumerate(theta):
        step = np.zeros(len(theta))
        step[i] = 1e-5 * abs(value)
        columns.append((at(centre + step) - at(centre - step)) / (2 * step[i]))
    jacobian = np.stack(columns, axis=1)
    size = np.linalg.norm(jacobian, axis=0)
    if not np.all(size > 0):
        return np.inf
    unit = jacobian / size
    variance = np.linalg.pinv(unit.T @ unit, rcond=1e-14)[0, 0]
    return float(np.sqrt(variance) / size[0])


def adapted(
    family: Family, theta: Theta, data: np.ndarray, sigma: np.ndarray, bounds: Bounds | None = None
) -> Any:
    """Local least-squares fit of the scene's free numbers from `theta`, within `bounds`."""
    low, high = np.array(bounds or family.bounds, dtype=float).T
    start = np.clip(theta, low + 1e-9 * (high - low), high - 1e-9 * (high - low))
    return least_squares(
        lambda point: residuals(family, family.signal(tuple(point)), data, sigma),
        start,
        bounds=(low, high),
        x_scale=np.maximum(np.abs(start), 1e-3 * (high - low)),
        max_nfev=60,
    )


def evidence(family: Family, theta: Theta, data: np.ndarray, sigma: np.ndarray) -> float:
    """Sum of squared residuals, in standard deviations, of noise-free `data` at the minimum near `theta`."""
    return float(2 * adapted(family, theta, data, sigma).cost)


def least_evidence(
    family: Family, data: np.ndarray, sigma: np.ndarray, start: Theta, thicknesses: int = 300
) -> float:
    """The least `evidence` over all thicknesses within the bounds.

    A scan with the other numbers as in `start`, and local fits from its four lowest minima.
    """
    low, high = family.bounds[0]
    grid = np.geomspace(low, high, thicknesses) if high < 100 * low else np.linspace(low, high, thicknesses)
    cost = [float(np.sum(residuals(family, family.signal((d, *start[1:])), data, sigma) ** 2)) for d in grid]
    inner = [i for i in range(len(cost)) if cost[i] == min(cost[max(i - 1, 0) : i + 2])]
    fits = [
        adapted(family, (float(grid[i]), *start[1:]), data, sigma)
        for i in sorted(inner, key=cost.__getitem__)[:4]
    ]
    return float(2 * min(fit.cost for fit in fits))


def rival(family: Family, theta: Theta, data: np.ndarray, sigma: np.ndarray) -> float:
    """The least misfit of noise-free `data` with a thickness that is off by a fifth or more.

    The other free numbers adapt where there are any, at forty thicknesses; else a scan resolves fringes.
    """
    (low, high), (truth, *others) = family.bounds[0], theta
    grid = np.linspace(low, high, 1000)
    if others:
        grid = np.concatenate([np.geomspace(low, 0.8 * truth, 20), np.geomspace(1.2 * truth, high, 20)])
    found = [np.inf]
    for d in grid[np.abs(grid / truth - 1) >= 0.2]:
        at = (float(d), *others)
        if others:
            narrow = ((d * (1 - 1e-6), d * (1 + 1e-6)), *family.bounds[1:])
            found.append(float(2 * adapted(family, at, data, sigma, narrow).cost))
        else:
            found.append(float(np.sum(residuals(family, family.signal(at), data, sigma) ** 2)))
    return min(found)
