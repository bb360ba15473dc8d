"""Fit quality, curves and misfit of each spectrum, and of colours, of a fit."""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from pellicle.data.colours import Colours
from pellicle.data.spectrum import Spectrum
from pellicle.fitting.covariance import Errors
from pellicle.fitting.curves import ColourCurve, Curve, Deferred
from pellicle.fitting.discrepancy import Discrepancy
from pellicle.fitting.film.colour_measurements import accuracy as colours_accuracy
from pellicle.fitting.film.colour_measurements import colour_curve, unlike
from pellicle.fitting.film.colour_view import ColoursView
from pellicle.fitting.film.fringes import Fringes
from pellicle.fitting.film.view import Local, SpectrumView
from pellicle.fitting.misfit import Accuracy, misfit
from pellicle.fitting.reported_layer import index_of_layer
from pellicle.fitting.result import Part, Rival
from pellicle.fitting.reweighting import RankedMinima, ViewFit

_LARGEST_POWER, _LARGEST_ANGLES = 0.02, 0.02
"""Structure in residuals of R and T, and of N, C and S (0.6° of Ψ), that no calibrated instrument makes."""
_NOISIEST = 0.1
"""Noise of N, C and S (3° of Ψ) that no ellipsometer has: of a few points residuals have no structure."""
_LARGEST_DRIFT = 1.0
"""Structure in residuals that no drifting lamp makes, in units of the error that its model has: 0.7 of it
remains in a soap film of known thickness, 1.3 of titania on silicon that is fitted as a soap film."""


def parts(data: list[Spectrum | Colours], ranked: RankedMinima, errors: Errors) -> tuple[Part, ...]:
    """One part for each spectrum and each set of colours, in their order."""

    def part(own: Spectrum | Colours, view: SpectrumView | ColoursView, fit: ViewFit) -> Part:
        covariance = errors.covariance[np.ix_(view.takes, view.takes)]
        if isinstance(own, Colours):
            assert isinstance(view, ColoursView)
            curve, rms = colour_curve(own, view, fit.at, covariance), view.rms(fit.at)
            source = "usual" if own.sigma is None else "given"
        else:
            assert isinstance(view, SpectrumView)
            curve, rms = _curve(own, view, fit.at, covariance), view.rms(fit.at.model)
            source = "given" if view.noise.given else "model" if view.noise.drifting else "residuals"
        about = view.name, own, curve, view.plan, rms
        return Part(*about, fit.chi2 / fit.freedom, view.rows / fit.length, source)

    rows = zip(data, ranked.problem.views, ranked.fits, strict=True)
    return tuple(part(own, view, fit) for own, view, fit in rows)


def together(parts: tuple[Part, ...]) -> float | None:
    """rms over all spectra, None where they have no unit in common."""
    if len(parts) == 1:
        return parts[0].rms
    spectra = [part.data for part in parts if isinstance(part.data, Spectrum)]
    units = {"power" if spectrum.kind.has_scale else spectrum.signal for spectrum in spectra}
    if len(spectra) < len(parts) or len(units) > 1 or not all(spectrum.calibrated for spectrum in spectra):
        return None
    sizes = [part.spectral.wavelength.size for part in parts]
    return math.sqrt(np.average([part.rms**2 for part in parts], weights=sizes))


def missed(
    parts: tuple[Part, ...], ranked: RankedMinima, discrepancy: Discrepancy, silent: Sequence[Fringes | None]
) -> tuple[Part, ...]:
    """Spectra that the scene does not explain, and those of which it misses clear fringes, the `silent`."""
    each = zip(parts, ranked.problem.views, discrepancy.remaining, silent, strict=True)
    return tuple(
        part
        for part, view, left, fringe in each
        if fringe is not None
        or misfit(discrepancy, left, _part_accuracy(part, view))
        or (isinstance(part.data, Colours) and unlike(part))
    )


def with_curves(
    rivals: tuple[Rival, ...], parts: tuple[Part, ...], ranked: RankedMinima
) -> tuple[Rival, ...]:
    """The rivals with the curve of each part there, computed when it is first read. The program that computed
    the parts computes them."""

    def curve(part: Part, view: Any, values: np.ndarray) -> Curve | ColourCurve:
        at = view.local(ranked.problem.seen_by(view, values))
        unknown = np.full((len(view.takes), len(view.takes)), np.nan)
        if isinstance(part.data, Colours):
            return colour_curve(part.data, view, at, unknown)
        return _curve(part.spectrum, view, at, unknown)

    def curves(rival: Rival) -> tuple[Curve | ColourCurve, ...]:
        values = np.array(list(rival.parameters.values()))
        pairs = zip(parts, ranked.problem.views, strict=True)
        return tuple(curve(part, view, values) for part, view in pairs)

    return tuple(replace(rival, curves=Deferred(len(parts), partial(curves, rival))) for rival in rivals)


def _part_accuracy(part: Part, view: SpectrumView | ColoursView) -> Accuracy:
    if isinstance(view, ColoursView):
        return colours_accuracy(view, part.sigma)
    return accuracy(view, part.spectrum.calibrated, np.asarray(view.data.values)[: view.points])


def accuracy(view: SpectrumView, calibrated: bool, values: np.ndarray) -> Accuracy:
    """The structure that no instrument makes in residuals of spectra of one view with `values` (..., points).

    Only R and T use their values.
    """
    if view.signal.ellipsometric:
        # of Ψ and Δ the range says nothing: on a thin oxide it is that of the substrate
        return Accuracy(_LARGEST_ANGLES, noise=math.inf if view.noise.known else _NOISIEST)
    if view.noise.drifting:
        return Accuracy(weighted=_LARGEST_DRIFT)
    return Accuracy(_LARGEST_POWER if calibrated else math.inf, np.ptp(values, axis=-1))


def _curve(spectrum: Spectrum, view: SpectrumView, at: Local, covariance: np.ndarray) -> Curve:
    """Data, model and the layer's index with errors, at the real points."""
    rows = view.rows
    wavelength = np.asarray(view.scene.light.wavelength)[:rows]
    data, model = view.in_columns(view.data.values), view.in_columns(at.model)
    weight = np.asarray(view.data.weight)[: view.points].reshape(rows, view.channels)
    arrays = view.signal.curves(data, model, weight)
    if (share := spectrum.kind.share) is not None:
        # a scene without depolarisation has none at any wavelength
        arrays["depolarisation_data"] = share.measured(spectrum)
        arrays.setdefault("depolarisation_model", np.zeros(rows))
    return Curve(**arrays, **index_of_layer(view.scene, at, covariance, wavelength))
