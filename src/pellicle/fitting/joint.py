"""Joint fits of a film: its spectra and colours, and BRDF samples of a surface that has the same film.

Both kinds of data are fitted apart first. The numbers that bear one name in the scene and in the surface
(`thickness`, `n`) are then one parameter, and all data are fitted together from every pair of minima.
"""

import time
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import product
from typing import Any, NamedTuple

import jax
import numpy as np

from pellicle.data.brdf_samples import BrdfSamples
from pellicle.data.colours import Colours
from pellicle.data.measurement import Datum
from pellicle.data.spectrum import Spectrum
from pellicle.errors import UsageError
from pellicle.fitting.assembly import assemble
from pellicle.fitting.brdf import fit as of_samples
from pellicle.fitting.brdf.summary import BrdfMeasurements
from pellicle.fitting.budget import budget
from pellicle.fitting.coordinates import Box, Coordinates
from pellicle.fitting.covariance import Scaled
from pellicle.fitting.discrepancy import Discrepancy
from pellicle.fitting.film import fit as of_film
from pellicle.fitting.film.problem import Target
from pellicle.fitting.film.summary import FilmMeasurements
from pellicle.fitting.linear_system import Evidence
from pellicle.fitting.minima import minima
from pellicle.fitting.parameter import Parameter
from pellicle.fitting.problem import Problem
from pellicle.fitting.profile_likelihood import Limits
from pellicle.fitting.progress import Progress
from pellicle.fitting.result import Estimate, Fit, Part
from pellicle.fitting.reweighting import RankedMinima, rank
from pellicle.fitting.robust_losses import LEAST_SQUARES
from pellicle.fitting.status import verdict
from pellicle.fitting.tied_numbers import TiedNumber
from pellicle.scene.film import Scene
from pellicle.scene.surface import Surface

_MOST_FILMS, _MOST_SURFACES = 8, 6
"""Minima of each kind of data that are combined."""


def of_both_kinds(scene: Any) -> bool:
    """True for a list with a Scene and a Surface in it."""
    kinds = {type(each) for each in scene} if isinstance(scene, list | tuple) else set()
    return {Scene, Surface} <= kinds


class Apart(NamedTuple):
    """The data of a joint fit by kind, in their order: those of the film with their scenes, and BRDF samples
    with their surface."""

    films: list[Spectrum | Colours]
    scenes: list[Scene]
    samples: list[BrdfSamples]
    surface: Surface


def apart(data: Sequence[Datum], scene: Sequence[Scene | Surface]) -> Apart:
    """Sort data and scenes by kind. Raises UsageError where they do not match or share no number."""
    rows = list(zip(data, scene, strict=True)) if len(data) == len(scene) else []
    films = [(d, s) for d, s in rows if isinstance(d, Spectrum | Colours) and isinstance(s, Scene)]
    samples = [(d, s) for d, s in rows if isinstance(d, BrdfSamples) and isinstance(s, Surface)]
    if not rows or len(films) + len(samples) < len(rows):
        raise UsageError(
            "a joint fit of BRDF samples and of spectra or colours needs a list of as many scenes: a Surface"
            " for samples, a Scene for the others"
        )
    surfaces = [s for _, s in samples]
    if any(s is not surfaces[0] for s in surfaces):
        raise UsageError("the BRDF samples of a joint fit need one Surface, the same for all")
    return Apart([d for d, _ in films], [s for _, s in films], [d for d, _ in samples], surfaces[0])


