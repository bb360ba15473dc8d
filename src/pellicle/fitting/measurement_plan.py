"""Measurements that are not made yet: the evidence between rival scenes, and the errors, to expect of each.

One scene is simulated and another refitted to that signal: its free numbers by Gauss-Newton steps, with
systematic effects integrated out (`fitting.marginal`). What its evidence then lacks to that of the true scene
is what the measurement decides (D. Lindley 1956, Ann. Math. Stat. 27, 986).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import permutations
from logging import getLogger
from typing import Any, NamedTuple

import jax
import numpy as np

from pellicle.data.spectrum import Spectrum
from pellicle.errors import UsageError
from pellicle.fitting.comparison import shared_effects
from pellicle.fitting.covariance import UNSEEN, Scaled, errors, scaled
from pellicle.fitting.discrepancy import discrepancy
from pellicle.fitting.film.evidence import spectrum_evidence
from pellicle.fitting.film.parameters import parameters
from pellicle.fitting.film.problem import Measured, make, measured, shortest_wavelength, without_scale
from pellicle.fitting.film.systematic_effects import systematic_effects
from pellicle.fitting.linear_system import Effect, Evidence
from pellicle.fitting.marginal import marginal
from pellicle.fitting.planned_measurement import (
    PSI_DELTA,
    ExpectedError,
    MeasurementPlan,
    PlannedMeasurement,
    R,
    T,
)
from pellicle.fitting.problem import Problem
from pellicle.fitting.progress import Progress, quiet
from pellicle.fitting.result import Fit
from pellicle.materials import ROUNDING, common_range
from pellicle.scene.film import POLARISATIONS, Light, Scene, unchecked
from pellicle.scene.free import Free, check_free_count, free_leaves, insert
from pellicle.scene.priors import Normal
from pellicle.signals import sphere
from pellicle.simulation.spectra import default_wavelengths

log = getLogger(__name__)

ANGLES = {R: (0.0, 30.0, 45.0, 60.0, 75.0), T: (0.0, 60.0), PSI_DELTA: (55.0, 60.0, 65.0, 70.0, 75.0, 80.0)}
"""Angles of incidence (degrees) that are tried by default, by signal."""
NOISE = {R: 0.002, T: 0.002, PSI_DELTA: 0.03}
"""Usual noise of a point: of a spectrometer, and in degrees of an ellipsometer."""
_WIDEST = (240.0, 1700.0)
"""Wavelengths (nm) of instruments with two lamps and two detectors."""
_MUCH = 1.2
"""Least ratio of a wider range to the given one that is tried."""
_POINTS = 128
"""Most wavelengths that are simulated; they count as much as all of a measurement."""
_DARK = 0.01
"""Median transmittance below which a sample is opaque."""
_STARTS = (0.0, -1.0, -0.5, 0.5, 1.0)
"""Starts of a refit in thickness, in quarters of the shortest wavelength in the layer."""
_STEPS, _SETTLED = 8, 0.05
"""Most Gauss-Newton steps of a refit, and the gain of ln Z that ends them."""
_SHARE, _FRINGE = 0.1, 1 / 8
"""Largest step of a free number by its range, and of a thickness by the shortest wavelength in a layer."""
_REACH = 3.0
"""Errors that `marginal` is given by which it lets parameters move."""
_TWICE = 2.0
"""Factor on the thickness of another sample."""


def plan_measurement(
    scenes: Scene | Fit | Sequence[Scene | Fit] | Mapping[str, Scene | Fit],
    wavelength: Any = None,
    signals: Sequence[str] | None = None,
    angles: Sequence[float] | None = None,
    polarisations: Sequence[str] | None = None,
    noise: float | None = None,
    noise_degrees: float | None = None,
    progress: Progress = quiet,
) -> MeasurementPlan:
    """Rank measurements of the `scenes` as `pellicle.plan_measurement` does."""
    if not isinstance(scenes, Mapping):
        listed = scenes if isinstance(scenes, Sequence) else [scenes]
        scenes = {f"scene {i}": scene for i, scene in enumerate(listed, start=1)}
    rivals = {name: _scene(own) for name, own in scenes.items()}
    for scene in rivals.values():
        check_free_count(len(free_leaves(scene)))
    given = {R: noise, T: noise, PSI_DELTA: noise_degrees}
    levels = {signal: NOISE[signal] if x is None else x for signal, x in given.items()}
    nm = _wavelengths(scenes, rivals) if wavelength is None else np.asarray(wavelength, float)
    may = _Possible(signals or tuple(ANGLES), angles, polarisations or POLARISATIONS, levels)
    not_tried: list[str] = []
    result, every = [], [*_candidates(rivals, nm, may, not_tried)]
    if not every:
        raise UsageError(f"nothing is left to measure: {'; '.join(not_tried)}")
    with jax.enable_x64(True):
        for done, (planned, grid) in enumerate(every):
            progress("measurements", done, len(every))
            own = {name: _thicker(scene, planned.times) for name, scene in rivals.items()}
            about = planned, grid, planned.noise * math.sqrt(len(grid) / len(nm))
            if len(own) == 1:
                [only] = own.values()
                result.append(replace(planned, errors=_expected_errors(only, *about)))
            elif (worst := _expected_evidence(own, *about)) is None:
                not_tried.append(f"{planned.name}: no light passes")
            else:
                result.append(replace(planned, delta_ln_z=worst[0], between=worst[1]))
            log.info("measurement %s: %s", planned.name, result[-1].delta_ln_z or result[-1].errors)
    result.sort(key=lambda m: -(m.delta_ln_z or 0.0))
    return MeasurementPlan(tuple(rivals), tuple(result), tuple(not_tried))


def _scene(own: Scene | Fit) -> Scene:
    """The scene of a fit, whose numbers start at their values and have their errors as priors."""
    if isinstance(own, Scene):
        return own
    scene = (
        own.scene[0] if isinstance(own, Fit) and isinstance(own.scene, tuple) else getattr(own, "scene", 0)
    )
    if not isinstance(own, Fit) or not isinstance(scene, Scene) or scene.sample is not None:
        raise UsageError("measurements are planned for films: give scenes, or fits of one sample's spectra")
    free = []
    for parameter, (_, x) in zip(parameters(scene), free_leaves(scene), strict=True):
        value, stderr = x.start, math.inf
        if (estimate := own.parameters.get(parameter.name)) is not None:
            value, stderr = estimate.value, estimate.stderr
        prior = Normal(value, stderr) if 0 < stderr < math.inf else x.prior
        free.append(Free(min(x.lower, value), max(x.upper, value), start=value, prior=prior))
    return insert(scene, free)


def _thicker(scene: Scene, times: float) -> Scene:
    """Another sample, whose thickest free layer is `times` as thick, of whose thickness nothing is known."""
    if times == 1.0:
        return scene
    every = list(zip(parameters(scene), (x for _, x in free_leaves(scene)), strict=True))
    thickest = max((p for p, _ in every if p.key == "thickness"), key=lambda p: p.start)
    return insert(
        scene,
        [
            Free(times * x.lower, times * x.upper, start=times * x.start) if p is thickest else x
            for p, x in every
        ],
    )


def _wavelengths(scenes: Mapping[str, Scene | Fit], rivals: Mapping[str, Scene]) -> np.ndarray:
    """Wavelengths (nm) of the first spectrum that was fitted, or those of `pl.simulate` for all scenes."""
    for own in scenes.values():
        for part in own.parts if isinstance(own, Fit) else ():
            if isinstance(part.data, Spectrum):
                return np.unique(part.data.wavelength)
    every = [set(default_wavelengths(scene)) for scene in rivals.values()]
    if not (nm := set.intersection(*every)):
        raise UsageError("the media share no wavelengths in 380 to 780 nm: give `wavelength`")
    return np.array(sorted(nm))


class _Possible(NamedTuple):
    """Signals, angles (None for usual ones) and polarisations that can be measured, and the noise of each
    signal."""

    signals: Sequence[str]
    angles: Sequence[float] | None
    polarisations: Sequence[str]
    noise: Mapping[str, float]


def _candidates(
    rivals: Mapping[str, Scene], nm: np.ndarray, may: _Possible, not_tried: list[str]
) -> Iterator[tuple[PlannedMeasurement, np.ndarray]]:
    """Measurements to try, each with its wavelengths; reasons for others are added to `not_tried`."""
    scenes = list(rivals.values())
    for name, given, allowed in (
        ("signals", may.signals, ANGLES),
        ("polarisations", may.polarisations, POLARISATIONS),
    ):
        if unknown := [word for word in given if word not in allowed]:
            raise UsageError(f"`{name}` must be among {', '.join(allowed)}, not {unknown[0]!r}")
    low, high = common_range(scenes)
    nm = nm[(nm >= low - ROUNDING) & (nm <= high + ROUNDING)]
    if len(nm) < 2:
        raise UsageError("the media of all scenes share none of these wavelengths: give others")
    wide = max(low, min(_WIDEST[0], nm.min())), min(high, max(_WIDEST[1], nm.max()))
    near, far = _grid(nm, nm.min(), nm.max()), _grid(nm, *wide)
    wider = wide[1] / wide[0] >= _MUCH * nm.max() / nm.min()
    free = [any(p.key == "thickness" for p in parameters(scene)) for scene in scenes]
    thick = len(free) > 1 and all(free)
    for signal in may.signals:
        if signal == T and any(scene.substrate.back is None for scene in scenes):
            not_tried.append('T: the substrate has no back face: give it one, as in `back="air"`')
            continue
        usual = ANGLES[signal] if may.angles is None else may.angles
        if signal == PSI_DELTA and not (usual := [angle for angle in usual if angle]):
            not_tried.append("ψ and Δ at 0°: s and p are equal at normal incidence: name an oblique angle")
        every = [
            PlannedMeasurement(signal, float(angle), polarised, near[0], near[-1], may.noise[signal])
            for angle in usual
            for polarised in (may.polarisations if signal == R and angle else POLARISATIONS[:1])
        ]
        yield from ((one, near) for one in every)
        if wider:  # at each angle: which one is best depends on the range
            plain = [one for one in every if one.polarisation == every[0].polarisation]
            yield from ((replace(one, lower=far[0], upper=far[-1], wider=True), far) for one in plain)
        one = every[len(every) // 2 if signal == PSI_DELTA else 0] if every else None
        if one and thick:
            yield replace(one, times=_TWICE), near


def _grid(nm: np.ndarray, lower: float, upper: float) -> np.ndarray:
    """Wavelengths that stand for as many as there are in `nm`."""
    return np.linspace(lower, upper, min(len(nm), _POINTS))


def _spectrum(planned: PlannedMeasurement, nm: np.ndarray, noise: float, columns: Any = None) -> Spectrum:
    """A spectrum of the columns of the signal, (points, columns); of any values without them."""
    sigma, angle = np.full(nm.shape, noise), np.full(nm.shape, planned.angle)
    if planned.signal != PSI_DELTA:
        values = np.full(nm.shape, 0.5) if columns is None else columns[:, 0]
        about = {"sigma": sigma, "polarisation": planned.polarisation, "angle": angle}
        return Spectrum(nm, values, planned.signal, **about)
    psi, delta = (np.full(nm.shape, x) for x in (45.0, 90.0))
    if columns is not None:
        psi, delta = sphere.psi_delta(columns[:, :3])
    return Spectrum(
        nm,
        psi,
        PSI_DELTA,
        sigma=sigma,
        delta=np.mod(delta, 360.0),
        delta_sigma=sigma,
        angle=angle,
        folded=False,
    )


@dataclass(frozen=True, order=True)
class _Place:
    """ln Z at a point of the unit cube, and the step from there to where it should be larger."""

    log_evidence: float
    unit: np.ndarray = field(compare=False)
    step: np.ndarray = field(compare=False)


class _Refit(NamedTuple):
    """A scene as a problem of one spectrum."""

    problem: Problem
    target: Measured

    @property
    def start(self) -> np.ndarray:
        """The values of the scene in the unit cube."""
        box, start = self.problem.box, np.array([p.start for p in self.problem.parameters])
        return (start - box.lower) / (np.asarray(box.upper) - box.lower)

    @property
    def reach(self) -> np.ndarray:
        """Largest steps (parameters,), in their own units, for which the model is linear enough."""
        box, step = self.problem.box, _FRINGE * shortest_wavelength(self.problem)
        steps = _SHARE * (np.asarray(box.upper) - box.lower)
        thick = np.array([p.key == "thickness" for p in self.problem.parameters])
        return np.where(thick, np.minimum(steps, step), steps)

    def columns(self) -> np.ndarray:
        """Columns of the simulated signal, (points, columns), without scale and offset."""
        [view] = self.problem.views
        return view.in_columns(view.local(self.problem.values(self.start)).signal)

    def evidence(self, unit: np.ndarray) -> tuple[Evidence, Scaled]:
        """Residuals at a point and what may explain them, and the Jacobian."""
        [view] = self.problem.views
        values = np.asarray(self.problem.values(unit))
        at = view.local(values)
        slopes = scaled(self.problem, unit, [at], [np.float64(1.0)])
        [block] = slopes.blocks([view.points], [np.float64(1.0)])
        effects = systematic_effects(view, values, at, self.target.scene, values)
        return spectrum_evidence(view, at, block, effects), slopes

    def marginal(self, unit: np.ndarray, counts: Callable[[Effect], bool]) -> _Place:
        """ln Z at a point with the effects that count, and the step to where their linear model is best."""
        [view] = self.problem.views
        weight = np.asarray(view.data.weight)[: view.points].reshape(view.rows, view.channels)
        own, slopes = self.evidence(unit)
        own = own._replace(effects=[*filter(counts, own.effects)])
        about = [own], slopes, unit, [weight[:, : view.measured_channels]]
        moves = np.zeros(len(slopes.names))
        here = float(marginal(*about, moves).log_evidence)
        moves[: len(unit)] = self.reach / _REACH
        return _Place(here, unit, np.asarray(marginal(*about, moves).step))

    def log_evidence(self, counts: Callable[[Effect], bool]) -> float:
        """ln Z at the best parameters within half a fringe of those of the scene, with the effects that
        count."""
        starts = np.tile(self.start, (len(_STARTS), 1))
        if (depth := self.problem.thickness_axis) is not None:
            span = np.asarray(self.problem.box.upper)[depth] - self.problem.box.lower[depth]
            starts[:, depth] += np.multiply(_STARTS, 2 * self.reach[depth] / span)
        best = max(self.marginal(start, counts) for start in np.clip(starts, 0.0, 1.0))
        step = best.step
        for _ in range(_STEPS):
            place = self.marginal(np.clip(best.unit + step, 0.0, 1.0), counts)
            gained = place.log_evidence - best.log_evidence
            # from where it is worse, the model is not linear as far as that
            best, step = (place, place.step) if gained > 0 else (best, step / 4)
            if abs(gained) < _SETTLED:
                break
        return best.log_evidence


def _refit(scene: Scene, spectrum: Spectrum) -> _Refit:
    """A scene that explains a spectrum, in whose light it is seen."""
    light = Light(None, 0.0, spectrum.signal, spectrum.polarisation)
    scene = without_scale(unchecked(scene, light=light, reference=None), spectrum)
    target = measured(spectrum, scene)
    return _Refit(make(target), target)


def _expected_evidence(
    rivals: Mapping[str, Scene], planned: PlannedMeasurement, nm: np.ndarray, noise: float
) -> tuple[float, tuple[str, str]] | None:
    """The least Δ ln Z between two scenes, either of them true, and their names; None if no light passes."""
    light = partial(_spectrum, planned, nm, noise)
    signals = {name: _refit(scene, light()).columns() for name, scene in rivals.items()}
    if planned.signal == T and max(float(np.median(x)) for x in signals.values()) < _DARK:
        return None
    expected = {}
    for true, other in permutations(rivals, 2):
        spectrum = light(signals[true])
        pair = [_refit(rivals[name], spectrum) for name in (true, other)]
        both = shared_effects([own.evidence(own.start)[0].effects for own in pair])
        right, wrong = (own.log_evidence(both) for own in pair)
        expected[true, other] = max(right - wrong, 0.0)
    pair = min(expected, key=lambda names: expected[names])
    return expected[pair], pair


def _expected_errors(
    scene: Scene, planned: PlannedMeasurement, nm: np.ndarray, noise: float
) -> dict[str, ExpectedError]:
    """Errors of the free numbers of a scene, infinite where the data say no more than the bounds."""
    signal = _refit(scene, _spectrum(planned, nm, noise)).columns()
    own = _refit(scene, _spectrum(planned, nm, noise, signal))
    evidence, slopes = own.evidence(own.start)
    total, by_noise = discrepancy([evidence], slopes, own.start).total, errors(slopes).stderr
    result = {}
    for p, with_effects, alone in zip(own.problem.parameters, total, by_noise, strict=False):
        most = UNSEEN * (p.upper - p.lower)
        both = (float(x) if x < most else math.inf for x in (with_effects, alone))
        result[p.name] = ExpectedError(*both, unit=p.unit)
    return result
