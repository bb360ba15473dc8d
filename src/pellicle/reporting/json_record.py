"""JSON record of a fit and its posterior: one strict schema, null for infinite and undefined numbers."""

from __future__ import annotations

import json
import math
import os
import sys
from collections.abc import Mapping, Sequence
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pellicle.files import MARKER, new_folder, write_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from pellicle.fitting.curves import Index
    from pellicle.fitting.result import Estimate, Fit, Part
    from pellicle.sampling.result import Posterior

SCHEMA = "pellicle.fit/1"
ERROR_SCHEMA = "pellicle.error/1"

_PACKAGES = ("jax", "optimistix", "numpy")


def to_json(fit: Fit, posterior: Posterior | None = None) -> dict[str, Any]:
    """Convert a fit, and its posterior if there is one, to dictionaries of the schema.

    Infinite and undefined numbers are None. A joint fit has a list as `data` and `noise`; a fit of BRDF
    samples has the layer test.
    """
    data = [_part(part, fit) for part in fit.parts]
    noise = [{"sigma": part.sigma, "source": part.sigma_from} for part in fit.parts]
    test = fit.layer_test
    record = {
        "schema": SCHEMA,
        "data": data if fit.joint else data[0],
        **taken(fit, "status", "verdict"),
        "parameters": {name: parameter_record(p) for name, p in fit.parameters.items()},
        "rivals": [
            taken(rival, "parameters", "delta_chi2") | _known(rival, "probability", "stderr")
            for rival in fit.rivals
        ],
        **taken(fit, "chi2_reduced", "rms", "effective_points"),
        **({"index": _index(index)} if (index := fit.index_in_short) is not None else {}),
        "correlation": {"names": fit.correlation_names, "matrix": fit.correlation},
        "budget": [
            {
                "effect": effect.name,
                **taken(effect, "uncertainty", "unit", "changes", "amount", "explains", "carries"),
            }
            for effect in fit.budget
        ],
        "plan": [
            ({"name": part.name} if part.name else {}) | taken(row, "effect", "on", "why", "error_bound")
            for part in fit.parts
            for row in part.plan.rows
        ],
        "warnings": fit.warnings,
        "versions": versions(),
        "seconds": fit.seconds,
        "noise": noise if fit.joint else noise[0],
        **_known(fit, "probability"),
    }
    if test is not None:
        record |= {"model": fit.surface.model, **taken(test, "residual", "layered", "held_out")}
        record["baselines"] = [taken(baseline, "name", "held_out") for baseline in test.baselines]
    return strict(record) | ({} if posterior is None else {"posterior": posterior_to_json(posterior)})


def taken(record: object, *names: str) -> dict[str, Any]:
    """Attributes of an object by their names."""
    return {name: getattr(record, name) for name in names}


def _known(record: object, *names: str) -> dict[str, Any]:
    """Attributes that are not None."""
    return {name: value for name, value in taken(record, *names).items() if value is not None}


def _part(part: Part, fit: Fit) -> dict[str, Any]:
    """One data set: where it is from, what it is, and in a joint fit its name and its fit quality."""
    from pellicle.fitting.lack_of_fit import lack_of_fit  # imports JAX, which records of failures do not need

    data, curve = part.data, part.curve
    ratios, azimuth = getattr(data, "ratios", ()), getattr(data, "azimuth", None)
    several = bool(getattr(data, "elements", ()) or ratios)
    record = {
        **({"name": part.name} if fit.joint else {}),
        **taken(data, "path", "sha256"),
        "signal": getattr(data, "space", getattr(data, "signal", "brdf")),
        "points": len(curve.model) if several else int(curve.model.size),
        **({"ratios": ratios} if ratios else {}),
        **({} if azimuth is None else {"azimuths_deg": np.unique(azimuth)}),
        **({"spectrum": name} if (name := getattr(data, "name", "")) else {}),
        **left_out(data),
    }
    measured, model = (getattr(curve, f"depolarisation_{x}", None) for x in ("data", "model"))
    if measured is not None and model is not None:
        rms = np.sqrt(np.mean(part.spectral.depolarisation_residual**2))
        record["depolarisation"] = {"mean": np.mean(measured), "model": np.mean(model), "rms": rms}
    if (lack := lack_of_fit(part, len(fit.free))) is not None:
        record["sweeps"] = {
            "number": lack.sweeps,
            "sd": lack.repeatability,
            "lack_of_fit": lack.ratio,
            "degrees_of_freedom": [int(x) for x in lack.freedom],
            "probability": lack.probability,
        }
    return record | (taken(part, "rms", "chi2_reduced", "effective_points") if fit.joint else {})


