"""From ranked minima to the numbers that a fit reports."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from pellicle.fitting.neighbourhood import valley
from pellicle.fitting.profile_likelihood import ONE_SIDED, Limits, limits
from pellicle.fitting.result import Estimate, Profile, Rival
from pellicle.fitting.spectra import residual_structure
from pellicle.fitting.spectra.covariance import Errors, Linear, linear_coefficients
from pellicle.fitting.spectra.nuisance import Data
from pellicle.fitting.spectra.parameters import Parameter, fixed_numbers, thickness_name
from pellicle.fitting.spectra.problem import Problem, View
from pellicle.fitting.spectra.reweighting import RankedMinima, SpectrumFit
from pellicle.fitting.spectra.targets import Measured, drifts
from pellicle.materials import materials_in
from pellicle.scene.free import insert
from pellicle.scene.layers import Layer

_RULED_OUT = 1e8
_ON_BOUND = 1e-6
_MOST_RIVALS = 10
_ABSORBS = 1e-3
"""An extinction above this is what makes a layer opaque."""
FEWEST_FRINGES = 0.75
"""Fringes that a spectrum must span where scale and offset drift: with fewer, drift can imitate the film.
On real soap films from 510 to 910 nm this is 330 nm, below which no single spectrum was decided."""


def estimates(
    spectra: Sequence[Measured], weighed: RankedMinima, found: Errors, profile: Profile | None
) -> dict[str, Estimate]:
    """Every parameter, free ones first, the thickness before all."""
    problem, unit = weighed.problem, weighed.minima.units[0]
    values = problem.box.values(unit)
    least = _least(spectra, weighed)
    order = sorted(range(len(values)), key=lambda i: problem.parameters[i].key != "thickness")
    seen = {} if profile is None or problem.thickness_axis is None else {problem.thickness_axis: profile}
    bounded = limits(valley(weighed, found.covariance), seen)
    free = [_estimate(problem.parameters[i], values[i], unit[i], bounded[i], least) for i in order]
    coefficients = [
        c
        for view, met in zip(problem.views, weighed.met, strict=True)
        for c in linear_coefficients(view, met.at)
    ]
    linear = [
        _coefficient(c, float(sd)) for c, sd in zip(coefficients, found.stderr[len(values) :], strict=True)
    ]
    fixed = [
        Estimate(name, value, 0.0, unit_, value, value, False)
        for spectrum in spectra
        for name, value, unit_ in fixed_numbers(spectrum.scene, spectrum.name)
    ]
    return {e.name: e for e in [*free, *linear, *fixed]}


def _least(spectra: Sequence[Measured], weighed: RankedMinima) -> float:
    """The thickness (nm) of the only layer below which drift could imitate it, zero without drift."""
    if not all(drifts(m.scene) and len(m.scene.layers) == 1 for m in spectra):
        return 0.0
    return min(thinnest(view, met) for view, met in zip(weighed.problem.views, weighed.met, strict=True))


def thinnest(view: View, met: SpectrumFit) -> float:
    """The thickness (nm) of which the spectrum spans `FEWEST_FRINGES`."""
    keep = slice(view.rows)
    wavelength, n = np.asarray(view.scene.light.wavelength)[keep], np.asarray(met.at.layer)[0, keep]
    order = 2 * n / wavelength
    return float(FEWEST_FRINGES / max(np.ptp(order), 1e-12))


def _estimate(p: Parameter, value: float, position: float, found: Limits, least: float) -> Estimate:
    stderr, lower, upper = found
    if p.key == "thickness" and math.isfinite(stderr) and value < least:
        stderr, upper = math.inf, least
    at_bound = bool(position <= _ON_BOUND or position >= 1 - _ON_BOUND)
    return Estimate(
        p.name, float(value), float(stderr), p.unit, p.lower, p.upper, True, at_bound, lower, upper
    )


def _coefficient(c: Linear, sd: float) -> Estimate:
    """Of the scale or the offset; an offset that may as well be 0 has an upper limit."""
    reach = ONE_SIDED**0.5 * sd
    upper = c.value + reach if c.not_negative and c.value < reach else None
    return Estimate(c.name, c.value, sd, "", -math.inf, math.inf, True, upper_limit=upper)


def rivals(weighed: RankedMinima) -> tuple[Rival, ...]:
    """Every other minimum with its Δχ² on the effective points, best first."""
    problem, minima = weighed.problem, weighed.minima
    above = minima.evidence - minima.evidence[0]
    return tuple(
        Rival(
            {p.name: float(v) for p, v in zip(problem.parameters, problem.box.values(unit), strict=True)},
            float(delta),
        )
        for unit, delta in zip(minima.units[1 : _MOST_RIVALS + 1], above[1:], strict=False)
        if delta < _RULED_OUT
    )


def profile(problem: Problem, weighed: RankedMinima) -> Profile | None:
    """The scan against thickness, in χ² on the effective points; `problem` has the scan's weights."""
    scan = weighed.minima.scan
    if scan is None:
        return None
    ratio = [_reweighed(b.data, a.data) for b, a in zip(problem.views, weighed.problem.views, strict=True)]
    above = (scan.evidence * np.array(ratio)).sum(-1).min(axis=0)
    # on their new weights several views together may have their least misfit elsewhere in the scan
    return Profile(scan.thickness, np.minimum(above - min(above.min(), 0.0), _RULED_OUT))


