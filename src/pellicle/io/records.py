"""A fit as a record of one JSON schema, strict: what is infinite or undefined is null."""

from __future__ import annotations

import json
import math
import os
import sys
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any

import numpy as np

from pellicle import __version__

if TYPE_CHECKING:
    from pellicle.fitting.result import Estimate, Fit

SCHEMA = "pellicle.fit/1"

_PACKAGES = ("jax", "optimistix", "numpy")


def to_json(fit: Fit) -> dict[str, Any]:
    """A fit as plain dictionaries of the schema; what is infinite or undefined is None."""
    data = fit.spectrum
    matrix = np.asarray(fit.correlation, dtype=float)
    return {
        "schema": SCHEMA,
        "data": {
            "path": data.path,
            "sha256": data.sha256,
            "signal": data.signal,
            "points": int(fit.curve.wavelength.size),
        },
        "status": str(fit.status),
        "verdict": fit.verdict,
        "parameters": {name: _parameter(p) for name, p in fit.parameters.items()},
        "rivals": [
            {
                "parameters": {name: _number(value) for name, value in rival.parameters.items()},
                "delta_chi2": _number(rival.delta_chi2),
            }
            for rival in fit.rivals
        ],
        "chi2_reduced": _number(fit.chi2_reduced),
        "rms": _number(fit.rms),
        "effective_points": _number(fit.effective_points),
        "correlation": {
            "names": list(fit.correlation_names),
            "matrix": [[_number(value) for value in row] for row in matrix],
        },
        "plan": [
            {
                "effect": row.effect,
                "on": bool(row.on),
                "why": row.why,
                "error_bound": _number(row.error_bound),
            }
            for row in fit.plan.rows
        ],
        "warnings": list(fit.warnings),
        "versions": versions(),
        "seconds": _number(fit.seconds),
    }


def failure(
    path: str | os.PathLike[str], error: Exception | str, sha256: str | None = None
) -> dict[str, Any]:
    """The record of a file that gave no fit: the same schema, status "failed", and why."""
    return {
        "schema": SCHEMA,
        "data": {"path": os.fspath(path), "sha256": sha256, "signal": None, "points": 0},
        "status": "failed",
        "verdict": "No fit was made.",
        "error": str(error),
        "parameters": {},
        "rivals": [],
        "chi2_reduced": None,
        "rms": None,
        "effective_points": None,
        "correlation": {"names": [], "matrix": []},
        "plan": [],
        "warnings": [],
        "versions": versions(),
        "seconds": 0.0,
    }


def one_line(record: Mapping[str, Any]) -> str:
    """A record as one line of strict JSON, in ASCII so that every terminal and pipe takes it."""
    return json.dumps(record, allow_nan=False)


def indented(record: Mapping[str, Any]) -> str:
    """A record as the text of a file for people to open."""
    return json.dumps(record, allow_nan=False, ensure_ascii=False, indent=1) + "\n"


def versions() -> dict[str, str | None]:
    """The versions of pellicle, Python and what the numbers depend on; nothing is imported."""
    return {
        "pellicle": __version__,
        "python": ".".join(map(str, sys.version_info[:3])),
        **{name: _version(name) for name in _PACKAGES},
    }


def _version(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None


def _number(value: Any) -> float | None:
    number = float(value)
    return number if math.isfinite(number) else None


def _parameter(p: Estimate) -> dict[str, Any]:
    written = {
        "value": _number(p.value),
        "stderr": _number(p.stderr),
        "unit": p.unit,
        "lower": _number(p.lower),
        "upper": _number(p.upper),
        "free": bool(p.free),
    }
    limits = {"lower_limit": p.lower_limit, "upper_limit": p.upper_limit}
    return written | {name: _number(value) for name, value in limits.items() if value is not None}
