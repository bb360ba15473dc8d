"""Report, corner plot and NetCDF file of a posterior."""

from __future__ import annotations

import os
import warnings
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pellicle.files import check_space, replacing
from pellicle.reporting.drawable import labelled
from pellicle.reporting.json_record import one_line, posterior_to_json, to_json
from pellicle.reporting.matplotlib_figure import BLUE, new_figure
from pellicle.reporting.plain_text import block, table, wrapped
from pellicle.sampling.result import Marginal, Posterior, verdict

if TYPE_CHECKING:
    from arviz import InferenceData
    from matplotlib.figure import Figure

    from pellicle.sampling.result import Prediction

MARGINAL = ("median", "2.5 %", "97.5 %", "mean", "sd")
"""Numbers of the marginal of a parameter."""
_LEAST_MASS = 0.005
"""Minima with less of the posterior are not listed."""


def posterior_report(posterior: Posterior) -> str:
    """Format the block that follows a fit's report: verdict, marginals, minima and checks."""
    lines = wrapped(verdict(posterior))
    if posterior.trusted:
        lines += ["", *_marginals(posterior)]
    checks, walkers = posterior.checks, posterior.draws.shape[1]
    lines += [
        "",
        *wrapped(
            f"{walkers} walkers, {checks.steps} steps, {checks.discard} of them burn-in:"
            f" {checks.n_over_tau:.0f} autocorrelation times, about {checks.independent} independent draws;"
            f" split R̂ {checks.rhat:.3f}; {100 * checks.acceptance:.0f} % of moves accepted;"
            f" {checks.minima_visited} of {checks.minima_found} minima that matter visited."
        ),
    ]
    return block("Posterior", lines)


def _marginals(posterior: Posterior) -> list[str]:
    head = ("", *MARGINAL, "")
    rows = [
        (m.name, *(_number(x, m) for x in (m.q50, m.q025, m.q975, m.mean)), f"{m.sd:.2g}", m.unit)
        for m in posterior.parameters.values()
    ]
    lines = table([head, *rows])
    lead = next(iter(posterior.parameters.values()))
    several = [mode for mode in lead.modes if mode.mass >= _LEAST_MASS]
    if len(several) > 1:
        near = f"{lead.name} near"
        rows = [(near, _number(mode.value, lead), f"{100 * mode.mass:.1f} %") for mode in several]
        lines += ["", *table([("minimum", "", "share"), *rows])]
    return lines


def _number(x: float, m: Marginal) -> str:
    """The number to two digits of the standard deviation."""
    digits = 6 if not m.sd > 0 else int(np.clip(1 - np.floor(np.log10(m.sd)), 0, 12))
    return f"{x:.{digits}f}"


def corner_figure(posterior: Posterior) -> Figure:
    """Draw the marginal of every parameter and the joint density of every pair.

    A parameter that no walker moved is left out.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it imports ArviZ, which warns of its next version
        import corner

    size = len(posterior.names)
    labels = [labelled(name, posterior.fit.parameters[name].unit) for name in posterior.names]
    figure = new_figure(2.4 * size + 1.2, 2.4 * size + 1.2, constrained=False)
    flat = posterior.draws.reshape(-1, size)
    moving = np.ptp(flat, axis=0) > 0
    corner.corner(
        flat[:, moving],
        labels=[label for label, moves in zip(labels, moving, strict=True) if moves],
        fig=figure,
        bins=40,
        quantiles=[0.025, 0.5, 0.975],
        color=BLUE,
        plot_datapoints=False,
        fill_contours=True,
        levels=(0.393, 0.865),  # one and two standard deviations of a normal distribution in the plane
        label_kwargs={"fontsize": 9},
    )
    return figure


_OVERHEAD = 1.1, 2**19
"""Most of what HDF5 adds to the arrays: a share for chunks, and bytes for attributes and groups."""


def write_netcdf(
    path: str | os.PathLike[str],
    posterior: Posterior,
    predictions: tuple[Prediction, ...],
    *,
    overwrite: bool = False,
) -> Path:
    """Write a posterior as NetCDF: draws in the parameters' units, one chain for each walker.

    Groups: posterior, sample_stats (lp), posterior_predictive (repeated measurements), observed_data. An
    untrusted chain is written too, with its attribute `trusted` 0. Other attributes: `data_path` and
    `data_sha256`, `scene`, `pellicle_version` and `date`, the JSON records of the `fit` and, as
    `record`, of the posterior. Raises UsageError where the file exists, without `overwrite`, or cannot be
    written, DataError for a full disk.
    """
    target = Path(path)
    data = inference_data(posterior, predictions)
    size = sum(data[group].nbytes for group in data.groups())
    with replacing(target, overwrite=overwrite) as draft:
        check_space(draft, int(_OVERHEAD[0] * size) + _OVERHEAD[1])  # HDF5 crashes where a disk is full
        data.to_netcdf(str(draft), engine="h5netcdf")
    return target


def inference_data(posterior: Posterior, predictions: tuple[Prediction, ...]) -> InferenceData:
    """Convert a posterior and its predictions to ArviZ's InferenceData."""
    from pellicle.sampling.chain import arviz

    by_walker = np.moveaxis(posterior.draws, 0, 1)
    fit = to_json(posterior.fit)
    data = fit["data"] if posterior.fit.joint else [fit["data"]]
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "More chains .* than draws")  # walkers, of a chain that is short
        return arviz().from_dict(
            posterior={name: by_walker[:, :, i] for i, name in enumerate(posterior.names)},
            sample_stats={"lp": posterior.log_density.T},
            posterior_predictive={p.name: p.noisy[None] for p in predictions},
            observed_data={p.name: p.data for p in predictions},
            coords={p.axis.name: p.axis.values for p in predictions},
            dims={p.name: [p.axis.name] for p in predictions},
            attrs={
                "inference_library": "pellicle",
                "date": datetime.now(UTC).isoformat(timespec="seconds"),
                "pellicle_version": fit["versions"]["pellicle"],
                "data_path": "; ".join(part["path"] for part in data),
                "data_sha256": "; ".join(part["sha256"] for part in data),
                "scene": str(posterior.fit.scene),
                "fit": one_line(fit),
                "trusted": int(posterior.trusted),
                "doubts": "; ".join(posterior.checks.doubts),
                "record": one_line(posterior_to_json(posterior)),
            },
        )