def fitted(
    data: Sequence[Datum],
    scene: Sequence[Scene | Surface],
    tolerance: float,
    progress: Progress,
    loss: str = LEAST_SQUARES,
    residual: str | None = None,
) -> tuple[Fit, RankedMinima]:
    """Fit spectra or colours and BRDF samples of one film; the arguments are those of `pellicle.fit`.

    **Returns:** the fit, and the ranked minima that it rests on.

    **Raises:** as `apart` does, and as fits of each kind do.
    """
    began, own = time.perf_counter(), apart(data, scene)
    film, film_ranked = of_film.fitted(own.films, own.scenes, tolerance, progress, loss)
    brdf, brdf_ranked = of_samples.fitted(own.samples, own.surface, tolerance, progress, loss, residual)
    with jax.enable_x64(True):
        targets = of_film.measurements(own.films, own.scenes)
        problem, starts = _combined(film_ranked, brdf_ranked)
        ranked = rank(problem, minima(problem, starts, progress), loss)
        judged = assemble(partial(together, own, targets), ranked, began)
        worst, conclusion = judged.worst, judged.conclusion
        return judged.fit(
            verdict=verdict(
                conclusion.status, conclusion.parameters, conclusion.rivals, worst.rms, worst.name
            ),
            rms=None,
            warnings=tuple(dict.fromkeys([*_apart_warning(film, brdf), *film.warnings, *brdf.warnings])),
            scene=(*own.scenes, own.surface),
            budget=budget(judged.best.discrepancy, problem.parameters),
        ), judged.best.ranked


class _Merged(NamedTuple):
    """Parameters of both problems: those of the film, within the bounds of both where they share a name, then
    the `rest` of the surface's. `shared` are positions of shared ones, by that in the surface's problem."""

    parameters: tuple[Parameter, ...]
    lower: np.ndarray
    upper: np.ndarray
    shared: dict[int, int]
    rest: list[int]

    def joined(self, film: Any, surface: Any) -> np.ndarray:
        """A number for each parameter from those of both problems."""
        return np.concatenate([film, np.asarray(surface)[self.rest]])

    @property
    def positions(self) -> dict[int, int]:
        """Positions of the surface's parameters among all."""
        first = len(self.parameters) - len(self.rest)
        return self.shared | {j: first + at for at, j in enumerate(self.rest)}


def _merged(film: Problem, surface: Problem) -> _Merged:
    """Raises UsageError where they share no free thickness, or bounds do not overlap."""
    named = {p.name: i for i, p in enumerate(film.parameters)}
    shared = {j: named[p.name] for j, p in enumerate(surface.parameters) if p.name in named}
    if not any(film.parameters[i].key == "thickness" for i in shared.values()):
        raise UsageError(
            "the scene and the surface share no free thickness: free both under one name, as in"
            " pl.Layer(material, pl.Free(10, 1000)) and {'thickness': pl.Free(10, 1000)}"
        )
    parameters, lower, upper = list(film.parameters), np.array(film.box.lower), np.array(film.box.upper)
    for j, i in shared.items():
        p, q = parameters[i], surface.parameters[j]
        lower[i], upper[i] = max(p.lower, q.lower), min(p.upper, q.upper)
        if not lower[i] < upper[i]:
            raise UsageError(f"the bounds of {p.name} in the scene and in the surface do not overlap")
        parameters[i] = replace(p, lower=float(lower[i]), upper=float(upper[i]))
    rest = [j for j in range(len(surface.parameters)) if j not in shared]
    every = (*parameters, *(surface.parameters[j] for j in rest))
    return _Merged(every, lower, upper, shared, rest)


def _combined(film: RankedMinima, brdf: RankedMinima) -> tuple[Problem, np.ndarray]:
    """The problem of all data, and starts (starts, parameters) from pairs of minima."""
    first, second = film.searched, brdf.searched
    merged = _merged(first, second)
    bounds, reach = first.box._replace(lower=merged.lower, upper=merged.upper), second.box.reach
    box = Box(*[merged.joined(x, y) for x, y in zip(bounds[:5], second.box[:5], strict=True)], reach=reach)
    where, log, tilt = merged.positions, second.coordinates.log, second.coordinates.tilt
    coordinates = Coordinates(
        tuple(merged.joined(np.zeros(len(merged.lower), bool), log).tolist()) if log else (),
        None if tilt is None else (where[tilt[0]], where[tilt[1]]),
        second.coordinates.folded,
    )
    views = [
        replace(view, takes=tuple(where[i] for i in view.takes), name=view.name or f"brdf-{number}")
        for number, view in enumerate(second.views, start=1)
    ]
    # starts from pairs of minima, with the shared numbers of either
    films = np.asarray(first.values(film.minima.units))[:_MOST_FILMS]
    units, starts = brdf.minima.units[:_MOST_SURFACES], []
    for own, (unit, numbers) in product(films, zip(units, np.asarray(second.values(units)), strict=True)):
        of_surface = own.copy()
        of_surface[[*merged.shared.values()]] = numbers[[*merged.shared]]
        for values in (own, of_surface):
            inside = np.clip((values - merged.lower) / (merged.upper - merged.lower), 0.0, 1.0)
            starts.append(merged.joined(inside, unit))
    return Problem((*first.views, *views), merged.parameters, box, coordinates), np.array(starts)


