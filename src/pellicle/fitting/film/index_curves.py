"""Curves of n and k of a layer whose absorbing index is free: what other ones change of the result.

One spectrum seldom determines n, k and a thickness, and the formula chosen for the index decides what its own
errors cannot show. Splines of k with the n of Kramers and Kronig are fitted too, from several starts and at
many thicknesses; and splines of n and k without that relation where none of these explains the data. Those
that explain them about as well, where each further number must lower χ² by one, by ln N beside a formula that
reaches the noise of N values, and the fitted formula at other thicknesses, enlarge the errors of n, k and the
thickness.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import equinox as eqx
import numpy as np

from pellicle.dispersion.base import HC, known_index
from pellicle.dispersion.empirical import CauchyUrbach, Constant
from pellicle.dispersion.oscillators import Oscillators
from pellicle.dispersion.spline import KramersKronigSpline, Spline
from pellicle.fitting.assembly import Assembly
from pellicle.fitting.conclusion import Conclusion
from pellicle.fitting.curves import at_each_wavelength
from pellicle.fitting.film.parameters import thickness_name
from pellicle.fitting.film.problem import Measured, Target, make
from pellicle.fitting.minima import solve
from pellicle.fitting.noise import student
from pellicle.fitting.problem import Problem
from pellicle.fitting.reported_layer import reported_layer, reported_medium
from pellicle.fitting.result import Estimate, Part, Status
from pellicle.fitting.reweighting import RankedMinima
from pellicle.fitting.status import RIVAL, WELL_KNOWN, apart_from, distinct_rivals, expanded
from pellicle.optics.pair import imag, real
from pellicle.scene.free import Free, free_leaves, insert
from pellicle.scene.ties import touches_ties

_KNOTS, _BEYOND = (9, 16), (1.15, 1.05)
"""Knots of the splines, evenly spaced in photon energy, and factors by which they go beyond the blue and the
red end: absorption next to the spectrum changes n in it. Without that 14 knots follow pigments to 0.003."""
_LARGEST = 10.0, 6.0, 100.0, 30.0
"""Largest coefficient of k, n_inf, and strengths of the poles (eV²) of the splines."""
_GUESSES = ((1.7, 0.05), (2.3, 0.4), (3.0, 0.05), (2.5, 1.5))
"""n, and k at the blue end, from which splines start; k falls evenly to zero at the red end."""
_NEAR = (1.0, 0.95, 0.98, 1.02, 1.05)
"""Thicknesses that are tried, by that of the start."""
_STEP, _FRINGE, _MOST = 0.3, 16.0, 48
"""Further ones between the bounds are apart by this share of the thickness and by the shortest wavelength
over `_FRINGE` together, up to so many of them: steps of a third alone missed 210 nm of CuO in Ψ and Δ."""
_POLISHED, _FOLLOWED = 16, 6
"""Best of the fits at given thicknesses that are fitted on with a free one, and thicknesses at which a spline
of more knots follows."""
_EXPLAINED, _WHITE = 1.5, 2.0
"""Reduced χ², by a given σ, up to which a curve explains the data; number of neighbouring points that count
as one below which residuals are white."""


class IndexCurves(NamedTuple):
    """Curves that explain the data about as well as the best of them, the fitted one first.

    `above` (curves,) is χ² above the best, `thickness` (curves,) in nm, NaN where it is given, `curves`
    (curves, 2, wavelengths) n and k at wavelengths `nm`. `depth` is the name of the layer's thickness, empty
    where that is given, `medium` those of the formula's numbers. `left` is the reduced χ² of the best curve.
    """

    above: np.ndarray
    thickness: np.ndarray
    curves: np.ndarray
    nm: np.ndarray
    depth: str
    medium: frozenset[str]
    left: float

    def spread(self, values: np.ndarray) -> Any:
        """Standard error for what differs between the curves, of `values` (curves, ...) of them."""
        weight = np.sqrt(np.maximum(self.above, 1.0)).reshape(-1, *[1] * (values.ndim - 1))
        return np.max(np.abs(values - values[0]) / weight, axis=0)

    def part(self, part: Part) -> Part:
        """The part with the spread in the errors of its n and k."""
        curve, (n, k) = part.spectral, self.spread(self.curves)
        n, k = (np.interp(curve.wavelength, self.nm, x) for x in (n, k))
        errors = {"n_stderr": np.hypot(curve.n_stderr, n), "k_stderr": np.hypot(curve.k_stderr, k)}
        return replace(part, curve=replace(curve, **errors))

    def applied(self, judged: Assembly) -> Assembly:
        """The judged fit with the spread in its errors and its status."""
        parts = tuple(self.part(part) for part in judged.parts)
        return judged._replace(parts=parts, conclusion=self.conclusion(judged.conclusion, parts))

    def conclusion(self, before: Conclusion, parts: Sequence[Part]) -> Conclusion:
        """The conclusion with the spread in the error of the thickness. Where nothing but the thickness and
        the formula's numbers is ambiguous, or rests on a default bound, the status is that of the thickness,
        else of n + ik; a misfit of the formula alone is none of the scene."""
        parameters, status, lead = dict(before.parameters), before.status, before.parameters.get(self.depth)
        every = [part.spectral for part in parts]
        errors = [np.hypot(x.n_stderr, x.k_stderr) / np.hypot(x.n, x.k) for x in every]
        known = all(np.median(x) <= WELL_KNOWN for x in errors)
        if lead is not None:
            stderr = math.hypot(lead.stderr, float(self.spread(self.thickness)))
            parameters[self.depth], known = replace(lead, stderr=stderr), stderr <= WELL_KNOWN * lead.value
        rivals = distinct_rivals(parameters, before.rivals)
        apart = {name for rival in rivals for name in apart_from(parameters, rival)}
        binding = [p for p in parameters.values() if p.binding]
        bound = bool(binding) and all(p.default_bounds and p.name in self.medium for p in binding)
        formula = [Status.MISFIT] if self.left < _EXPLAINED else []
        judged = status in (Status.CONVERGED, Status.AMBIGUOUS, *formula)
        if (judged or (bound and status is Status.AT_BOUND)) and apart <= self.medium | {self.depth}:
            status = Status.AMBIGUOUS if not known else Status.CONVERGED if judged else status
        return before._replace(parameters=parameters, status=status)

    def verdict(self, status: Status, lead: Estimate, parts: Sequence[Part]) -> str:
        """The verdict on n and k, or on a thickness that they leave undetermined; empty on another one."""
        spectra = [part.spectrum for part in parts]
        angles = [np.ravel(x.angle) for x in spectra if x.angle is not None] or [np.zeros(1)]
        known = [any(x.ellipsometric for x in spectra), any(x.signal == "T" for x in spectra)]
        known, words = [*known, np.ptp(np.concatenate(angles)) > 0], ("ψ and Δ", "T", "a second angle")
        more = [word for word, has in zip(words, known, strict=True) if not has]
        decide = f" {', '.join([*more, 'a film of another thickness'])}: any of these may decide it."
        if self.depth and status is Status.AMBIGUOUS:
            low, high = (f"{end(self.thickness):.3g}" for end in (np.min, np.max))
            best = expanded(lead) if lead.stderr < lead.value else f"{lead.value:.3g} {lead.unit}"
            fits = f"{best} fits best, but {low} to {high} nm fit about as well with other n and k"
            return f"The data do not determine {lead.name}: {fits}.{decide}"
        if self.depth or status not in (Status.CONVERGED, Status.AMBIGUOUS):
            return ""
        [(where, middle)] = (
            at_each_wavelength([part.spectral for part in parts]).at([np.median(self.nm)]).rows
        )
        if status is Status.CONVERGED:
            return f"The data determine n and k of the layer: {middle} at {where}."
        return f"Several curves of n and k explain the data about as well: {middle} at {where}.{decide}"

    @property
    def remark(self) -> list[str]:
        """A sentence where a spline explains the data clearly better than the fitted formula does."""
        better = f"a spline of n and k with {_KNOTS[0]} to {_KNOTS[-1]} knots explains the data better"
        at = f", {self.depth} {self.thickness[np.argmin(self.above)]:.4g} nm" if self.depth else ""
        what = "the errors of n and k include the difference, those of the formula's numbers do not"
        return [f"{better} (Δχ² {self.above[0]:.3g}{at}): {what}"] if self.above[0] > RIVAL else []


class _Fits(NamedTuple):
    """Fits of curves at wavelengths `nm`: the targets and ranked minima, `others`, the names of parameters
    that are none of the index, and `depth`, that of the thickness."""

    targets: Sequence[Target]
    ranked: RankedMinima
    others: frozenset[str]
    depth: str
    nm: np.ndarray

    def described(self, problem: Problem, medium: Any, deviance: Any, values: np.ndarray) -> tuple[Any, ...]:
        """χ² above the fit, how many more numbers are free, thicknesses, and curves of `medium`."""
        names = [p.name for p in problem.parameters]
        own = [i for i, name in enumerate(names) if name not in self.others]
        further = len(own) - sum(p.name not in self.others for p in self.ranked.problem.parameters)
        curves = np.array([_complex(insert(medium, x[own].tolist()), self.nm) for x in values])
        at = values[:, names.index(self.depth)] if self.depth in names else np.full(len(curves), math.nan)
        return deviance - self.ranked.minima.deviance[0], np.full(len(curves), further), at, curves

    def at_thicknesses(self, problem: Problem, medium: Any, starts: np.ndarray, near: bool = False) -> Any:
        """Fits from each start, described so: at all or `near` thicknesses, and from the best of these."""
        lower, span = problem.box.lower, problem.box.upper - problem.box.lower
        axis = next((i for i, p in enumerate(problem.parameters) if p.name == self.depth), None)
        if axis is None:
            found = solve(problem, np.clip((starts - lower) / span, 1e-4, 1 - 1e-4))
            return self.described(problem, medium, found.deviance, np.asarray(problem.values(found.units)))
        fine = np.geomspace(max(lower[axis], 1.0), max(lower[axis] + span[axis], 2.0), 500)
        steps = np.log(fine) / _STEP + fine * _FRINGE / self.nm.min()
        count = 0 if near else min(math.ceil(np.ptp(steps)), _MOST)
        wide = np.interp(np.linspace(steps[0], steps[-1], count), steps, fine)
        held = np.vstack([np.outer(_NEAR, starts[:, axis]), np.tile(wide[:, None], len(starts))])
        every = np.tile(starts, (len(held), 1))
        every[:, axis] = np.clip(held.ravel(), lower[axis], lower[axis] + span[axis])
        found = solve(problem, np.clip((every - lower) / span, 1e-4, 1 - 1e-4), fixed=(axis, every[:, axis]))
        values = np.array(problem.values(found.units))
        values[:, axis] = every[:, axis]
        again = solve(problem, ((values - lower) / span)[np.argsort(found.deviance)[:_POLISHED]])
        both = np.concatenate([values, np.asarray(problem.values(again.units))])
        return self.described(problem, medium, np.append(found.deviance, again.deviance), both)

    def of_spline(
        self, knots: int, guesses: Sequence[np.ndarray], depths: Any = None, related: Any = True
    ) -> Any:
        """Fits of a spline with all numbers free, described so, from curves near to `guesses`, at all
        thicknesses or near those of the guesses, `depths`; of n and k that are not `related` by Kramers and
        Kronig too."""
        from scipy.optimize import lsq_linear  # SciPy's linear algebra takes longer to load than most fits

        ends = _BEYOND[0] * HC / self.nm.min(), HC / self.nm.max() / _BEYOND[1]
        sites = (HC / np.linspace(*ends, knots)).tolist()
        upper = [_LARGEST[0]] * knots + ([*_LARGEST[1:]] if related else [_LARGEST[0]] * knots)

        def build(x: Sequence[Any]) -> Any:
            a, b = x[:knots], x[knots:]
            return KramersKronigSpline(sites, a, *b) if related else Spline(sites, a, b)

        curves = [_complex(build(x.tolist()), self.nm).ravel() for x in np.eye(len(upper))]
        spline, before = build([Free(0.0, x) for x in upper]), self.ranked.problem
        problem = make(*_with_medium(self.targets, spline))
        views = zip(problem.views, before.views, strict=True)
        problem = problem._replace(views=tuple(replace(view, data=own.data) for view, own in views))
        known = dict(zip([p.name for p in before.parameters], self.ranked.values.tolist(), strict=True))
        starts = np.array([[known.get(p.name, 0.0) for p in problem.parameters]] * len(guesses))
        near = [lsq_linear(np.transpose(curves), x.ravel(), (0.0, upper)).x for x in guesses]
        starts[:, [p.name not in self.others for p in problem.parameters]] = near
        if depths is not None and self.depth:
            starts[:, [p.name for p in problem.parameters].index(self.depth)] = depths
        return self.at_thicknesses(problem, spline, starts, depths is not None)


def index_curves(judged: Assembly, targets: Sequence[Target]) -> IndexCurves | None:
    """The curves of n and k about the best of the ranked minima; None where no absorbing index is free."""
    scene, ranked, old = targets[0].scene, judged.best.ranked, judged.best.ranked.problem
    medium, shown = reported_medium(scene), reported_layer(scene)
    formula = isinstance(medium, KramersKronigSpline | Oscillators | CauchyUrbach | Spline)
    known = [t.wavelength for t in targets if isinstance(t, Measured)]
    if (
        not formula
        or scene.sample is not None
        or not free_leaves(medium)
        or touches_ties(scene, medium)
        or getattr(medium, "k", ()) is None
        or len(known) < len(targets)
    ):
        return None
    names, nm = frozenset(p.name for p in old.parameters), np.unique(np.concatenate(known))
    others = frozenset(p.name for p in make(*_with_medium(targets, Constant(1.5))).parameters)
    depth = "" if shown is None else thickness_name(scene, shown)
    depth, minima = depth if depth in names else "", np.asarray(old.values(ranked.minima.units))
    fits = _Fits(targets, ranked, others, depth, nm)
    found = [fits.described(old, medium, ranked.minima.deviance, minima)]
    found.append(fits.at_thicknesses(old, medium, minima[:1]))
    fall = (1 / nm - 1 / nm.max()) / max(1 / nm.min() - 1 / nm.max(), 1e-12)
    guesses = [found[0][3][0], *(np.stack([np.full(nm.size, n), k * fall]) for n, k in _GUESSES)]
    found.append(fits.of_spline(_KNOTS[0], guesses))
    best = apart(found[-1][0], found[-1][2])
    found.append(fits.of_spline(_KNOTS[1], list(found[-1][3][best]), found[-1][2][best]))
    deviance = float(ranked.minima.deviance[0])
    left = ranked.chi2_reduced * (1 + min(x[0].min() for x in found) / deviance)
    # measured n and k obey Kramers and Kronig as well as they are measured
    points = sum(view.rows * view.measured_channels for view in old.views)
    if left > _EXPLAINED and points >= 2 * nm.size:
        found.append(fits.of_spline(_KNOTS[0], guesses, None, False))
        left = min(left, ranked.chi2_reduced * (1 + found[-1][0].min() / deviance))
    above, further, thickness, curves = (np.concatenate(x) for x in zip(*found, strict=True))
    # residuals that no curve explains are no noise either; those of the formula alone do not correlate it
    share, left = 1 / max(left, 1.0), left if all(view.noise.given for view in old.views) else math.inf
    if left < _EXPLAINED:
        share *= sum(fit.chi2 for fit in ranked.fits) / deviance
    else:
        share = min(float(judged.best.discrepancy.evidence_share), share)
    # few numbers that leave only noise do so seldom by chance: a number then costs what it does in the BIC
    white = math.isinf(left) and all(fit.length < _WHITE for fit in ranked.fits)
    reached = white or (math.isfinite(left) and ranked.chi2_reduced < 1 + 2 * math.sqrt(2 / points))
    cost = math.log(points) if reached else 1.0
    above = share / student(ranked.freedom, RIVAL) ** 2 * above + cost * further
    above[1:][np.min(curves[1:, 0], axis=1) <= 0] = math.inf  # no layer has such an n
    close = above - above.min() < RIVAL
    close[0] = True
    about = above[close] - above.min(), thickness[close], curves[close]
    return IndexCurves(*about, nm, depth, names - others, left)


def apart(above: np.ndarray, thickness: np.ndarray) -> np.ndarray:
    """Positions of the best fits by χ², those of about one thickness once."""
    order = np.argsort(above)
    _, first = np.unique(np.round(10 * np.log(thickness[order])), return_index=True, equal_nan=False)
    return order[np.sort(first)[:_FOLLOWED]]


def _complex(medium: Any, nm: np.ndarray) -> np.ndarray:
    """n and k (2, wavelengths) of a medium of numbers."""
    found = known_index(medium, nm)
    return np.stack([np.broadcast_to(part(found), nm.shape) for part in (real, imag)])


def _with_medium(targets: Sequence[Target], medium: Any) -> list[Any]:
    """The targets with another medium of the reported layer."""
    shown = reported_layer(targets[0].scene)

    def where(scene: Any) -> Any:
        return (scene.substrate if shown is None else scene.layers[shown]).material

    return [t._replace(scene=eqx.tree_at(where, t.scene, medium)) for t in targets]
