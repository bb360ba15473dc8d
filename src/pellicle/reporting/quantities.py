"""Measured quantities of spectra, colours and BRDF samples: names, labels with units, data, model, σ."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pellicle.data.brdf_samples import BrdfSamples
from pellicle.data.colours import Colours
from pellicle.data.half_angles import vectors
from pellicle.data.settings import named
from pellicle.data.spectrum import Spectrum
from pellicle.fitting.curves import BrdfCurve, ColourCurve, Curve
from pellicle.reporting.drawable import CHANNELS, SERIES, Style

RATIOS = {"ane": "AnE", "aps": "Aps", "asp": "Asp"}
"""Ratios as Woollam's programs write them."""
FORMULAS = {"ane": "$r_{pp}/r_{ss}$", "aps": "$r_{ps}/r_{pp}$", "asp": "$r_{sp}/r_{ss}$"}
_POWERS = {"R": "reflectance", "T": "transmittance"}


@dataclass(frozen=True, eq=False)
class Quantity:
    """One measured quantity, arrays (points,); `model` and `residual` are those of a fit.

    `name` is that in tables, `label` has the unit. Angles that turn at 360 degrees have `turns`. In a grid,
    its panel has the row and the column of `place`, a `title`, and at least the range `smallest`. `missed` is
    the residual as it is drawn, None where it is not; `drawn` is the name, colour and style of its line.
    """

    name: str
    label: str
    data: np.ndarray
    sigma: np.ndarray | None = None
    model: np.ndarray | None = None
    residual: np.ndarray | None = None
    missed: np.ndarray | None = None
    drawn: tuple[str, str, Style] = ("residual", "residual", "solid")
    turns: bool = False
    place: tuple[int, int] | None = None
    title: str = ""
    smallest: float = 0.0


def quantities(
    data: Spectrum | Colours | BrdfSamples, curve: Curve | ColourCurve | BrdfCurve | None = None
) -> list[Quantity]:
    """Quantities of measured data, in the order of their columns, with those of a fit's `curve`."""
    if isinstance(data, BrdfSamples):
        assert curve is not None
        return _channels(data, data.values, data.sigma, curve.model, _channel_colours(data.channels))
    if isinstance(data, Colours):
        assert isinstance(curve, ColourCurve)
        return _channels(data, curve.data, curve.sigma, curve.model, CHANNELS)
    assert curve is None or isinstance(curve, Curve)
    if data.ratios:
        return _generalised(data, curve)
    if data.elements:
        return _mueller(data, curve)
    return [_power(data, curve)] if data.delta is None else _psi_delta(data, curve)


def _channels(
    data: Colours | BrdfSamples,
    values: np.ndarray,
    sigma: np.ndarray | None,
    model: np.ndarray,
    colours: Sequence[str],
) -> list[Quantity]:
    """Residuals of channels are drawn in σ, where that is known."""
    residual = values - model
    scaled = residual if sigma is None else residual / sigma
    return [
        Quantity(
            name,
            name,
            **_column([values, model, residual], sigma, c, scaled),
            drawn=(name, colours[c % len(colours)], "point"),
        )
        for c, name in enumerate(data.channels)
    ]


def _channel_colours(channels: Sequence[str]) -> Sequence[str]:
    return CHANNELS if set(channels) <= {"R", "G", "B"} else ("fit", "green", "blue", "fourth")


def power_label(spectrum: Spectrum) -> str:
    """`reflectance`, or `reflectance × unknown scale` of an uncalibrated instrument."""
    label = _POWERS.get(spectrum.signal, str(spectrum.signal))
    return label if spectrum.calibrated else f"{label} × unknown scale"


def _power(data: Spectrum, curve: Curve | None) -> Quantity:
    label = power_label(data)
    if curve is None:
        return Quantity(data.signal, label, data.values, data.sigma)
    return Quantity(data.signal, label, curve.data, curve.sigma, curve.model, curve.residual, curve.residual)


def _psi_delta(data: Spectrum, curve: Curve | None) -> list[Quantity]:
    psi, delta, share = _angles(data, curve)
    sigma = data.sigma if curve is None else curve.sigma
    dashed: Any = ("Δ", "blue", "dashed")
    angles = [
        Quantity("psi", "Ψ (degrees)", **_column(psi, sigma), drawn=("Ψ", "residual", "solid")),
        Quantity("delta", "Δ (degrees)", **_column(delta, data.delta_sigma), drawn=dashed, turns=True),
    ]
    if share[0] is None:
        return angles
    values = _column(share, data.depolarisation_sigma)
    values["missed"] = None  # it has another unit than the residuals of angles
    return [*angles, Quantity("depolarisation", "depolarisation", **values)]


def _angles(data: Spectrum, curve: Curve | None) -> tuple[list[Any], list[Any], list[Any]]:
    """Data, and of a fit model and residual, of Ψ, Δ and depolarisation."""
    if curve is None:
        return [data.values], [data.delta], [data.depolarisation]
    share: list[Any] = [curve.depolarisation_data]
    if share[0] is not None:
        share += [curve.depolarisation_model, curve.depolarisation_residual]
    delta = [curve.delta_data, curve.delta_model, curve.delta_residual]
    return [curve.data, curve.model, curve.residual], delta, share


