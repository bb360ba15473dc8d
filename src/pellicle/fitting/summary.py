"""From ranked minima to the numbers that a fit reports."""

from __future__ import annotations

import math

import numpy as np

from pellicle.fitting.parameters import Parameter, fixed_numbers
from pellicle.fitting.problem import Problem
from pellicle.fitting.result import Curve, Estimate, Profile, Rival
from pellicle.fitting.status import RIVAL
from pellicle.fitting.uncertainty import UNSEEN, Errors, layer_errors, linear_coefficients
from pellicle.fitting.weigh import Weighed
from pellicle.materials import materials_in
from pellicle.scene import Drift, Scene

_RULED_OUT = 1e8
_ONE_SIDED = 2.71
"""χ² above the best at a one-sided 95 % limit."""
_LEAST_RISE = 0.1
"""Smaller rises of χ² are counted as this one: their logarithm is that of rounding, not of a film."""
_OPEN = RIVAL
"""A side where the misfit never rises by as much as would rule a rival out is open."""
_ON_BOUND = 1e-6
_NEAR = 1e-3
"""A best thickness this close (nm) to a bound rests on it; the side is open if the misfit is flat there."""
_MOST_RIVALS = 10
FEWEST_FRINGES = 0.75
"""Fringes that a spectrum must span where scale and offset drift: with fewer, drift can imitate the film.
On real soap films from 510 to 910 nm this is 330 nm, below which no single spectrum was decided."""


def estimates(scene: Scene, weighed: Weighed, found: Errors, profile: Profile | None) -> dict[str, Estimate]:
    """Every parameter, free ones first, the thickness before all."""
    problem, unit = weighed.problem, weighed.minima.units[0]
    values = problem.box.values(unit)
    least = thinnest(weighed) if drifts(scene) and len(scene.layers) == 1 else 0.0
    scanned = problem.thickness_axis
    free = [
        _estimate(p, values[i], found.stderr[i], unit[i], profile if i == scanned else None, least)
        for i, p in enumerate(problem.parameters)
    ]
    free.sort(key=lambda e: e.name.split(".")[-1] != "thickness")
    linear = [
        Estimate(c.name, c.value, float(sd), "", -math.inf, math.inf, True)
        for c, sd in zip(
            linear_coefficients(problem, weighed.at), found.stderr[len(problem.parameters) :], strict=True
        )
    ]
    fixed = [
        Estimate(name, value, 0.0, unit_, value, value, False) for name, value, unit_ in fixed_numbers(scene)
    ]
    return {e.name: e for e in [*free, *linear, *fixed]}


def drifts(scene: Scene) -> bool:
    """Whether the scale varies along the spectrum."""
    return isinstance(scene.instrument.scale, Drift) and scene.instrument.scale.degree > 0


def thinnest(weighed: Weighed) -> float:
    """The thickness (nm) of which the spectrum spans `FEWEST_FRINGES`."""
    keep = slice(weighed.problem.rows)
    wavelength, n = (
        np.asarray(weighed.problem.scene.light.wavelength)[keep],
        np.asarray(weighed.at.layer)[0, keep],
    )
    order = 2 * n / wavelength
    return float(FEWEST_FRINGES / max(np.ptp(order), 1e-12))


def _estimate(
    p: Parameter, value: float, stderr: float, position: float, profile: Profile | None, least: float
) -> Estimate:
    at_low, at_high = bool(position <= _ON_BOUND), bool(position >= 1 - _ON_BOUND)
    lower_limit = upper_limit = None
    if p.key == "thickness" and profile is not None:
        lower_limit, upper_limit, bounded = _limits(profile, float(value))
        if bounded and value < least:
            upper_limit, bounded = least, False
        stderr = stderr if bounded else math.inf
    elif at_low and p.natural_lower:
        upper_limit = float(min(value + 1.645 * stderr, p.upper))
    if stderr > UNSEEN * (p.upper - p.lower):
        stderr = math.inf
    return Estimate(
        p.name,
        float(value),
        float(stderr),
        p.unit,
        p.lower,
        p.upper,
        True,
        at_low or at_high,
        lower_limit,
        upper_limit,
    )


def _limits(profile: Profile, best: float) -> tuple[float | None, float | None, bool]:
    """One-sided limits where the misfit never rises between the best thickness and a bound.

    Returns (lower, upper, bounded): both None and True where both sides are bounded.
    """
    close, level = profile.delta_chi2 < _ONE_SIDED, profile.delta_chi2 < _OPEN
    left, right = profile.thickness < best - _NEAR, profile.thickness > best + _NEAR
    open_left = _stays(level, left) if left.any() else bool(close[right][:1].all())
    open_right = _stays(level, right) if right.any() else bool(close[left][-1:].all())
    if not (open_left or open_right):
        return None, None, True
    lower = None if open_left else _crossing(profile, best, left & ~close, -1)
    upper = None if open_right else _crossing(profile, best, right & ~close, 0)
    return lower, upper, False


