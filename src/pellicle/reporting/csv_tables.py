"""CSV tables of a fit, with their source in comments."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable, Mapping, Sequence
from importlib.metadata import version
from io import StringIO
from typing import TYPE_CHECKING

import numpy as np

from pellicle.data.brdf_samples import BrdfSamples
from pellicle.data.colours import Colours
from pellicle.data.spectrum import Spectrum
from pellicle.data.tabular.columns import DIRECTIONS
from pellicle.fitting.curves import BIREFRINGENCE

if TYPE_CHECKING:
    from pellicle.fitting.depth_profiles import FittedProfile
    from pellicle.fitting.result import Fit, Part

Columns = Mapping[str, Sequence[float] | np.ndarray]


def fit_csv(fit: Fit) -> str:
    """Format data, model and residuals of a fit as CSV that pellicle can read again.

    A spectrum has a row for each wavelength, angle and azimuth, with σ; BRDF samples have one for each pair
    of directions. Rows of a joint fit begin with the name of the file, and have one value of a spectrum each.
    """
    if fit.layer_test is not None:
        return _samples_csv(fit)
    if fit.joint:
        return _joint_csv(fit)
    [part] = fit.parts
    if isinstance(part.data, Colours):
        from pellicle.reporting import fitted_colours  # imports JAX

        columns = fitted_colours.columns(part)
        data = part.data
        light = "transmitted" if data.signal == "T" else "reflected"
        about = [f"signal {data.space}, {light}, {data.polarisation}"]
        about += [note for note in data.notes if note.startswith("observer ")]
        about += [f"fit of {fitted_colours.summary(part)}: data, model_, sigma_ = standard deviation assumed"]
    elif part.spectrum.ratios:
        about, columns = _generalised(part)
    elif part.spectrum.elements:
        about, columns = _mueller(part)
    elif part.spectral.delta_data is not None:
        about, columns = _psi_delta(part)
    else:
        about, columns = _spectrum(part)
    return _csv(about, fit, list(columns), zip(*columns.values(), strict=True))


def nk_csvs(fit: Fit) -> dict[str, str]:
    """Format n and k of the layer with their standard errors, each wavelength once, by the name of the file.

    pellicle reads the tables as materials. Infinite errors are empty cells. A birefringent layer has a table
    for each principal index; the one of the extraordinary index also contains the birefringence.
    """
    principal = dict(fit.principal_indices)
    difference = principal.pop(BIREFRINGENCE, None)
    found = {}
    for name, index in (principal or {"": fit.index}).items():
        columns = {("wavelength_nm" if key == "wavelength" else key): x for key, x in vars(index).items()}
        if difference is not None and name == "extraordinary":
            columns |= {BIREFRINGENCE: difference.n, f"{BIREFRINGENCE}_stderr": difference.n_stderr}
        which = f" ({name})" if name else ""
        about = [f"n and k of the fitted layer{which}, a material that pellicle takes by its path"]
        table = _csv(about, fit, list(columns), zip(*columns.values(), strict=True))
        found[f"nk_{name}.csv" if name else "nk.csv"] = table
    return found


def profile_csv(fit: Fit, profiles: Sequence[FittedProfile]) -> str:
    """Format the fitted profiles of graded layers; infinite errors are empty cells."""
    about = [f"profiles at {profiles[0].wavelength:g} nm against depth from the upper face of each layer"]
    names = ["fraction", "fraction_stderr", "n", "n_stderr", "k", "k_stderr"]
    rows = [
        [each.layer, *row]
        for each in profiles
        for row in np.column_stack([each.depth, *(getattr(each, name) for name in names)]).tolist()
    ]
    return _csv(about, fit, ["layer", "depth_nm", *names], rows)


def _spectrum(part: Part) -> tuple[list[str], Columns]:
    curve, data = part.spectral, part.spectrum
    names = ["wavelength", data.signal if data.calibrated else "intensity", "_", "_", "sigma"]
    columns = {
        "wavelength_nm": curve.wavelength,
        "data": curve.data,
        "model": curve.model,
        "residual": curve.residual,
        "sigma": curve.sigma,
    }
    if data.angle is not None:
        names.append("angle")
    if data.azimuth is not None:
        names.append("azimuth")
    columns |= _settings(part)
    about = [
        f"fit of {data.signal}: data, model, residual = data - model, sigma = standard deviation assumed",
        f"pellicle reads the data again with --columns {','.join(names)}",
    ]
    return about, columns


def _settings(part: Part) -> dict[str, np.ndarray]:
    """The angle of incidence and the azimuth of the sample, as far as the data have them."""
    each = {"angle_deg": part.spectrum.angle, "azimuth_deg": part.spectrum.azimuth}
    return {name: own for name, own in each.items() if own is not None}


def _psi_delta(part: Part) -> tuple[list[str], Columns]:
    curve, data = part.spectral, part.spectrum
    assert curve.delta_data is not None
    assert curve.delta_model is not None
    columns = {"wavelength_nm": curve.wavelength, **_settings(part)}
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
    if curve.depolarisation_data is not None and curve.depolarisation_model is not None:
        columns |= {
            "depolarisation": curve.depolarisation_data,
            "depolarisation_model": curve.depolarisation_model,
            "depolarisation_residual": curve.depolarisation_residual,
        }
    if data.depolarisation_sigma is not None:
        columns |= {"sigma_depolarisation": data.depolarisation_sigma}
    about = ["fit of psi and delta in degrees: data, model, residual = data - model (of delta: -180 to 180)"]
    return about, columns


def _generalised(part: Part) -> tuple[list[str], Columns]:
    curve, data = part.spectral, part.spectrum
    columns = {"wavelength_nm": curve.wavelength, **_settings(part)}
    for name, (own, model, residual, sigma) in _of_ratios(part).items():
        columns |= {f"{name}_deg": own, f"{name}_model": model, f"{name}_residual": residual}
        if data.sigma is not None and sigma is not None:
            columns[f"sigma_{name}_deg"] = sigma
    about = "fit of generalised psi and delta in degrees: data, model, residual = data - model"
    return [f"{about} (of delta: -180 to 180)"], columns


def _of_ratios(part: Part) -> dict[str, tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray | None]]:
    """Data, model, residual and σ of Ψ and of Δ of each ratio; the σ of Δ is None where it is not known."""
    curve, data = part.spectral, part.spectrum
    assert curve.delta_data is not None
    assert curve.delta_model is not None
    found = {}
    for i, ratio in enumerate(data.ratios):
        psi = curve.data[:, i], curve.model[:, i], curve.residual[:, i], curve.sigma[:, i]
        error = None if data.delta_sigma is None else data.delta_sigma[:, i]
        delta = curve.delta_data[:, i], curve.delta_model[:, i], curve.delta_residual[:, i], error
        found |= {f"psi_{ratio}": psi, f"delta_{ratio}": delta}
    return found


def _mueller(part: Part) -> tuple[list[str], Columns]:
    curve, data = part.spectral, part.spectrum
    columns = {"wavelength_nm": curve.wavelength, **_settings(part)}
    for i, name in enumerate(data.elements):
        columns[name] = curve.data[:, i]
        columns[f"{name}_model"] = curve.model[:, i]
        columns[f"sigma_{name}"] = curve.sigma[:, i]
    about = ["fit of normalised Mueller elements: data, model, sigma = standard deviation assumed"]
    return about, columns


def _samples_csv(fit: Fit) -> str:
    channels = fit.parts[0].samples.channels
    about = [
        f"BRDF in 1/sr, directions in degrees; model_{channels[0]} and so on: {fit.surface.model} as fitted"
    ]
    rows = []
    for part in fit.parts:
        directions = [getattr(part.samples, name) for name in DIRECTIONS]
        table = np.column_stack([*directions, part.samples.values, part.curve.model])
        rows += [[*([part.name] if fit.joint else []), *row] for row in table.tolist()]
    names = [*(["file"] if fit.joint else []), *DIRECTIONS, *channels, *(f"model_{c}" for c in channels)]
    return _csv(about, fit, names, rows)


def _joint_csv(fit: Fit) -> str:
    about = ["joint fit: data, model, residual = data - model, sigma = standard deviation assumed"]
    names = ["file", "signal", "wavelength_nm", "angle_deg", "data", "model", "residual", "sigma"]
    if not any(isinstance(part.data, Spectrum) and part.data.azimuth is not None for part in fit.parts):
        return _csv(about, fit, names, (row for part in fit.parts for row in _joint_rows(part)))
    rows = ([*row, azimuth] for part in fit.parts for row, azimuth in _with_azimuths(part))
    return _csv(about, fit, [*names, "azimuth_deg"], rows)


def _with_azimuths(part: Part) -> Iterable[tuple[tuple[str | float, ...], float]]:
    """Rows of a part, each with the azimuth of the sample, NaN where that is not known."""
    rows = list(_joint_rows(part))
    azimuth = part.data.azimuth if isinstance(part.data, Spectrum) else None
    if azimuth is None:
        return [(row, math.nan) for row in rows]
    # the rows of one quantity after those of another
    return zip(rows, np.tile(azimuth, len(rows) // len(azimuth)), strict=True)


def _joint_rows(part: Part) -> Iterable[tuple[str | float, ...]]:
    """A row for each value; Ψ, Δ and depolarisation are three, and so is a colour; Mueller elements one each.

    The angle of a BRDF sample is that of the light.
    """
    if isinstance(part.data, BrdfSamples):
        table = zip(part.data.theta_i, part.data.values, part.curve.model, strict=True)
        for angle, values, model in table:
            for name, value, own in zip(part.data.channels, values, model, strict=True):
                yield part.name, name, math.nan, angle, value, own, value - own, math.nan
        return
    if isinstance(part.data, Colours):
        from pellicle.reporting import fitted_colours

        yield from fitted_colours.rows(part)
        return
    curve, data = part.spectral, part.spectrum
    unknown = np.full(curve.wavelength.size, np.nan)
    angle = unknown if data.angle is None else data.angle
    if data.ratios:
        for name, (*numbers, sigma) in _of_ratios(part).items():
            for row in zip(
                curve.wavelength, angle, *numbers, unknown if sigma is None else sigma, strict=True
            ):
                yield part.name, name, *row
        return
    if data.elements:
        for i, name in enumerate(data.elements):
            numbers = (curve.data[:, i], curve.model[:, i], curve.residual[:, i], curve.sigma[:, i])
            for row in zip(curve.wavelength, angle, *numbers, strict=True):
                yield part.name, name, *row
        return
    kind = data.signal if curve.delta_data is None else "psi"
    columns = {kind: (curve.data, curve.model, curve.residual, curve.sigma)}
    if curve.delta_data is not None and curve.delta_model is not None:
        sigma = unknown if data.delta_sigma is None else data.delta_sigma
        columns["delta"] = (curve.delta_data, curve.delta_model, curve.delta_residual, sigma)
    share, share_model = curve.depolarisation_data, curve.depolarisation_model
    if share is not None and share_model is not None:
        sigma = unknown if data.depolarisation_sigma is None else data.depolarisation_sigma
        columns["depolarisation"] = (share, share_model, curve.depolarisation_residual, sigma)
    for signal, values in columns.items():
        for row in zip(curve.wavelength, angle, *values, strict=True):
            yield part.name, signal, *row


def _csv(about: Iterable[str], fit: Fit, names: list[str], rows: Iterable[Iterable[str | float]]) -> str:
    """The table below its comments: what it is, the path (on one line) and hash of each source."""
    sources = [
        f"from {' '.join(getattr(part.data, 'source', part.data.path).split()) or 'no file'},"
        f" sha256 {part.data.sha256 or 'unknown'}"
        for part in fit.parts
    ]
    text = StringIO()
    for line in (*about, *sources, f"written by pellicle {version('pellicle')}"):
        text.write(f"# {line}\n")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(names)
    for row in rows:
        writer.writerow([cell if isinstance(cell, str) else _cell(cell) for cell in row])
    return text.getvalue()


def _cell(value: float) -> str:
    return f"{float(value):.10g}" if math.isfinite(value) else ""