def _column(
    arrays: list[Any], sigma: np.ndarray | None, column: int | None = None, missed: np.ndarray | None = None
) -> dict[str, Any]:
    """Fields of a quantity: one column of data, of a fit also of model and residual, and of σ.

    `missed` replaces the residual in figures.
    """
    data, model, residual = [*arrays, None, None][:3]
    fields: dict[str, Any] = {"data": data, "model": model, "residual": residual, "sigma": sigma}
    fields["missed"] = residual if missed is None else missed
    return {name: x if x is None or column is None else x[:, column] for name, x in fields.items()}


def weighted_delta(curve: Curve) -> np.ndarray:
    """Residuals of Δ times ½ sin 2Ψ, (points, ratios): what they are on the sphere, in degrees of Ψ.

    Where a ratio is nearly 0, its Δ is noise alone.
    """
    return 0.5 * np.sin(2 * np.deg2rad(curve.model)) * curve.delta_residual


def _generalised(data: Spectrum, curve: Curve | None) -> list[Quantity]:
    quantities = []
    psi, delta, _ = _angles(data, curve)
    sigma = data.sigma if curve is None else curve.sigma
    for i, ratio in enumerate(data.ratios):
        name = RATIOS[ratio]
        missed = None if curve is None else weighted_delta(curve)
        quantities += [
            Quantity(
                f"psi_{ratio}",
                f"Ψ {name} (degrees)",
                **_column(psi, sigma, i),
                drawn=(f"Ψ {name}", SERIES[i], "solid"),
                place=(0, i),
                title=f"Ψ of {name} = {FORMULAS[ratio]} (degrees)",
                smallest=0.5,
            ),
            Quantity(
                f"delta_{ratio}",
                f"Δ {name} (degrees)",
                **_column(delta, data.delta_sigma, i, missed),
                drawn=(f"½ sin 2Ψ Δ {name}", SERIES[i], "dashed"),
                turns=True,
                place=(1, i),
                title=f"Δ of {name} (degrees)",
                smallest=0.5,
            ),
        ]
    return quantities


def _mueller(data: Spectrum, curve: Curve | None) -> list[Quantity]:
    values = [data.values] if curve is None else [curve.data, curve.model, curve.residual]
    sigma = data.sigma if curve is None else curve.sigma
    return [
        Quantity(
            name,
            name,
            **_column(values, sigma, i),
            drawn=(name, f"C{i % 10}", "solid" if i < 10 else "dashed"),
            place=(int(name[1]) - 1, int(name[2]) - 1),
            title=name,
            smallest=0.02,
        )
        for i, name in enumerate(data.elements)
    ]


def abscissa(data: Spectrum | Colours | BrdfSamples) -> tuple[np.ndarray, str]:
    """The x axis (points,) and its label.

    Of a spectrum it is the wavelength, or the angle of incidence or else the azimuth of the sample if there
    is one wavelength only; of BRDF samples the half angle; of colours their number.
    """
    if isinstance(data, BrdfSamples):
        return half_angle(data), "half angle (degrees)"
    if isinstance(data, Colours):
        return np.arange(1.0, len(data) + 1), "colour" if data.angle is None else "angle of incidence"
    if np.unique(data.wavelength).size == 1:
        if data.angle is not None and np.unique(data.angle).size > 1:
            return data.angle, "angle of incidence (degrees)"
        if data.azimuth is not None and np.unique(data.azimuth).size > 1:
            return data.azimuth, "azimuth of the sample (degrees)"
    return data.wavelength, "wavelength (nm)"


def half_angle(samples: BrdfSamples) -> np.ndarray:
    """Angle between the normal and the bisector of light and eye, in degrees, shape (samples,)."""
    theta_i, phi_i, theta_o, phi_o = (
        np.deg2rad(angle) for angle in (samples.theta_i, samples.phi_i, samples.theta_o, samples.phi_o)
    )
    half = vectors(theta_i, phi_i) + vectors(theta_o, phi_o)
    return np.rad2deg(np.arctan2(np.hypot(half[0], half[1]), half[2]))


def lines_of(spectrum: Spectrum) -> list[tuple[np.ndarray, str | None]]:
    """Indices of the points of each line in rising order, and its name, such as `65°` or `azimuth 45°`; None
    if there is one line."""
    x, _ = abscissa(spectrum)
    every = spectrum.settings
    if (x is spectrum.angle and spectrum.azimuth is None) or x is spectrum.azimuth:
        return [(np.argsort(x, kind="stable"), None)]
    if x is spectrum.angle:
        assert spectrum.azimuth is not None
        azimuths = np.unique(spectrum.azimuth)
        groups: Sequence[tuple[np.ndarray, str | None]] = [
            (
                np.flatnonzero(spectrum.azimuth == azimuth),
                f"azimuth {azimuth:g}°" if len(azimuths) > 1 else None,
            )
            for azimuth in azimuths
        ]
    else:
        groups = [(setting.rows, named(setting, every)) for setting in every]
    return [(points[np.argsort(x[points], kind="stable")], name) for points, name in groups]