def left_out(data: object) -> dict[str, Any]:
    """The record of points of a spectrum that are left out of its fit; empty without them."""
    if (points := getattr(data, "left_out", None)) is None:
        return {}
    return {"left_out": {"points": len(points.wavelength), "reason": points.reason}}


def _index(index: Index) -> list[dict[str, float]]:
    """n and k at some wavelengths, with standard errors and half widths of 95 % intervals."""
    from pellicle.fitting.curves import NORMAL  # imports JAX, as above

    errors = {"n": index.n_stderr, "k": index.k_stderr}
    columns: dict[str, np.ndarray] = {"wavelength_nm": index.wavelength}
    for name, stderr in errors.items():
        columns |= {name: getattr(index, name), f"{name}_stderr": stderr, f"{name}_expanded": NORMAL * stderr}
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]


def parameter_record(p: Estimate) -> dict[str, Any]:
    """Convert the estimate of a parameter to dictionaries."""
    return {
        **taken(p, "value", "stderr", "stderr_noise", "expanded", "coverage_factor"),
        "degrees_of_freedom": p.effective_degrees_of_freedom,
        **taken(p, "unit", "lower", "upper", "free"),
        **({"tied": p.tied} if p.tied else {}),
        **_known(p, "lower_limit", "upper_limit"),
    }


def posterior_to_json(posterior: Posterior) -> dict[str, Any]:
    """Convert a posterior to dictionaries; the parameters have no numbers where the chain is not trusted."""
    checks, trusted = posterior.checks, posterior.parameters
    names = "mean", "sd", "q025", "q50", "q975"

    def marginal(name: str) -> dict[str, Any]:
        known = trusted.get(name)
        if known is None:
            return {**dict.fromkeys(names), "modes": []}
        return taken(known, *names) | {"modes": [taken(mode, "value", "mass") for mode in known.modes]}

    record = {
        "parameters": {name: marginal(name) for name in posterior.marginals()},
        "checks": {
            **taken(checks, "n_over_tau", "rhat", "acceptance", "minima_found", "minima_visited"),
            **taken(checks, "steps", "discard"),
            "walkers": posterior.draws.shape[1],
            **taken(checks, "autocorrelation_time", "independent"),
        },
        **taken(checks, "trusted", "doubts"),
    }
    return strict(record)


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
        **failed(SCHEMA, data[0] if alone else data, str(error)),
        "verdict": "No fit was made.",
        "parameters": {},
        "rivals": [],
        **dict.fromkeys(("chi2_reduced", "rms", "effective_points")),
        "correlation": {"names": [], "matrix": []},
        **{name: [] for name in ("budget", "plan", "warnings")},
        "seconds": 0.0,
    }


def failed(schema: str, data: Any, error: str) -> dict[str, Any]:
    """Build the record of what could not be compared."""
    return {"schema": schema, "data": data, "status": "failed", "error": error, "versions": versions()}


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
    python = ".".join(map(str, sys.version_info[:3]))
    installed: dict[str, str | None] = {"pellicle": version("pellicle"), "python": python}
    for name in _PACKAGES:
        try:
            installed[name] = version(name)
        except PackageNotFoundError:
            installed[name] = None
    return installed


def strict(value: Any) -> Any:
    """Convert to what strict JSON has: lists for arrays, None for infinite and undefined numbers."""
    if isinstance(value, Mapping):
        return {str(key): strict(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [strict(each) for each in value]
    if isinstance(value, str):
        return str(value)  # also of an enumeration
    if hasattr(value, "tolist"):
        return strict(value.tolist())
    return None if isinstance(value, float) and not math.isfinite(value) else value


def write_result(
    folder: str | os.PathLike[str], record: Mapping[str, Any], contents: Mapping[str, str | Figure]
) -> Path:
    """Write result.json, and texts and figures by the names of their files; return the folder.

    Each file appears complete or not at all; those of an earlier result are replaced.

    **Raises:** UsageError where the folder holds files that pellicle did not write, or cannot be written.
    """
    from pellicle.reporting.matplotlib_figure import save_figure

    target = new_folder(folder)
    write_text(target / MARKER, indented(record), overwrite=True)  # first: it marks the folder as ours
    for name, content in contents.items():
        if isinstance(content, str):
            write_text(target / name, content, overwrite=True)
        else:
            save_figure(content, target / name, overwrite=True)
    return target
