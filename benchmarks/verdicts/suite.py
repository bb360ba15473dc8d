"""The list of cases, and the simulated measurement of each.

Every case has random numbers of its own, seeded by the master seed and its name: adding a case changes no
other, and none is picked by its answer.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from causes import CAUSES
from detectability import SHOWN, bound, evidence, least_evidence, rival
from families import FAMILIES, THIN
from family import Family, Theta
from flaws import HIDDEN, drawn, flaws_of
from measurement import Conditions, View
from undecidable import UNDECIDABLE
from wrong_scenes import WRONG_SCENES, WrongScene

import pellicle as pl

SEED = 14
CLEAN_EACH = 6
"""Clean cases of each family with σ, and as many without."""
DECIDED = 0.01
"""Samples are drawn again until the noise alone leaves less than this relative error of the thickness."""
RIVAL = 2.0
"""Undecidable ones, until a thickness that is a fifth off explains the data within this sum of squares."""


@dataclass(frozen=True)
class Case:
    """One measurement to be made: its group, family, kind of flaw, and whether σ is given."""

    group: str
    kind: str
    family: Family
    sigma_given: bool
    number: int = 0
    wrong: WrongScene | None = None

    @property
    def name(self) -> str:
        """Name that no other case has."""
        number = f" {self.number}" if self.number else ""
        return f"{self.family.name} | {self.kind}{number} | {'sigma' if self.sigma_given else 'no sigma'}"


class Measured(NamedTuple):
    """A simulated measurement: data, truth, and what its noise and its flaw would show to anyone."""

    case: Case
    group: str
    data: pl.Spectrum
    truth: float
    bound: float
    evidence: float
    detail: str


def cases() -> list[Case]:
    """All cases in a fixed order."""
    both = (True, False)
    clean = [
        Case("clean", "clean", family, given, number)
        for family in FAMILIES.values()
        for given in both
        for number in range(1, CLEAN_EACH + 1)
    ]
    flawed = [
        Case("flawed", flaw, family, given)
        for family in FAMILIES.values()
        for flaw in flaws_of(family)
        for given in both
    ]
    wrong = [Case("wrong", w.name, w.family, given, wrong=w) for w in WRONG_SCENES for given in both]
    undecidable = [Case("undecidable", "undecidable", f, given) for f in UNDECIDABLE for given in both]
    thin = [Case("clean", "clean", family, given) for family in THIN for given in both]
    hidden = [
        Case("hidden", flaw, family, given, number)
        for family in THIN
        for flaw in HIDDEN
        for given in both
        for number in (1, 2)
    ]
    caused = [Case("cause", w.name, w.family, given, wrong=w) for w in CAUSES for given in both]
    return [*clean, *flawed, *wrong, *undecidable, *thin, *hidden, *caused]


def short(chosen: list[Case]) -> list[Case]:
    """A short run: of each group every family in turn, with the next of its kinds and σ by turns."""
    kept: list[Case] = []
    for group, most in (("clean", 4), ("flawed", 12), ("wrong", 5), ("undecidable", 3)):
        by_family: dict[str, list[Case]] = {}
        for case in chosen:
            if case.group == group:
                by_family.setdefault(case.family.name, []).append(case)
        lists = list(by_family.values())
        kept += [
            lists[i % len(lists)][(3 * i) % len(lists[i % len(lists)])] for i in range(min(most, len(chosen)))
        ]
    return list({case.name: case for case in kept}.values())


def generator(case: Case, seed: int) -> np.random.Generator:
    """Random numbers of one case."""
    return np.random.default_rng([seed, zlib.crc32(case.name.encode())])


def measured(case: Case, seed: int = SEED) -> Measured:
    """Simulate the measurement of a case."""
    random = generator(case, seed)
    if case.wrong is not None:
        return _wrong(case, case.wrong, random)
    family, noise = case.family, _noise(case.family, random)
    lamp = family.lamp(random)
    for _ in range(1000):
        theta = tuple(float(x) for x in family.draw(random))
        clean = family.recorded(family.stack(theta), family.window(theta), Conditions(), family.view, lamp)
        sigma = standard_deviations(clean, noise, family.view)
        known = bound(family, theta, clean, sigma)
        if case.group == "undecidable":
            right = rival(family, theta, clean, sigma) < RIVAL
        else:
            right = known < DECIDED * theta[0]
        if right:
            break
    else:
        raise RuntimeError(f"{family.name}: no draw is {case.group}")
    if case.group not in ("flawed", "hidden"):
        data = _spectrum(case, family.view, clean, sigma, random)
        return Measured(case, case.group, data, theta[0], known, 0.0, _numbers(theta, noise))
    conditions = drawn(case.kind, random, family, theta)
    values = family.recorded(family.stack(theta), family.window(theta), conditions, family.view, lamp)
    sigma = standard_deviations(values, noise, family.view)
    shown = evidence(family, theta, _with_spikes(values, sigma, conditions), sigma)
    data = _spectrum(case, family.view, values, sigma, random, conditions)
    group = "hidden" if case.group == "hidden" else "flawed" if shown > SHOWN else "budget-only"
    return Measured(case, group, data, theta[0], known, shown, f"{conditions}; {_numbers(theta, noise)}")


def _wrong(case: Case, wrong: WrongScene, random: np.random.Generator) -> Measured:
    """A wrong scene; one that explains its data as well as the right one is a matter of the budget."""
    family, noise = case.family, _noise(case.family, random)
    stack, view, conditions = wrong.draw(random, family)
    usual = family.draw(random)
    lamp = family.lamp(random)
    values = family.recorded(stack, family.window(usual), conditions, view, lamp)
    sigma = standard_deviations(values, noise, family.view)
    shown = least_evidence(family, values, sigma, usual)
    data = _spectrum(case, family.view, values, sigma, random)
    group = case.group if shown > SHOWN else "budget-only"
    detail = f"{conditions}; thickness {stack.thickness:.4g}, noise {noise:.2g}".removeprefix("; ")
    return Measured(case, group, data, stack.thickness, np.nan, shown, detail)


def _noise(family: Family, random: np.random.Generator) -> float:
    low, high = np.log(family.noise)
    return float(np.exp(random.uniform(low, high)))


def _numbers(theta: Theta, noise: float) -> str:
    return f"truth {' '.join(f'{x:.5g}' for x in theta)}, noise {noise:.2g}"


def standard_deviations(values: np.ndarray, noise: float, view: View) -> np.ndarray:
    """σ of each value: constant in R and T; of Ψ and Δ in degrees from one noise of N, C and S."""
    if view.signal != "psi-delta":
        return np.full(values.shape, noise)
    psi = np.full(view.wavelength.shape, np.rad2deg(noise / 2))
    across = np.maximum(np.abs(np.sin(2 * np.deg2rad(values[0]))), 0.02)
    return np.stack([psi, np.rad2deg(noise) / across])


def _with_spikes(values: np.ndarray, sigma: np.ndarray, conditions: Conditions) -> np.ndarray:
    spiked = values.copy()
    for row, height in conditions.spikes:
        spiked[..., row] += height * sigma[..., row]
    return spiked


def _spectrum(
    case: Case,
    view: View,
    values: np.ndarray,
    sigma: np.ndarray,
    random: np.random.Generator,
    conditions: Conditions | None = None,
) -> pl.Spectrum:
    """The spectrum as a file would give it: with noise, and with its σ or without."""
    noisy = values + sigma * random.standard_normal(values.shape)
    noisy = _with_spikes(noisy, sigma, conditions or Conditions())
    given = sigma if case.sigma_given else None
    if view.signal == "psi-delta":
        psi, delta = np.clip(noisy[0], 0, 90), np.mod(noisy[1], 360)
        both = (None, None) if given is None else given
        return pl.Spectrum(
            view.wavelength,
            psi,
            "psi-delta",
            sigma=both[0],
            delta=delta,
            delta_sigma=both[1],
            angle=view.angle,
        )
    return pl.Spectrum(
        view.wavelength,
        noisy,
        view.signal,
        sigma=given,
        polarisation=view.polarisation,
        calibrated=not case.family.counts,
        angle=view.angle,
    )
