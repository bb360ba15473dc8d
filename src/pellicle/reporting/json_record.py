"""JSON record of a fit and its posterior: one strict schema, null for infinite and undefined numbers."""

from __future__ import annotations

import json
import math
import os
import sys
from collections.abc import Mapping, Sequence
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from pellicle.fitting.result import Estimate, Fit, Part, SystematicEffect
    from pellicle.forward_model.plan import Row
    from pellicle.sampling.result import Marginal, Posterior

SCHEMA = "pellicle.fit/1"
ERROR_SCHEMA = "pellicle.error/1"

_PACKAGES = ("jax", "optimistix", "numpy")


def to_json(fit: Fit, posterior: Posterior | None = None) -> dict[str, Any]:
    """Convert a fit, and its posterior if there is one, to dictionaries of the schema.

    Infinite and undefined numbers are None. A joint fit has a list as `data` and `noise`; a fit of BRDF
    samples has the layer test.
    """
    matrix = np.asarray(fit.correlation, dtype=float)
    noise = [{"sigma": number(part.sigma), "source": part.sigma_from} for part in fit.parts]
    record = {
        "schema": SCHEMA,
        "data": [_joint_part(part, fit) for part in fit.parts] if fit.joint else _data(fit.parts[0], fit),
        "status": str(fit.status),
        "verdict": fit.verdict,
        "parameters": {name: _parameter(p) for name, p in fit.parameters.items()},
        "rivals": [
            {
                "parameters": {name: number(value) for name, value in rival.parameters.items()},
                "delta_chi2": number(rival.delta_chi2),
                **_probability(rival.probability),
                **_errors(rival.stderr),
            }
            for rival in fit.rivals
        ],
        "chi2_reduced": number(fit.chi2_reduced),
        "rms": None if fit.rms is None else number(fit.rms),
        "effective_points": number(fit.effective_points),
        "correlation": {
            "names": list(fit.correlation_names),
            "matrix": [[number(value) for value in row] for row in matrix],
        },
        "budget": [_systematic(effect) for effect in fit.budget],
        "plan": [_effect(row, part.name) for part in fit.parts for row in part.plan.rows],
        "warnings": list(fit.warnings),
        "versions": versions(),
        "seconds": number(fit.seconds),
        "noise": noise if fit.joint else noise[0],
        **_probability(fit.probability),
        **_layer_test(fit),
    }
    return record if posterior is None else record | {"posterior": posterior_to_json(posterior)}


def _probability(share: float | None) -> dict[str, Any]:
    """Share of the posterior of a minimum, where it was computed."""
    return {} if share is None else {"probability": number(share)}


def _errors(stderr: Mapping[str, float] | None) -> dict[str, Any]:
    """Standard errors of a minimum by name, where they were computed."""
    return {} if stderr is None else {"stderr": {name: number(value) for name, value in stderr.items()}}


def _data(part: Part, fit: Fit) -> dict[str, Any]:
    data = part.data
    columns = getattr(data, "elements", ()) or getattr(data, "ratios", ())
    return {
        "path": data.path,
        "sha256": data.sha256,
        "signal": getattr(data, "space", getattr(data, "signal", "brdf")),
        "points": len(part.curve.model) if columns else int(part.curve.model.size),
        **({"ratios": list(columns)} if getattr(data, "ratios", ()) else {}),
        **_azimuths(data),
        **({"spectrum": name} if (name := getattr(data, "name", "")) else {}),
        **_depolarisation(part),
        **_sweeps(part, fit),
    }


def _azimuths(data: Any) -> dict[str, Any]:
    """Azimuths of the sample, where the data have them."""
    azimuth = getattr(data, "azimuth", None)
    return {} if azimuth is None else {"azimuths_deg": [float(own) for own in np.unique(azimuth)]}


def _depolarisation(part: Part) -> dict[str, Any]:
    """Mean of a measured depolarisation and of its model, and the rms of the residuals."""
    data, model = (getattr(part.curve, f"depolarisation_{x}", None) for x in ("data", "model"))
    if data is None or model is None:
        return {}
    numbers = {
        "mean": number(np.mean(data)),
        "model": number(np.mean(model)),
        "rms": number(np.sqrt(np.mean(part.spectral.depolarisation_residual**2))),
    }
    return {"depolarisation": numbers}


def _sweeps(part: Part, fit: Fit) -> dict[str, Any]:
    """The scatter of repeated sweeps, and the lack of fit of their mean."""
    from pellicle.fitting.lack_of_fit import lack_of_fit  # imports JAX, which records of failures do not need

    lack = lack_of_fit(part, len(fit.free))
    if lack is None:
        return {}
    numbers = {
        "number": lack.sweeps,
        "sd": number(lack.repeatability),
        "lack_of_fit": number(lack.ratio),
        "degrees_of_freedom": [int(x) for x in lack.freedom],
        "probability": number(lack.probability),
    }
    return {"sweeps": numbers}


def _joint_part(part: Part, fit: Fit) -> dict[str, Any]:
    """One spectrum of a joint fit: its name, which its own parameters end in, and its fit quality."""
    return {
        "name": part.name,
        **_data(part, fit),
        "rms": number(part.rms),
        "chi2_reduced": number(part.chi2_reduced),
        "effective_points": number(part.effective_points),
    }


