"""A posterior as text and as figures: marginals, minima, checks; corner plot and predictive band."""

from __future__ import annotations

import os
import warnings
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pellicle.reporting.drawing import BLACK, BLUE, ORANGE, blank, marker_size, saved
from pellicle.reporting.plain_text import block, table, wrapped
from pellicle.sampling.predict import Prediction
from pellicle.sampling.result import Marginal, Posterior, verdict

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_LEAST_MASS = 0.005
"""Minima with less of the posterior are not listed."""


def posterior_report(posterior: Posterior) -> str:
    """The posterior's block of the report, under the fit's own."""
    lines = wrapped(verdict(posterior))
    if posterior.trusted:
        lines += ["", *_marginals(posterior)]
    return block("Posterior", [*lines, "", *_checks(posterior)])


def _marginals(posterior: Posterior) -> list[str]:
    head = ("", "median", "2.5 %", "97.5 %", "mean", "sd", "")
    rows = [
        (m.name, *(_number(x, m) for x in (m.q50, m.q025, m.q975, m.mean)), f"{m.sd:.2g}", m.unit)
        for m in posterior.parameters.values()
    ]
    told = table([head, *rows])
    lead = next(iter(posterior.parameters.values()))
    several = [mode for mode in lead.modes if mode.mass >= _LEAST_MASS]
    if len(several) > 1:
        rows = [
            (f"{lead.name} near", _number(mode.value, lead), f"{100 * mode.mass:.1f} %") for mode in several
        ]
        told += ["", *table([("minimum", "", "share"), *rows])]
    return told


def _number(x: float, m: Marginal) -> str:
    """With two digits of the standard deviation."""
    digits = 6 if not m.sd > 0 else int(np.clip(1 - np.floor(np.log10(m.sd)), 0, 12))
    return f"{x:.{digits}f}"


def _checks(posterior: Posterior) -> list[str]:
    c = posterior.checks
    walkers = posterior.draws.shape[1]
    return wrapped(
        f"{walkers} walkers, {c.steps} steps, {c.discard} of them burn-in: {c.n_over_tau:.0f}"
        f" autocorrelation times, about {c.independent} independent draws; split R̂ {c.rhat:.3f};"
        f" {100 * c.acceptance:.0f} % of moves accepted; {c.minima_visited} of {c.minima_found} minima that"
        " matter visited."
    )


def corner_figure(posterior: Posterior, path: str | os.PathLike[str], *, overwrite: bool = False) -> Path:
    """Draw every pair of parameters into `path`. Raises UsageError where it cannot be written."""

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it imports ArviZ, which warns of its next version
        import corner

    size = len(posterior.names)
    units = [posterior.fit.parameters[name].unit for name in posterior.names]
    labels = [f"{name} ({unit})" if unit else name for name, unit in zip(posterior.names, units, strict=True)]
    sheet = blank(2.4 * size + 1.2, 2.4 * size + 1.2, constrained=False)
    flat = posterior.draws.reshape(-1, size)
    moving = np.ptp(flat, axis=0) > 0
    corner.corner(
        flat[:, moving],
        labels=[label for label, moves in zip(labels, moving, strict=True) if moves],
        fig=sheet,
        bins=40,
        quantiles=[0.025, 0.5, 0.975],
        color=BLUE,
        plot_datapoints=False,
        fill_contours=True,
        levels=(0.393, 0.865),  # one and two standard deviations of a normal distribution in the plane
        label_kwargs={"fontsize": 9},
    )
    return saved(sheet, path, overwrite=overwrite, bbox_inches="tight")


def predictive_figure(
    posterior: Posterior,
    predicted: tuple[Prediction, ...],
    path: str | os.PathLike[str],
    *,
    overwrite: bool = False,
) -> Path:
    """Draw the data over the band where 95 % of the model's curves, and of repeated data, lie."""

    sheet = blank(8.0, 0.6 + 3.0 * len(predicted))
    for axes, found in zip(np.ravel(sheet.subplots(len(predicted), squeeze=False)), predicted, strict=True):
        _band(axes, found)
    return saved(sheet, path, overwrite=overwrite)


def _band(axes: Axes, found: Prediction) -> None:
    order = np.argsort(found.axis.values, kind="stable")
    at = found.axis.values[order]
    for draws, alpha, name in ((found.noisy, 0.25, "repeated measurements"), (found.model, 0.8, "model")):
        low, high = np.quantile(draws, [0.025, 0.975], axis=0)[:, order]
        axes.fill_between(at, low, high, color=ORANGE, alpha=alpha, linewidth=0, label=f"{name}, 95 %")
    axes.plot(at, found.data[order], ".", color=BLACK, markersize=marker_size(len(at)), label="data")
    axes.set_xlabel(found.axis.label)
    axes.set_ylabel(found.label)
    axes.set_yscale("log" if found.decades else "linear")
    axes.legend(frameon=False, fontsize="small")
