"""Identification of the film on a substrate, from spectra of one sample to hypotheses with evidence."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from pellicle.data.spectrum import Spectrum, within
from pellicle.fitting.film.other_readings import conventions
from pellicle.identification import conclusion, words
from pellicle.identification.evidence import Weighed, weigh
from pellicle.identification.growth import Growth, grow, needed
from pellicle.identification.hypothesis import EFFECTS, ROUGH, Identification, NotTried, Outcome
from pellicle.identification.problem import Problem
from pellicle.identification.request import FEWEST, Request, check, problem_of
from pellicle.identification.search import polished
from pellicle.identification.signal_view import SignalView
from pellicle.identification.structure import OXIDE
from pellicle.materials import Material
from pellicle.scene.common_range import covered
from pellicle.scene.layers import medium

_MOST_TABLES = 0.7
"""Share of the tables that cover a part of the data which is compared alone: films of a spectrometer's whole
range, from 190 nm, are those of 15 of 35 materials."""
_SHAPE = "the index of the film has a shape that no model has"
_UNUSUAL = "structures that need unusual errors are excluded"
_PARTLY = "a film that could not be tried on all data describes them as well"
GLASSES = ("BK7", "fused silica", "SF10/HOYA")
_GLASSY, _ANOTHER = 1.9, 0.02
"""Index below which a substrate may be another glass, and relative difference of the index of another."""
_ANGLES = (
    "Spectra without an angle of incidence were compared at one: if they are of several, state each, as"
    " `angle` of its spectrum or in the order of the files, as in --angle 8,60."
)
_FOLDED = "The sign of Δ seems not to have been measured: Δ was taken as folded into 0 to 180°."
_SCREEN, _MISTAKES = 1.5, 2
"""Ratio of χ² of the best film of the catalogue with a mistake to that as stated, up to which it is tried,
and number of mistakes that are. Of 12 mistakes that explained data 11 had less than 0.25 and one 1.2, as a
scan is coarse; each was the least of those that were possible."""
_FAVOURED = 1.0
"""Δ ln Z from which a glass that was not stated is favoured, if it has another film."""


def identified(spectra: Sequence[Spectrum], request: Request, began: float) -> Identification:
    """Identify the film of spectra of one sample.

    **Raises:** UsageError for a signal that cannot be identified; DataError for too few points, or a
    substrate without data at the wavelengths.
    """
    for spectrum in spectra:
        check(spectrum, request)
    spectra = [covered(spectrum, request.around()) for spectrum in spectra]
    deadline = time.monotonic() + request.budget
    found = _identified(spectra, request, began, deadline)
    if found.status is Outcome.NONE and len(spectra) > 1 and any(x.angle is None for x in spectra):
        found = replace(found, verdict=f"{found.verdict} {_ANGLES}")
    if any(x.folded for x in found.data) and not any(x.folded for x in spectra):
        found = replace(found, verdict=f"{found.verdict} {_FOLDED}")
    if time.monotonic() < deadline:
        return found
    ended = f"The budget of {request.budget:g} s ended before all was tried."
    rest = NotTried("further structures", f"the budget of {request.budget:g} s had ended")
    return replace(found, verdict=f"{found.verdict} {ended}", not_tried=(*found.not_tried, rest))


def _identified(
    spectra: Sequence[Spectrum], request: Request, began: float, deadline: float
) -> Identification:
    growth, left_out = _start(spectra, request, deadline)
    grow(growth, request.layers)
    kept = conclusion.survivors(growth.weighed)
    folded = _folded(spectra)
    if not kept and folded is not None:
        again, _ = _start(folded, request, deadline)
        if again.least < _SCREEN * growth.least:
            kept = conclusion.survivors(grow(again, request.layers).weighed)
            growth = again if kept else growth
    if kept:
        doubt = conclusion.doubt(growth.problem, kept)
        better = _better_face(growth.problem, kept[0], spectra, request)
        if not doubt and not better:
            better = _better_glass(growth, kept, spectra, request)
        why = "another sample describes the data better"
        if not doubt and not better:
            better, why = _partly_known(kept[0], left_out, spectra, request), _PARTLY
        doubt = doubt or (why if better else "")
        found = _record(growth, kept, doubt, "", left_out, request, began)
        return replace(found, verdict=f"{found.verdict} {better}") if better else found
    for condition, own, again, rest in _likely_mistakes(spectra, request, growth):
        grow(again, 1)
        found = [x for x in conclusion.survivors(again.weighed) if x.remaining < conclusion.NOISY]
        if found:
            return _record(again, found, condition, condition, rest, own, began)
    kept, condition = conclusion.shapeless(growth.weighed), _SHAPE
    if not kept:
        kept, condition = conclusion.plausible(growth.weighed), _UNUSUAL
    condition = condition if kept else ""
    return _record(growth, kept, condition, condition, left_out, request, began)


def _likely_mistakes(
    spectra: Sequence[Spectrum], request: Request, growth: Growth
) -> list[tuple[str, Request, Growth, list[NotTried]]]:
    """Usual mistakes with which a film of the catalogue is nearest by a scan, the nearest first: each in
    words, with request, growth to start from, and materials that do not cover the data."""
    found = []
    for condition, other in _conditions(spectra, request, growth):
        if time.monotonic() > growth.deadline:
            break
        found.append((condition, other[1], *_start(*other, growth.deadline)))
    found = [x for x in found if x[2].least < _SCREEN * growth.least]
    return sorted(found, key=lambda x: x[2].least)[:_MISTAKES]


def _start(spectra: Sequence[Spectrum], request: Request, deadline: float) -> tuple[Growth, list[NotTried]]:
    problem, left_out = problem_of(spectra, request)
    tried = [name for name in request.names if name in problem.views[0].tables]
    return Growth(problem, tried, deadline), left_out


def _folded(spectra: Sequence[Spectrum]) -> list[Spectrum] | None:
    """Spectra with a folded Δ where the sign of Δ may not have been measured; None where it was."""
    half = [x.delta is not None and not x.folded and bool(np.all(x.delta <= 180)) for x in spectra]
    if not any(half):
        return None
    return [replace(x, folded=True) if own else x for x, own in zip(spectra, half, strict=True)]


def _record(
    growth: Growth, kept: list, doubt: str, condition: str, left_out: list[NotTried], request: Request,
    began: float,
) -> Identification:  # fmt: skip
    problem = growth.problem
    status = Outcome.NONE if not kept else Outcome.UNDECIDED if doubt else Outcome.IDENTIFIED
    rest = [x for x in growth.weighed if not any(x is y for y in kept)]
    hypotheses = conclusion.hypotheses(growth, kept, condition)
    alike = []
    if kept and not doubt:
        same = conclusion.one_film(problem, kept)
        alike = [x for x, own in zip(hypotheses, kept, strict=True) if any(own is y for y in same)]
        hypotheses[0] = alike[0] = conclusion.answer(alike)
    excluded = conclusion.hypotheses(growth, rest, condition)
    nearest = next((x for x in growth.weighed if needed(x)), growth.weighed[0])
    noise = problem.short_range_noise(problem.data - nearest.attempt.values)
    channels = np.split(noise, np.cumsum([view.channels for view in problem.views])[:-1])
    substrate = getattr(request.substrate.material, "name", "the substrate")
    return Identification(
        status=status,
        hypotheses=tuple(hypotheses),
        excluded=tuple(replace(x, probability=0.0) for x in excluded),
        not_tried=(*left_out, *_untried(growth, request, condition)),
        verdict=words.verdict(hypotheses, alike, excluded, doubt, nearest, left_out, substrate),
        data=tuple(view.spectrum for view in problem.views),
        noise=tuple(channels),
        seconds=time.perf_counter() - began,
    )


def _untried(growth: Growth, request: Request, condition: str) -> list[NotTried]:
    """Structures and effects that were not tried, and why."""
    tried = [x.structure for x in growth.weighed]
    two = any(len(x.layers) > 1 and x.layers[1].most > OXIDE for x in tried)
    why = "a simpler structure leaves only noise and usual errors"
    usual = "a usual one is among the errors, a thicker one counts as a layer"
    rows = (
        ("graded index", "each film is taken as uniform in depth", True),
        ("contamination on top", usual, True),
        ("birefringence", "each film is taken as isotropic", growth.problem.views[0].channels > 1),
        *(
            (EFFECTS[own], why, all(own not in x.effects for x in tried))
            for own in (ROUGH, "thickness_spread")
        ),
        ("two layers", "one film is allowed" if request.layers < 2 or condition else why, not two),
        ("more than two layers", "two are the most that are tried", two),
    )
    return [NotTried(name, reason) for name, reason, holds in rows if holds]


_Statement = tuple[str, tuple[Sequence[Spectrum], Request]]


def _conditions(spectra: Sequence[Spectrum], request: Request, growth: Growth) -> Iterator[_Statement]:
    """Usual mistakes in what is stated: each in words, with spectra and request without it; and the part of
    the data that most tables cover."""
    if (part := _within_tables(spectra, request)) is not None:
        low, high = (f(x.wavelength) for f, x in ((min, part[0]), (max, part[0])))
        yield f"only {low:.0f} to {high:.0f} nm are compared, which most tables cover", (part, request)
    if "calibration" in request.conditions and all(x.signal == "R" for x in spectra):
        for mirror in (request.substrate.material, medium("Al")):
            relative = [_times_mirror(x, mirror, request) for x in spectra]
            known = [x for x in relative if x is not None]
            if len(known) == len(spectra):
                named = getattr(mirror, "name", "the substrate")
                yield f"the reflectance was measured relative to {named}", (known, request)
    if "calibration" in request.conditions:
        for words, other in conventions(spectra, [np.inf] * len(spectra)):
            of: Any = other
            yield f"the file has another convention of delta ({words} in place of delta)", (of, request)
    if "calibration" in request.conditions and any(view.oblique for view in growth.problem.views):
        off = growth.likely_shift()
        than = "larger" if off > 0 else "smaller"
        turned = _at_another_angle(spectra, request, off)
        yield f"the angle of incidence is {abs(off):g}° {than} than stated", turned
    if (face := _other_face(spectra, request)) is not None:
        yield face[0], (spectra, face[1])
    yield from _other_glasses(spectra, request)


def _other_glasses(spectra: Sequence[Spectrum], request: Request) -> Iterator[_Statement]:
    """Other glasses in place of a glass that is stated: each in words, with spectra and request."""
    view, below = SignalView(spectra[0], request.around()), request.substrate
    stated: Any = view.index_of(below.material)
    glassy = stated.real.max() < _GLASSY and stated.imag.max() < 0.1  # gold has n below 1.7
    for name in GLASSES if "substrate" in request.conditions and glassy else ():
        index = view.index_of(medium(name))
        if np.all(np.isfinite(index)) and abs(index.mean() / stated.mean() - 1) > _ANOTHER:
            other = replace(request, substrate=replace(below, material=medium(name)))
            yield f"the substrate is another glass, as {name}", (spectra, other)


def _within_tables(spectra: Sequence[Spectrum], request: Request) -> list[Spectrum] | None:
    """Spectra at the wavelengths that most tables of materials cover; None where that is all of them, or less
    than half. Oxides measured from 190 nm on silica are found from 320 nm on alone."""
    known = [x.wavelength_range for x in map(medium, request.names) if isinstance(x, Material)]
    if not known:
        return None
    low = float(np.quantile([x for x, _ in known], _MOST_TABLES))
    high = float(np.quantile([x for _, x in known], 1 - _MOST_TABLES))
    part = [within(x, (low, high), "tables of most materials end there") for x in spectra]
    whole = all(len(a) == len(b) for a, b in zip(part, spectra, strict=True))
    return None if whole or min(map(len, part)) < FEWEST else part


def _other_face(spectra: Sequence[Spectrum], request: Request) -> tuple[str, Request] | None:
    """The statement on the back face that is not made, and the request with it; None where there is none."""
    below = request.substrate
    if "plate" not in request.conditions:
        return None
    index: Any = SignalView(spectra[0], request.around()).index_of(below.material)
    if below.back is None and float(np.mean(index.imag)) < 1e-4:
        plate = replace(below, back=medium("air"))
        return "light from the back face was measured too", replace(request, substrate=plate)
    if below.back is not None and all(x.signal != "T" for x in spectra):
        return "no light from the back face was measured", replace(
            request, substrate=replace(below, back=None)
        )
    return None


def _better_face(problem: Problem, best: Weighed, spectra: Sequence[Spectrum], request: Request) -> str:
    """Sentence on the other statement of the back face where the best structure has far more evidence with
    it, else empty: 80 nm of CdS on glass were told as 83 nm where a back face was stated that was not there.
    """
    face = _other_face(spectra, request)
    if face is None:
        return ""
    other, _ = problem_of(spectra, face[1])
    if not all(x.name in other.views[0].tables or x.modelled for x in best.structure.layers):
        return ""
    [stated] = weigh(problem, [best.attempt], {})
    [instead] = weigh(other, [polished(other, best.structure, [best.attempt.x])], {})
    gain = instead.ln_z - stated.ln_z
    if gain < conclusion.DECIDED or not instead.adequate:
        return ""
    depth, error = conclusion.thickest(instead)
    return (
        f"If {face[0]}, the same layers describe the data better (Δ ln Z {gain:.0f}), with a thickness of"
        f" {depth:.4g} ± {error:.2g} nm."
    )


def _better_glass(
    growth: Growth, best: Sequence[Weighed], spectra: Sequence[Spectrum], request: Request
) -> str:
    """Sentence on another glass below which other films have more evidence than those left, else empty.

    Ta2O5 on BK7 was identified as Nb2O5 on SF10 where that was stated, with Δ ln Z 2.4 in favour of BK7.
    """
    for supposed, other in _other_glasses(spectra, request):
        again = grow(_start(*other, growth.deadline)[0], 1)
        kept = conclusion.survivors(again.weighed)
        gain = kept[0].ln_z - best[0].ln_z if kept else -np.inf
        every = (conclusion.hypotheses(*x) for x in ((growth, best), (again, kept)))
        here, there = ({name for x in own for layer in x.layers for name in layer.like} for own in every)
        if gain > _FAVOURED and here.isdisjoint(there):
            depth, error = conclusion.thickest(kept[0])
            return (
                f"If {supposed}, another film describes the data better (Δ ln Z {gain:.1f}):"
                f" {kept[0].structure.name}, {depth:.4g} ± {error:.2g} nm thick."
            )
    return ""


def _partly_known(
    best: Weighed, left_out: Sequence[NotTried], spectra: Sequence[Spectrum], request: Request
) -> str:
    """Sentence on the best of the films whose tables end within the data, if it describes the data as well as
    the best structure where it is known, else empty. Against tables that describe all data it must have more
    evidence by `conclusion.DECIDED`.

    Scandia in T from 190 nm was identified as Si3N4, by a free index: the table of Sc2O3 ends at 230 nm.
    """
    own = [x.name for x in best.structure.layers if not x.modelled]
    least = conclusion.DECIDED * (1 if len(own) == len(best.structure.layers) else -1)
    found = []
    for known in [x for x in (medium(x.material) for x in left_out) if isinstance(x, Material)]:
        low, high = known.wavelength_range
        part = [within(x, (low, high), "a table ends there") for x in spectra]
        problem, missing = problem_of(part, replace(request, names=(known.name, *own)))
        if missing:
            continue
        again = Growth(problem, [known.name])
        again.add([again.film(known.name)], again.ranks[known.name][1][:, None])
        if not any(x.adequate for x in weigh(problem, again.attempts, {})):
            continue
        stated = polished(problem, best.structure, [best.attempt.x])
        weighed = weigh(problem, [stated, *again.attempts], {})
        rival = next(x for x in weighed if x.attempt is not stated)
        gain = rival.ln_z - next(x.ln_z for x in weighed if x.attempt is stated)
        if gain > least and rival.adequate and rival.remaining < conclusion.NOISY:
            depth, error = conclusion.thickest(rival)
            sentence = (
                f"{known.name} was not tried on all data, as its table goes from {low:g} to {high:g} nm."
                f" There it describes them as well (Δ ln Z {gain:.1f}), {depth:.4g} ± {error:.2g} nm thick."
            )
            found.append((gain, sentence))
    return max(found, default=(0.0, ""))[1]


def _at_another_angle(
    spectra: Sequence[Spectrum], request: Request, off: float
) -> tuple[Sequence[Spectrum], Request]:
    """Spectra and request with angles of incidence `off` degrees from those stated."""
    stated = np.asarray(request.light.angle, float)
    light = replace(request.light, angle=np.where(stated > 0, np.clip(stated + off, 0.0, 89.9), 0.0)[()])
    turned = [
        x
        if x.angle is None
        else replace(x, angle=np.where(x.angle > 0, np.clip(x.angle + off, 0.0, 89.9), 0.0))
        for x in spectra
    ]
    return turned, replace(request, light=light)


def _times_mirror(spectrum: Spectrum, mirror: Any, request: Request) -> Spectrum | None:
    """A reflectance times that of a bare mirror at normal incidence; None where it is above 1."""
    index = SignalView(spectrum, request.around()).index_of(mirror)[: len(spectrum)]
    values = spectrum.values * np.abs((1 - index) / (1 + index)) ** 2
    if not np.all(np.isfinite(values)) or values.max() > 1.05:
        return None
    return replace(spectrum, values=values, sigma=None)
