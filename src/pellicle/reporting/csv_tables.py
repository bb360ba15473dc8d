"""Tables of a fit as CSV, with where they come from in comments."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from importlib.metadata import version
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from pellicle.fitting.result import Fit, Part


def fit_csv(fit: Fit) -> str:
    """Data, model, residual and σ at each wavelength, with the angle where the data have one.

    Of a joint fit one table of one value a row, with the spectrum's name and the signal.
    """
    if fit.joint:
        return _joint_csv(fit)
    curve, data = fit.curve, fit.spectrum
    if curve.delta_data is not None:
        return _psi_delta_csv(fit)
    columns = {
        "wavelength_nm": curve.wavelength,
        "data": curve.data,
        "model": curve.model,
        "residual": curve.residual,
        "sigma": curve.sigma,
    }
    angle = ""
    if data.angle is not None:
        columns["angle_deg"], angle = data.angle, ",angle"
    kind = data.signal if data.calibrated else "intensity"
    about = [
        f"fit of {data.signal}: data, model, residual = data - model, sigma = standard deviation assumed",
        f"pellicle reads the data again with --columns wavelength,{kind},_,_,sigma{angle}",
    ]
    return _table(about, fit, columns)


def _psi_delta_csv(fit: Fit) -> str:
    """Ψ and Δ of data and model in degrees, in columns that pellicle reads again as they are."""
    curve, data = fit.curve, fit.spectrum
    assert curve.delta_data is not None
    assert curve.delta_model is not None
    columns = {"wavelength_nm": curve.wavelength}
    if data.angle is not None:
        columns["angle_deg"] = data.angle
    columns |= {
        "psi_deg": curve.data,
        "psi_model": curve.model,
        "psi_residual": curve.residual,
        "delta_deg": curve.delta_data,
        "delta_model": curve.delta_model,
        "delta_residual": curve.delta_residual,
    }
    if data.sigma is not None and data.delta_sigma is not None:
        columns |= {"sigma_psi": data.sigma, "sigma_delta": data.delta_sigma}
    about = ["fit of psi and delta in degrees: data, model, residual = data - model (of delta: -180 to 180)"]
    return _table(about, fit, columns)


def _joint_csv(fit: Fit) -> str:
    """Every spectrum below the other, a row a value: Ψ and Δ are two."""
    rows = [row for part in fit.parts for row in _tidy(part)]
    about = ["joint fit: data, model, residual = data - model, sigma = standard deviation assumed"]
    names = ["file", "signal", "wavelength_nm", "angle_deg", "data", "model", "residual", "sigma"]
    return _written(about, fit, names, rows)


def _tidy(part: Part) -> list[list[str]]:
    """Rows of file, signal and numbers."""
    curve, data = part.spectral, part.spectrum
    unknown = np.full(curve.wavelength.size, np.nan)
    angle = unknown if data.angle is None else data.angle
    kind = data.signal if curve.delta_data is None else "psi"
    columns = {kind: (curve.data, curve.model, curve.residual, curve.sigma)}
    if curve.delta_data is not None and curve.delta_model is not None:
        sigma = unknown if data.delta_sigma is None else data.delta_sigma
        columns["delta"] = (curve.delta_data, curve.delta_model, curve.delta_residual, sigma)
    name = '"' + part.name.replace('"', '""') + '"' if set(part.name) & set('",\n\r') else part.name
    return [
        [name, signal, *map(_cell, row)]
        for signal, values in columns.items()
        for row in zip(curve.wavelength, angle, *values, strict=True)
    ]


def nk_csv(fit: Fit) -> str:
    """The layer's n and k with standard errors (empty where infinite), each wavelength once."""
    columns = {("wavelength_nm" if name == "wavelength" else name): c for name, c in vars(fit.index).items()}
    return _table(["n and k of the fitted layer, a material that pellicle takes by its path"], fit, columns)


def _table(about: Iterable[str], fit: Fit, columns: Mapping[str, np.ndarray]) -> str:
    rows = [list(map(_cell, row)) for row in zip(*columns.values(), strict=True)]
    return _written(about, fit, list(columns), rows)


def _written(about: Iterable[str], fit: Fit, names: list[str], rows: list[list[str]]) -> str:
    data = [part.spectrum for part in fit.parts]
    sources = [f"from {_plain(s.path) or 'a spectrum'}, sha256 {s.sha256 or 'unknown'}" for s in data]
    comments = [f"# {line}" for line in (*about, *sources, f"written by pellicle {version('pellicle')}")]
    return "\n".join([*comments, ",".join(names), *map(",".join, rows)]) + "\n"


def _plain(path: str) -> str:
    """A path on one line, whatever its name holds."""
    return " ".join(path.split())


def _cell(value: float) -> str:
    return f"{float(value):.10g}" if math.isfinite(value) else ""