def _reweighed(before: Data, after: Data) -> float:
    # a robust loss lowers the weights of some points
    ratio = np.max(after.weight / np.where(before.weight > 0, before.weight, np.inf))
    return float(ratio**2 * after.independent_fraction / before.independent_fraction)


def opaque(spectra: Sequence[Measured], weighed: RankedMinima) -> frozenset[str]:
    """Names of the thicknesses of layers that absorb at the best fit."""
    view, values = weighed.problem.views[0], weighed.problem.box.values(weighed.minima.units[0])
    scene = insert(view.scene, values[list(view.takes)])
    wavelength = scene.light.wavelength  # of a padded length, so that nothing is compiled for it again
    found = [
        thickness_name(spectra[0].scene, i)
        for i, layer in enumerate(scene.layers)
        if isinstance(layer, Layer) and np.median(layer.material(wavelength).imag) > _ABSORBS
    ]
    return frozenset(found)


def warnings(spectra: Sequence[Measured], weighed: RankedMinima, unclear: Sequence[str]) -> tuple[str, ...]:
    """What the reader should know before using the numbers; `unclear` is what the data do not decide."""
    told = [w for m in spectra for material in materials_in(m.scene) for w in material.warnings()]
    for spectrum, view, met in zip(spectra, weighed.problem.views, weighed.met, strict=True):
        own = f"{view.name}: " if view.name else ""
        told += [own + sentence for sentence in _of_view(spectrum, view, met)]
    return tuple(dict.fromkeys([*told, *unclear]))


def _of_view(spectrum: Measured, view: View, met: SpectrumFit) -> list[str]:
    told, scene, length = [], spectrum.scene, met.length
    orders = view.plan.row("orders")
    if orders.on and orders.error_bound > max(1e-4, view.plan.tolerance):
        told.append(f"{orders.count} orders leave an error of up to {orders.error_bound:.1g}: |q| is near 1")
    if length >= 10:
        told.append(
            f"residuals are correlated over {length:.0f} points: {view.rows} points"
            f" count as {view.rows / length:.0f}"
        )
    if where := residual_structure.missed(view, met):
        told.append(f"the model misses structure {where.words}")
    if met.outliers:
        told.append(f"{met.outliers} of {view.rows} points lie so far off that they count for less than half")
    if scene.light.signal == "T" and scene.substrate.back is None:
        told.append(
            "transmittance into the substrate, as if the detector were inside it: add --back air for a plate"
        )
    return told
