"""Summary of a fit of colours: part and curve, evidence of a discrepancy, probability of each minimum."""

from dataclasses import replace

import numpy as np

from pellicle.colour.spaces import delta_e76, lab
from pellicle.data.colours import Colours
from pellicle.fitting.covariance import errors, scaled
from pellicle.fitting.curves import ColourCurve
from pellicle.fitting.discrepancy import Discrepancy, Effect, Evidence
from pellicle.fitting.film.colour_view import ColoursView, Local
from pellicle.fitting.film.systematic_effects import named_for, simulated_effects
from pellicle.fitting.misfit import Accuracy
from pellicle.fitting.reported_layer import layer_errors, principal_indices
from pellicle.fitting.result import Part, Rival
from pellicle.fitting.reweighting import RankedMinima, ViewFit
from pellicle.scene.film import Scene
from pellicle.scene.instrument import Drift


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


LARGEST = 0.03
"""Difference of a channel, in units of its range, that no calibrated camera makes: a ΔE*ab of about 3."""


def colours_evidence(
    view: ColoursView, values: np.ndarray, at: Local, scene: Scene, block: np.ndarray
) -> Evidence:
    """Evidence of colours at `values` (the parameters of the view,), in units of their σ.

    `block` are their rows of the scaled Jacobian, by the σ of their weights.
    """
    weight = np.asarray(view.data.weight)
    columns = block.reshape(view.rows, 3, -1) / weight[:, :, None]
    residual, one = view.residuals(at) / weight, np.ones(weight.shape)
    effects = [
        row.effect(_change(view, at, (weights @ own).reshape(-1, 3)) / weight)
        for row, weights, own in simulated_effects(view, values, scene)
    ]
    effects = named_for([*effects, *_of_exposure(view, at, scene, weight)], view.name)
    counted = weight * np.sqrt(view.independent_fraction)
    return Evidence(residual, columns, one, 1.0, counted, effects, view.correlation_length)


def accuracy(view: ColoursView, sigma: float) -> Accuracy:
    """The residuals, in units of the median `sigma` of the data, that no camera makes."""
    span = 100.0 if view.encoding.mix[0, 1] else 1.0  # L*, a*, b*
    return Accuracy(largest=LARGEST * span / sigma)


def _change(view: ColoursView, at: Local, colours: np.ndarray) -> np.ndarray:
    """A change of the sensor's colours (colours, 3) as the residuals have it."""
    return view.weighted(at, colours @ view.response(at).T)


def _of_exposure(view: ColoursView, at: Local, scene: Scene, weight: np.ndarray) -> list[Effect]:
    """Errors of a known exposure and of a known white balance."""
    size, modes = scene.uncertainty.scale, view.modes
    rows = {"scale": np.ones(3), "balance of red and blue": np.array([1.0, 0.0, -1.0])}
    if any(name.startswith("white_balance") for name in modes):
        rows = {}
    elif isinstance(scene.instrument.scale, Drift):
        del rows["scale"]
    model = np.asarray(at.model)
    return [
        Effect(name, size, "", view.weighted(at, size * model * factor) / weight, shared=False)
        for name, factor in rows.items()
        if size
    ]


def with_probabilities(
    rivals: tuple[Rival, ...], ranked: RankedMinima, discrepancy: Discrepancy
) -> tuple[tuple[Rival, ...], float]:
    """The rivals with their share of the posterior and the standard errors there, the most probable first,
    and the share of the best minimum.

    Orders of interference that the data do not tell apart are weighed by their normal approximations: the
    share is ∝ exp(−Δχ²/2) |C|^½, with C the covariance of the parameters there and Δχ² as the `discrepancy`
    lets it count (D. MacKay, 2003, Information Theory, Inference and Learning Algorithms, eq. 27.5).
    """
    problem, minima = ranked.problem, ranked.minima
    count, variance = len(problem.parameters), [fit.variance for fit in ranked.fits]
    span = np.asarray(problem.box.upper) - np.asarray(problem.box.lower)
    log = -0.5 * discrepancy.evidence_share * (minima.deviance - minima.deviance[0])
    stderr = np.empty((len(log), count))
    for i, unit in enumerate(minima.units):
        values = np.asarray(problem.values(unit))
        at = [view.local(problem.seen_by(view, values)) for view in problem.views]
        information = np.linalg.inv(errors(scaled(problem, unit, at, variance)).covariance[:count, :count])
        # a parameter that the data do not see is known to its bounds
        information += np.diag(12 / span**2)
        stderr[i] = np.sqrt(np.diag(np.linalg.inv(information)))
        log[i] -= 0.5 * np.linalg.slogdet(information)[1]
    share = np.exp(log - log.max())
    share /= share.sum()
    # the rivals are the minima after the first
    rows = zip(rivals, share[1:].tolist(), stderr[1:].tolist(), strict=False)
    weighed = [
        replace(rival, probability=probability, stderr=dict(zip(rival.parameters, errors_there, strict=True)))
        for rival, probability, errors_there in rows
    ]
    return tuple(sorted(weighed, key=lambda rival: -(rival.probability or 0.0))), float(share[0])