def _stays(level: np.ndarray, side: np.ndarray) -> bool:
    return bool(level[side].all())


def _crossing(profile: Profile, best: float, beyond: np.ndarray, nearest: int) -> float:
    """Where Δχ² reaches the limit, between the nearest point beyond it and the next one towards the best.

    Light that returns through an absorber falls exponentially with its thickness, and Δχ² with it: its
    logarithm is taken as linear.
    """
    if not beyond.any():
        return best
    at = np.flatnonzero(beyond)[nearest]
    inner = at + (1 if nearest < 0 else -1)
    far, delta = profile.thickness[at], float(profile.delta_chi2[at])
    near, low = profile.thickness[inner], float(profile.delta_chi2[inner])
    if abs(best - far) <= abs(near - far):
        near, low = best, 0.0
    low = max(low, _LEAST_RISE)
    return float(far + (near - far) * math.log(delta / _ONE_SIDED) / math.log(delta / low))


def rivals(weighed: Weighed) -> tuple[Rival, ...]:
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


def profile(problem: Problem, weighed: Weighed) -> Profile | None:
    """The scan against thickness, in χ² on the effective points."""
    scan = weighed.minima.scan
    if scan is None:
        return None
    before, after = problem.data, weighed.problem.data
    ratio = (after.weight[0] / before.weight[0]) ** 2 * after.temper / before.temper
    return Profile(scan.thickness, np.minimum(scan.evidence * ratio, _RULED_OUT))


def curve(problem: Problem, weighed: Weighed, found: Errors) -> Curve:
    """Data, model and the layer's index with errors, at the real points."""
    at, rows, count = weighed.at, problem.rows, len(problem.parameters)
    n_stderr, k_stderr = layer_errors(at, found.covariance[:count, :count], rows)
    n, k = np.asarray(at.layer)[:, :rows]
    keep, shape = slice(problem.points), (rows, problem.channels)
    data, model = problem.data.values[keep].reshape(shape), np.asarray(at.model)[keep].reshape(shape)
    sigma = 1 / weighed.problem.data.weight[keep].reshape(shape)[:, 0]
    angles = {}
    if problem.channels == 3:
        (data, delta_data), (model, delta_model) = _psi_delta(data), _psi_delta(model)
        sigma, angles = np.rad2deg(sigma) / 2, {"delta_data": delta_data, "delta_model": delta_model}
    return Curve(
        wavelength=np.asarray(problem.scene.light.wavelength)[:rows],
        data=np.ravel(data),
        sigma=sigma,
        model=np.ravel(model),
        n=n,
        k=k,
        n_stderr=n_stderr,
        k_stderr=k_stderr,
        **angles,
    )


def _psi_delta(sphere: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Ψ and Δ in degrees from N, C, S (points, 3)."""
    n, c, s = sphere.T
    return np.rad2deg(np.arctan2(np.hypot(c, s), n)) / 2, np.rad2deg(np.arctan2(s, c)) % 360.0


def effective_points(problem: Problem, weighed: Weighed) -> float:
    """How many independent points the spectrum is worth."""
    return problem.rows / weighed.length


def warnings(scene: Scene, weighed: Weighed, found: Errors) -> tuple[str, ...]:
    """What the reader should know before using the numbers."""
    told = [w for material in materials_in(scene) for w in material.warnings()]
    orders = weighed.problem.plan.row("orders")
    if orders.on and orders.error_bound > 1e-4:
        told.append(f"{orders.count} orders leave an error of up to {orders.error_bound:.1g}: |q| is near 1")
    if weighed.length >= 10:
        told.append(
            f"residuals are correlated over {weighed.length:.0f} points: {weighed.problem.rows} points"
            f" count as {weighed.problem.rows / weighed.length:.0f}"
        )
    if scene.light.signal == "T" and scene.substrate.back is None:
        told.append(
            "transmittance into the substrate, as if the detector were inside it: add --back air for a plate"
        )
    return tuple(dict.fromkeys([*told, *_trades(weighed, found)]))


def _trades(weighed: Weighed, found: Errors) -> list[str]:
    names, matrix = found.names[: len(weighed.problem.parameters)], found.correlation
    return [
        f"{names[i]} and {names[j]} trade against each other (correlation {matrix[i, j]:+.3f})"
        for i in range(len(names))
        for j in range(i)
        if abs(matrix[i, j]) > 0.99
    ]
