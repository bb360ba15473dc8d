"""Fit quality and curve of colours of a fit."""

from __future__ import annotations

import numpy as np

from pellicle.colour.spaces import delta_e76, lab
from pellicle.data.colours import Colours
from pellicle.fitting.curves import ColourCurve
from pellicle.fitting.film.colour_view import ColoursView, Local
from pellicle.fitting.film.layer_errors import layer_errors, principal_indices
from pellicle.fitting.result import Part
from pellicle.fitting.reweighting import ViewFit


def colours_part(colours: Colours, view: ColoursView, fit: ViewFit, covariance: np.ndarray) -> Part:
    """The part of a fit that colours are; `covariance` is that of the parameters of the view."""
    return Part(
        name=view.name,
        data=colours,
        curve=colour_curve(colours, view, fit.at, covariance),
        plan=view.plan,
        rms=view.rms(fit.at),
        chi2_reduced=fit.chi2 / fit.freedom,
        effective_points=view.rows / fit.length,
        sigma_from="usual" if colours.sigma is None else "given",
    )


def colour_curve(colours: Colours, view: ColoursView, at: Local, covariance: np.ndarray) -> ColourCurve:
    """Data and model in the space of the data, and the layer's index at the wavelengths of the sensor."""
    bands = slice(len(colours.sensor[0]))
    n_stderr, k_stderr = layer_errors(at, covariance, bands.stop)
    n, k = np.asarray(at.layer)[:2, bands]
    return ColourCurve(
        data=colours.values,
        sigma=colours.noise,
        model=view.encoded(at.model),
        difference=_difference(colours, view, at),
        wavelength=colours.sensor[0],
        n=n,
        k=k,
        n_stderr=n_stderr,
        k_stderr=k_stderr,
        principal=principal_indices(view.scene, at, covariance, colours.sensor[0]),
    )


def _difference(colours: Colours, view: ColoursView, at: Local) -> np.ndarray | None:
    """ΔE*ab of each colour, None where the channels are those of a camera."""
    if colours.space == "rgb" and colours.camera is None:
        return None
    white = colours.sensor[1].sum(axis=0)
    to_xyz = np.linalg.inv(view.encoding.linear)
    both = (np.asarray(lab(np.asarray(x) @ to_xyz.T, white)) for x in (view.data.values, at.model))
    return np.asarray(delta_e76(*both))
