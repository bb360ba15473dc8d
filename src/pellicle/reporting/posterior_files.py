"""A posterior as files: the fit's own, and beside them chain, NetCDF and two figures."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from pellicle.files import MARKER, new_folder, replacing, write_text
from pellicle.reporting.folders import write_brdf_fit, write_fit
from pellicle.reporting.json_record import brdf_to_json, indented, number, one_line, to_json, versions

if TYPE_CHECKING:
    from pellicle.fitting.result import Fit
    from pellicle.sampling.predict import Prediction
    from pellicle.sampling.result import Marginal, Posterior

CHAIN = "chain.h5"
CHAIN_SCHEMA = "pellicle.chain/1"


def chain_in(folder: str | os.PathLike[str]) -> Path:
    """Where the chain of a fit in `folder` is kept; the folder is made and marked. Raises UsageError."""
    target = new_folder(folder)
    if not (target / MARKER).exists():
        begun = {"schema": CHAIN_SCHEMA, "status": "sampling", "versions": versions()}
        write_text(target / MARKER, indented(begun))
    return target / CHAIN


def record(fit: Fit, posterior: Posterior | None) -> dict[str, Any]:
    """A fit as a record of the schema, with its posterior where it has one."""
    found = _ways(fit).to_json(fit)
    return found if posterior is None else found | {"posterior": posterior_to_json(posterior)}


class _Ways(NamedTuple):
    """How a kind of fit is written: as a record, as text, and as files in a folder."""

    to_json: Callable[[Any], dict[str, Any]]
    report: Callable[[Any], str]
    write: Callable[[str | os.PathLike[str], Any], Path]


def _ways(fit: Fit) -> _Ways:
    if fit.layer_test is not None:
        from pellicle.reporting.brdf import brdf_report

        return _Ways(brdf_to_json, brdf_report, write_brdf_fit)
    from pellicle.reporting.fit_text import report

    return _Ways(to_json, report, write_fit)


def posterior_to_json(posterior: Posterior) -> dict[str, Any]:
    """A posterior as plain dictionaries; no numbers of parameters where the chain carries none."""
    c = posterior.checks
    shown = posterior.parameters
    return {
        "parameters": {name: _marginal(shown.get(name)) for name in posterior.marginals()},
        "checks": {
            "n_over_tau": number(c.n_over_tau),
            "rhat": number(c.rhat),
            "acceptance": number(c.acceptance),
            "minima_found": c.minima_found,
            "minima_visited": c.minima_visited,
            "steps": c.steps,
            "discard": c.discard,
            "walkers": posterior.draws.shape[1],
            "autocorrelation_time": number(c.autocorrelation_time),
            "independent": c.independent,
        },
        "trusted": c.trusted,
        "doubts": list(c.doubts),
    }


def _marginal(m: Marginal | None) -> dict[str, Any]:
    if m is None:
        return {**dict.fromkeys(("mean", "sd", "q025", "q50", "q975")), "modes": []}
    return {
        "mean": m.mean,
        "sd": m.sd,
        "q025": m.q025,
        "q50": m.q50,
        "q975": m.q975,
        "modes": [{"value": mode.value, "mass": mode.mass} for mode in m.modes],
    }


def text(fit: Fit, posterior: Posterior | None) -> str:
    """The report of a fit, with its posterior's under it."""
    if posterior is None:
        return _ways(fit).report(fit)
    from pellicle.reporting.posterior import posterior_report

    return _ways(fit).report(fit) + posterior_report(posterior)


def write(folder: str | os.PathLike[str], fit: Fit, posterior: Posterior | None) -> Path:
    """Write a fit's files, and its posterior's where it has one; returns the folder. Raises UsageError."""
    return _ways(fit).write(folder, fit) if posterior is None else write_posterior(folder, posterior)


def write_posterior(folder: str | os.PathLike[str], posterior: Posterior) -> Path:
    """Write the fit's own files, and posterior.nc, corner.png and predictive.png; returns the folder.

    result.json and report.txt hold the posterior too. Raises UsageError as `write_fit` does.
    """
    from pellicle.reporting.posterior import corner_figure, predictive_figure

    target = _ways(posterior.fit).write(folder, posterior.fit)
    predicted = posterior.predictions()
    write_text(target / MARKER, indented(record(posterior.fit, posterior)), overwrite=True)
    write_text(target / "report.txt", text(posterior.fit, posterior), overwrite=True)
    write_netcdf(target / "posterior.nc", posterior, predicted, overwrite=True)
    corner_figure(posterior, target / "corner.png", overwrite=True)
    predictive_figure(posterior, predicted, target / "predictive.png", overwrite=True)
    return target


def write_netcdf(
    path: str | os.PathLike[str],
    posterior: Posterior,
    predicted: tuple[Prediction, ...],
    *,
    overwrite: bool = False,
) -> Path:
    """Write ArviZ's InferenceData as NetCDF: draws in the parameters' units, each walker a chain.

    Groups: posterior, sample_stats (lp), posterior_predictive (repeated measurements), observed_data. An
    untrusted chain is written too, its attribute `trusted` 0. Raises UsageError where it cannot be.
    """
    target = Path(path)
    data = inference_data(posterior, predicted)
    with replacing(target, overwrite=overwrite) as draft:
        data.to_netcdf(str(draft), engine="h5netcdf")
    return target


def inference_data(posterior: Posterior, predicted: tuple[Prediction, ...]) -> Any:
    """The posterior as ArviZ's InferenceData."""
    from pellicle.sampling.checks import arviz

    by_walker = np.moveaxis(posterior.draws, 0, 1)
    axes = {found.axis.name: found.axis.values for found in predicted}
    attributes = {
        "inference_library": "pellicle",
        "trusted": int(posterior.trusted),
        "doubts": "; ".join(posterior.checks.doubts),
        "record": one_line(posterior_to_json(posterior)),
    }
    return arviz().from_dict(
        posterior={name: by_walker[:, :, i] for i, name in enumerate(posterior.names)},
        sample_stats={"lp": posterior.log_density.T},
        posterior_predictive={found.name: found.noisy[None] for found in predicted},
        observed_data={found.name: found.data for found in predicted},
        coords=axes,
        dims={found.name: [found.axis.name] for found in predicted},
        attrs=attributes,
    )
