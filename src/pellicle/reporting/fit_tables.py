"""Tables of a fit: data, model and residuals; n and k; profiles of graded layers; for pandas and xarray."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from pellicle.data.brdf_samples import BrdfSamples
from pellicle.data.colours import Colours
from pellicle.data.spectrum import Spectrum
from pellicle.data.tabular.columns import DIRECTIONS
from pellicle.errors import needs
from pellicle.fitting.curves import BIREFRINGENCE
from pellicle.fitting.depth_profiles import FittedProfile
from pellicle.fitting.result import Fit, Part
from pellicle.reporting.drawable import Table
from pellicle.reporting.plain_text import csv_text, written_by
from pellicle.reporting.quantities import colours_in_words, colours_of, quantities
from pellicle.signals.one_column import OneColumn

if TYPE_CHECKING:
    from pandas import DataFrame
    from xarray import Dataset

_JOINT = ("file", "signal", "wavelength_nm", "angle_deg", "data", "model", "residual", "sigma", "azimuth_deg")


def fit_csv(fit: Fit) -> str:
    """Format data, model and residuals of a fit as CSV that pellicle can read again.

    A spectrum has a row for each wavelength, angle and azimuth, with σ; BRDF samples have one for each pair
    of directions. Rows of a joint fit begin with the name of the file, and have one value of a spectrum each.
    """
    if fit.layer_test is not None:
        return _samples(fit)
    if fit.joint:
        about = ["joint fit: data, model, residual = data - model, sigma = standard deviation assumed"]
        azimuths, rows = False, []
        for part in fit.parts:
            data = part.data
            unknown = np.full(len(part.curve.model), math.nan)
            nm = part.spectral.wavelength if isinstance(data, Spectrum) else unknown
            angle = data.theta_i if isinstance(data, BrdfSamples) else data.angle
            azimuth = data.azimuth if isinstance(data, Spectrum) else None
            azimuths |= azimuth is not None
            for q in quantities(data, part.curve):
                numbers = (nm, angle, q.data, q.model, q.residual, q.sigma, azimuth)
                of_points = zip(*(unknown if x is None else x for x in numbers), strict=True)
                rows += [(part.name, q.name, *point) for point in of_points]
        columns = dict(zip(_JOINT, zip(*rows, strict=True), strict=True))
        return _text(fit, about, {name: columns[name] for name in _JOINT[: None if azimuths else -1]})
    [part] = fit.parts
    if isinstance(part.data, Colours):
        return _colours(fit, part)
    return _one_column(fit, part) if isinstance(part.spectrum.kind, OneColumn) else _columns(fit, part)


def nk_csvs(fit: Fit) -> dict[str, str]:
    """Format n and k of the layer with their standard errors, each wavelength once, by the name of the file.

    pellicle reads the tables as materials. Infinite errors are empty cells. A birefringent layer has a table
    for each principal index; the one of the extraordinary index also contains the birefringence.
    """
    if not fit.one_layer:  # a table for each of the samples
        each = ((part.name, nk_csvs(replace(fit.alone(part), scene=None))) for part in fit.parts)
        return {file.replace("nk", f"nk_{name}", 1): text for name, own in each for file, text in own.items()}
    principal = dict(fit.principal_indices)
    difference = principal.pop(BIREFRINGENCE, None)
    texts = {}
    for name, index in (principal or {"": fit.index}).items():
        columns = {("wavelength_nm" if key == "wavelength" else key): x for key, x in vars(index).items()}
        if difference is not None and name == "extraordinary":
            columns |= {BIREFRINGENCE: difference.n, f"{BIREFRINGENCE}_stderr": difference.n_stderr}
        which = f" ({name})" if name else ""
        about = [f"n and k of the fitted layer{which}, a material that pellicle takes by its path"]
        texts[f"nk_{name}.csv" if name else "nk.csv"] = _text(fit, about, columns)
    return texts


def profile_csv(fit: Fit, profiles: Sequence[FittedProfile]) -> str:
    """Format the fitted profiles of graded layers; infinite errors are empty cells."""
    about = [f"profiles at {profiles[0].wavelength:g} nm against depth from the upper face of each layer"]
    columns: dict[str, Any] = {
        "layer": [p.layer for p in profiles for _ in p.depth],
        "depth_nm": np.concatenate([p.depth for p in profiles]),
    }
    for name in ("fraction", "fraction_stderr", "n", "n_stderr", "k", "k_stderr"):
        columns[name] = np.concatenate([getattr(p, name) for p in profiles])
    return _text(fit, about, columns)


_PARAMETER = ("value", "stderr", "stderr_noise", "expanded", "lower", "upper", "free", "at_bound", "unit")
"""Columns of a table of parameters: attributes of `Estimate`."""


def dataframe(fit: Fit) -> DataFrame:
    """The parameters of a fit, one a row. Raises UsageError without pandas."""
    with needs("maps", "tables of parameters need"):
        import pandas as pd
    rows = {p.name: [getattr(p, name) for name in _PARAMETER] for p in fit.parameters.values()}
    frame = pd.DataFrame.from_dict(rows, orient="index", columns=_PARAMETER)
    return frame.rename_axis("parameter")


def dataset(fit: Fit) -> Dataset:
    """Data, model, residual and σ of each quantity, n and k, and the parameters of a fit of one spectrum.

    The dimension is `wavelength` (nm), or `point` where a wavelength occurs at several angles or azimuths.
    Raises UsageError without xarray, ValueError and TypeError as `Fit.curve` does.
    """
    data, curve = fit.spectrum, fit.curve
    with needs("maps", "datasets of fits need"):
        import xarray as xr
    nm = curve.wavelength
    along = "wavelength" if np.unique(nm).size == nm.size else "point"
    degrees = {"units": "degree"} if data.kind.degrees else {}
    variables: dict[str, Any] = {}
    for q in quantities(data, curve):
        columns = {"": q.data, "_model": q.model, "_residual": q.residual, "_sigma": q.sigma}
        variables |= {f"{q.name}{end}": (along, x, degrees) for end, x in columns.items() if x is not None}
    variables |= {name: (along, getattr(curve, name)) for name in ("n", "k", "n_stderr", "k_stderr")}
    coordinates: dict[str, Any] = {"wavelength": (along, nm, {"units": "nm"})}
    for name, values in (("angle", data.angle), ("azimuth", data.azimuth)):
        if values is not None:
            coordinates[name] = along, values, {"units": "degree"}
    every = fit.parameters.values()
    coordinates |= {"parameter": [p.name for p in every], "unit": ("parameter", [p.unit for p in every])}
    variables |= {name: ("parameter", [getattr(p, name) for p in every]) for name in _PARAMETER[:-1]}
    about = {"status": str(fit.status), "verdict": fit.verdict, "chi2_reduced": fit.chi2_reduced}
    about |= {"source": data.path, "sha256": data.sha256 or "", "history": written_by()}
    return xr.Dataset(variables, coordinates, about)


def _one_column(fit: Fit, part: Part) -> str:
    data, curve = part.spectrum, part.spectral
    settings = _settings(data)
    names = ["wavelength", data.signal if data.calibrated else "intensity", "_", "_", "sigma"]
    names += [name.removesuffix("_deg") for name in settings]
    about = [
        f"fit of {data.signal}: data, model, residual = data - model, sigma = standard deviation assumed",
        f"pellicle reads the data again with --columns {','.join(names)}",
    ]
    columns = {name: getattr(curve, name) for name in ("data", "model", "residual", "sigma")}
    return _text(fit, about, {"wavelength_nm": curve.wavelength, **columns, **settings})


def _settings(data: Spectrum) -> dict[str, np.ndarray]:
    """The angle of incidence and the azimuth of the sample, as far as the data have them."""
    known = {"angle_deg": data.angle, "azimuth_deg": data.azimuth}
    return {name: values for name, values in known.items() if values is not None}


def _columns(fit: Fit, part: Part) -> str:
    """Data, model, residual and known σ of each quantity; those of Ψ and Δ follow both."""
    data, kind = part.spectrum, part.spectrum.kind
    known = quantities(data, part.curve)
    groups = [[q] for q in known] if kind.parts else [known[:2], known[2:]]
    columns: dict[str, Any] = {"wavelength_nm": part.spectral.wavelength, **_settings(data)}
    for group in groups:
        for q in group:
            assert q.residual is not None
            columns |= {f"{q.name}{'_deg' * ('degrees' in q.label)}": q.data, f"{q.name}_model": q.model}
            columns |= {f"{q.name}_residual": q.residual} if kind.degrees else {}
        # σ of Ψ as stated: that of the fit may be the scatter of sweeps
        sigmas = {q.name: data.sigma if q.name == "psi" else q.sigma for q in group}
        stated = not kind.degrees or data.sigma is not None or "depolarisation" in sigmas
        if stated and all(sigma is not None for sigma in sigmas.values()):
            columns |= {
                f"sigma_{name}{'_deg' * bool(kind.degrees and kind.parts)}": x for name, x in sigmas.items()
            }
    about = f"fit of {kind.ordinate}s: data, model, sigma = standard deviation assumed"
    if kind.degrees:
        about = f"fit of {kind.noun} in degrees: data, model, residual = data - model (of delta: -180 to 180)"
    return _text(fit, [about], columns)


def _colours(fit: Fit, part: Part) -> str:

    data, curve = colours_of(part)
    light = "transmitted" if data.signal == "T" else "reflected"
    about = [f"signal {data.space}, {light}, {data.polarisation}"]
    about += [note for note in data.notes if note.startswith("observer ")]
    about += [f"fit of {colours_in_words(part)}: data, model_, sigma_ = standard deviation assumed"]
    columns = {} if data.angle is None else {"angle_deg": data.angle}
    for kind, values in (("", curve.data), ("model_", curve.model), ("sigma_", curve.sigma)):
        columns |= {f"{kind}{name}": column for name, column in zip(data.channels, values.T, strict=True)}
    return _text(fit, about, columns | ({} if curve.difference is None else {"delta_e": curve.difference}))


def _samples(fit: Fit) -> str:
    channels = fit.parts[0].samples.channels
    about = [
        f"BRDF in 1/sr, directions in degrees; model_{channels[0]} and so on: {fit.surface.model} as fitted"
    ]
    names = [part.name for part in fit.parts for _ in range(len(part.samples))]
    columns: dict[str, Any] = {"file": names} if fit.joint else {}
    for name in DIRECTIONS:
        columns[name] = np.concatenate([getattr(part.samples, name) for part in fit.parts])
    measured = np.concatenate([part.samples.values for part in fit.parts])
    model = np.concatenate([part.curve.model for part in fit.parts])
    columns |= dict(zip(channels, measured.T, strict=True))
    return _text(fit, about, columns | {f"model_{c}": x for c, x in zip(channels, model.T, strict=True)})


def _text(fit: Fit, about: Sequence[str], columns: dict[str, Any]) -> str:
    """The table below its comments: what it is, the path (on one line) and hash of each source."""
    sources = [
        f"from {' '.join(getattr(part.data, 'source', part.data.path).split()) or 'no file'},"
        f" sha256 {part.data.sha256 or 'unknown'}"
        for part in fit.parts
    ]
    return csv_text(Table(columns, (*about, *sources, written_by())))
