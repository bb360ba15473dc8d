"""A fit as a record of one JSON schema, strict: what is infinite or undefined is null."""

from __future__ import annotations

import json
import math
import os
import sys
from collections.abc import Mapping, Sequence
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any, cast

import numpy as np

if TYPE_CHECKING:
    from pellicle.effects.plan import Plan
    from pellicle.fitting.result import Estimate, Fit, LayerTest, Part

SCHEMA = "pellicle.fit/1"

_PACKAGES = ("jax", "optimistix", "numpy")


def to_json(fit: Fit) -> dict[str, Any]:
    """A fit as plain dictionaries of the schema; what is infinite or undefined is None."""
    plan = [row for part in fit.parts for row in _plan(part.plan, part.name)]
    noise = [{"sigma": number(part.sigma), "source": part.sigma_from} for part in fit.parts]
    return _record(fit, _data(fit), plan) | {"noise": noise if fit.joint else noise[0]}


def brdf_to_json(fit: Fit) -> dict[str, Any]:
    """The same of a fit to samples of a BRDF, with what it was judged against."""
    data = {"path": fit.samples.path, "sha256": fit.samples.sha256, "signal": "brdf"}
    part, test = fit.parts[0], cast("LayerTest", fit.layer_test)
    judged = {
        "model": fit.surface.model,
        "residual": test.residual,
        "layered": test.layered,
        "held_out": number(test.held_out),
        "baselines": [{"name": b.name, "held_out": number(b.held_out)} for b in test.baselines],
        "noise": {"sigma": number(part.sigma), "source": part.sigma_from},
    }
    return _record(fit, {**data, "points": int(fit.samples.values.size)}, _plan(fit.plan)) | judged


def _record(fit: Fit, data: Any, plan: list[dict[str, Any]]) -> dict[str, Any]:
    matrix = np.asarray(fit.correlation, dtype=float)
    return {
        "schema": SCHEMA,
        "data": data,
        "status": str(fit.status),
        "verdict": fit.verdict,
        "parameters": {name: _parameter(p) for name, p in fit.parameters.items()},
        "rivals": [
            {
                "parameters": {name: number(value) for name, value in rival.parameters.items()},
                "delta_chi2": number(rival.delta_chi2),
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
        "plan": plan,
        "warnings": list(fit.warnings),
        "versions": versions(),
        "seconds": number(fit.seconds),
    }


def _data(fit: Fit) -> dict[str, Any] | list[dict[str, Any]]:
    """What was fitted: a list where the fit is a joint one."""
    return [_part(part) for part in fit.parts] if fit.joint else _source(fit.parts[0])


def _source(part: Part) -> dict[str, Any]:
    data = part.spectrum
    points = int(part.spectral.wavelength.size)
    return {"path": data.path, "sha256": data.sha256, "signal": data.signal, "points": points}


def _part(part: Part) -> dict[str, Any]:
    """One spectrum of a joint fit: its name, that its own parameters end in, and how it is explained."""
    return {
        "name": part.name,
        **_source(part),
        "rms": number(part.rms),
        "chi2_reduced": number(part.chi2_reduced),
        "effective_points": number(part.effective_points),
    }


def _plan(plan: Plan, name: str = "") -> list[dict[str, Any]]:
    """The plan's rows, with the name of the spectrum where it is one of several."""
    return [
        {
            **({"name": name} if name else {}),
            "effect": row.effect,
            "on": bool(row.on),
            "why": row.why,
            "error_bound": number(row.error_bound),
        }
        for row in plan.rows
    ]


def failure(
    path: str | os.PathLike[str] | Sequence[str], error: Exception | str, sha256: str | None = None
) -> dict[str, Any]:
    """The record of a file that gave no fit, or of several that gave no joint one, and why.

    Its schema is the same, its status "failed".
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
        "pellicle": version("pellicle"),
        "python": ".".join(map(str, sys.version_info[:3])),
        **{name: _version(name) for name in _PACKAGES},
    }


def _version(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None


def number(value: Any) -> float | None:
    """A number of the schema: what is infinite or undefined is null."""
    found = float(value)
    return found if math.isfinite(found) else None


def _parameter(p: Estimate) -> dict[str, Any]:
    written = {
        "value": number(p.value),
        "stderr": number(p.stderr),
        "unit": p.unit,
        "lower": number(p.lower),
        "upper": number(p.upper),
        "free": bool(p.free),
    }
    limits = {"lower_limit": p.lower_limit, "upper_limit": p.upper_limit}
    return written | {name: number(value) for name, value in limits.items() if value is not None}
