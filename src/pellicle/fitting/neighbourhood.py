"""The misfit around the best minimum of a fit, in the parameters' own units."""

import numpy as np

from pellicle.fitting.evaluation import total_deviance
from pellicle.fitting.minima import deviance_at, solve
from pellicle.fitting.profile_likelihood import Neighbourhood
from pellicle.fitting.reweighting import RankedMinima

_SETTLED = 0.03
"""Square root of the change of χ² that does not matter to a limit at a rise of 2.7 and more."""


def neighbourhood(ranked: RankedMinima, covariance: np.ndarray, others: np.ndarray) -> Neighbourhood:
    """Neighbourhood of the best of the ranked minima.

    `covariance` has the problem's parameters first; `others` (points, parameters) are further minima, in the
    parameters' own units.
    """
    values = ranked.values
    pairs = zip(ranked.problem.views, ranked.fits, strict=True)
    counted = ranked.problem._replace(views=tuple(view.counting(1 / fit.variance) for view, fit in pairs))
    own = counted.in_own_units(values)
    thinned, box = own.thinned(), own.box
    # a program that the fit has compiled: that of its scan, or that of its polish
    as_scanned = ranked.minima.scan is not None and thinned.views == own.views
    as_polished = not as_scanned and own.coordinates == ranked.problem.coordinates
    lower, span = np.asarray(box.lower), np.asarray(box.upper) - np.asarray(box.lower)
    every = np.clip(np.vstack([values, *others]), lower, box.upper)

    def misfit(which: np.ndarray, at: np.ndarray) -> np.ndarray:
        units = (at[0] - lower) / span
        return (deviance_at(own, units) if as_polished else total_deviance(thinned, units))[None]

    def profile(
        which: np.ndarray, axis: np.ndarray, values: np.ndarray, starts: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        deviance, points = np.empty(len(values)), np.empty(starts[:, 0].shape)
        for each in np.unique(axis).tolist():
            rows = np.flatnonzero(axis == each)
            units = (starts[rows] - lower) / span
            held = np.repeat(values[rows], units.shape[1])
            result = solve(own, units.reshape(len(held), -1), fixed=(each, held), atol=_SETTLED)
            deviances = result.deviance.reshape(len(rows), -1)
            chosen = np.arange(len(rows)), np.argmin(deviances, axis=1)
            deviance[rows] = deviances[chosen]
            points[rows] = lower + result.units.reshape(units.shape)[chosen] * span
        return deviance, points

    count = len(values)
    return Neighbourhood(
        every[:1],
        lower,
        np.asarray(box.upper),
        covariance[None, :count, :count],
        np.reshape([p.natural for p in ranked.problem.parameters], (-1, 2)).astype(bool),
        misfit,
        profile,
        every[None, 1:],
    )