class JointMeasurements(NamedTuple):
    """Films and samples of one fit, of whose views the films' are the first."""

    films: FilmMeasurements
    samples: BrdfMeasurements
    ranked: RankedMinima

    def evidence(self, at: RankedMinima, jacobian: Scaled) -> list[Evidence]:
        """Residuals of all views and what may explain them `at` a minimum."""
        films, samples = _split(at, len(self.films.targets))
        before = sum(view.points for view in films.problem.views)
        below = jacobian._replace(jacobian=jacobian.jacobian[before:])
        return [*self.films.evidence(films, jacobian), *self.samples.evidence(samples, below)]

    def parts(self, discrepancy: Discrepancy) -> tuple[Part, ...]:
        """The parts of the films, then those of the samples."""
        return (*self.films.parts(discrepancy), *self.samples.parts(discrepancy))

    def missed(self, parts: tuple[Part, ...], discrepancy: Discrepancy) -> list[Part]:
        """The parts that are not explained."""
        count = len(self.films.targets)
        each = discrepancy.remaining
        films, samples = (replace(discrepancy, remaining=own) for own in (each[:count], each[count:]))
        return [*self.films.missed(parts[:count], films), *self.samples.missed(parts[count:], samples)]

    def fixed(self) -> list[Estimate]:
        """Fixed numbers of the scenes and of the surface."""
        return [*self.films.fixed(), *self.samples.fixed()]

    def tied(self) -> list[TiedNumber]:
        """Numbers of the scenes that follow free ones."""
        return self.films.tied()

    def amended(self, parts: tuple[Part, ...], limits: Limits) -> Limits:
        """Limits by what either kind cannot tell."""
        count = len(self.films.targets)
        return self.samples.amended(parts[count:], self.films.amended(parts[:count], limits))


def _split(ranked: RankedMinima, count: int) -> list[RankedMinima]:
    """Ranked minima with the first `count` views, and with the others."""
    problem = ranked.problem
    return [
        replace(ranked, problem=problem._replace(views=problem.views[own]), fits=ranked.fits[own])
        for own in (slice(count), slice(count, None))
    ]


def together(apart: Apart, targets: list[Target], ranked: RankedMinima) -> JointMeasurements:
    """Both kinds of data with the views of the ranked minima that are theirs; `targets` are the films'."""
    one, other = _split(ranked, len(targets))
    return JointMeasurements(
        FilmMeasurements(apart.films, targets, one),
        BrdfMeasurements(apart.samples, apart.surface, other),
        ranked,
    )


def _apart_warning(film: Fit, brdf: Fit) -> list[str]:
    """A sentence where the two kinds of data, each alone, do not agree on a number that they share."""
    result = []
    for name in [p.name for p in film.free if p.name in {q.name for q in brdf.free}]:
        one, other = film[name], brdf[name]
        if abs(one.value - other.value) > 3 * np.hypot(one.stderr, other.stderr):
            apart_by = [f"{name} {p.value:.5g} ± {p.stderr:.2g} {p.unit}".rstrip() for p in (one, other)]
            result.append("alone the spectra and colours give {}, the BRDF samples {}".format(*apart_by))
    if brdf.layer_test is not None and not brdf.layer_test.layered:
        result.append("the BRDF samples alone are no evidence of a layer")
    return result