def _systematic(effect: SystematicEffect) -> dict[str, Any]:
    """A row of the uncertainty budget."""
    return {
        "effect": effect.name,
        "uncertainty": number(effect.uncertainty),
        "unit": effect.unit,
        "changes": {name: number(value) for name, value in effect.changes.items()},
        "amount": number(effect.amount),
        "explains": number(effect.explains),
    }


def _effect(row: Row, name: str) -> dict[str, Any]:
    """A row of a plan, with the name of the spectrum in a joint fit."""
    return {
        **({"name": name} if name else {}),
        "effect": row.effect,
        "on": bool(row.on),
        "why": row.why,
        "error_bound": number(row.error_bound),
    }


def _layer_test(fit: Fit) -> dict[str, Any]:
    """The surface's model and its errors on held-out BRDF samples beside those of the baselines."""
    test = fit.layer_test
    if test is None:
        return {}
    return {
        "model": fit.surface.model,
        "residual": test.residual,
        "layered": test.layered,
        "held_out": number(test.held_out),
        "baselines": [{"name": b.name, "held_out": number(b.held_out)} for b in test.baselines],
    }


def posterior_to_json(posterior: Posterior) -> dict[str, Any]:
    """Convert a posterior to dictionaries; the parameters have no numbers where the chain is not trusted."""
    checks, trusted = posterior.checks, posterior.parameters
    return {
        "parameters": {name: _marginal(trusted.get(name)) for name in posterior.marginals()},
        "checks": {
            "n_over_tau": number(checks.n_over_tau),
            "rhat": number(checks.rhat),
            "acceptance": number(checks.acceptance),
            "minima_found": checks.minima_found,
            "minima_visited": checks.minima_visited,
            "steps": checks.steps,
            "discard": checks.discard,
            "walkers": posterior.draws.shape[1],
            "autocorrelation_time": number(checks.autocorrelation_time),
            "independent": checks.independent,
        },
        "trusted": checks.trusted,
        "doubts": list(checks.doubts),
    }


def _marginal(marginal: Marginal | None) -> dict[str, Any]:
    if marginal is None:
        return {**dict.fromkeys(("mean", "sd", "q025", "q50", "q975")), "modes": []}
    numbers = {name: getattr(marginal, name) for name in ("mean", "sd", "q025", "q50", "q975")}
    return numbers | {"modes": [{"value": mode.value, "mass": mode.mass} for mode in marginal.modes]}


def failure(
    path: str | os.PathLike[str] | Sequence[str], error: Exception | str, sha256: str | None = None
) -> dict[str, Any]:
    """Build the record of a file, or of several files of a joint fit, without a result.

    It has all keys of the schema, the status "failed" and the `error`.
    """
    alone = isinstance(path, str | os.PathLike)
    paths = [os.fspath(path)] if isinstance(path, str | os.PathLike) else list(path)
    data = [{"path": name, "sha256": sha256, "signal": None, "points": 0} for name in paths]
    return {
        "schema": SCHEMA,
        "data": data[0] if alone else data,
        "status": "failed",
        "verdict": "No fit was made.",
        "error": str(error),
        "parameters": {},
        "rivals": [],
        "chi2_reduced": None,
        "rms": None,
        "effective_points": None,
        "correlation": {"names": [], "matrix": []},
        "budget": [],
        "plan": [],
        "warnings": [],
        "versions": versions(),
        "seconds": 0.0,
    }


def error_record(error: str, exit_code: int) -> dict[str, Any]:
    """Build the record of a command that an error in its arguments or recipe ended, before any result."""
    return {"schema": ERROR_SCHEMA, "status": "failed", "error": error, "exit_code": exit_code}


def one_line(record: Mapping[str, Any]) -> str:
    """Format a record as one line of strict JSON, in ASCII so that every terminal and pipe takes it."""
    return json.dumps(record, allow_nan=False)


def indented(record: Mapping[str, Any]) -> str:
    """Format a record as the text of a file, indented for readers."""
    return json.dumps(record, allow_nan=False, ensure_ascii=False, indent=1) + "\n"


@cache
def versions() -> Mapping[str, str | None]:
    """Versions of pellicle, Python and the packages that numbers depend on, without importing them."""
    installed: dict[str, str | None] = {
        "pellicle": version("pellicle"),
        "python": ".".join(map(str, sys.version_info[:3])),
    }
    for name in _PACKAGES:
        try:
            installed[name] = version(name)
        except PackageNotFoundError:
            installed[name] = None
    return installed


def number(value: Any) -> float | None:
    """The number as the schema has it: None where it is infinite or undefined."""
    return float(value) if math.isfinite(value) else None


def _parameter(p: Estimate) -> dict[str, Any]:
    written = {
        "value": number(p.value),
        "stderr": number(p.stderr),
        "stderr_noise": number(p.stderr_noise),
        "expanded": number(p.expanded),
        "coverage_factor": number(p.coverage_factor),
        "degrees_of_freedom": number(p.effective_degrees_of_freedom),
        "unit": p.unit,
        "lower": number(p.lower),
        "upper": number(p.upper),
        "free": bool(p.free),
    }
    limits = {"lower_limit": p.lower_limit, "upper_limit": p.upper_limit}
    return written | {name: number(value) for name, value in limits.items() if value is not None}
