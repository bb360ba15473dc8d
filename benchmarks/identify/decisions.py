"""Measurements that are expected to decide between rivals, simulated by the tmm package and fitted.

A sample is measured at normal incidence, two rivals are fitted to that, and `pl.plan_measurement` ranks what
to measure next. Then these measurements are simulated, with flaws, and both rivals fitted to them: the
prediction is true where the evidence for the true one is strong if that was expected, and not if it was not.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from specimens import Layer, Specimen, View, drawn_flaws, measured

import pellicle as pl

RIVALS = (
    ("Y2O3", "Si3N4", 245.0),
    ("PMMA", "SiO2", 300.0),
    ("alumina", "SU-8", 200.0),
    ("Ta2O5", "HfO2", 150.0),
    ("TiO2", "Nb2O5", 120.0),
    ("polystyrene", "SU-8", 400.0),
    ("HfO2", "Y2O3", 100.0),
    ("ZnS", "TiO2", 90.0),
)
STRONG = 5.0
_NEXT = ("R", "psi-delta")
_ANGLES = (0.0, 65.0)


@dataclass(frozen=True)
class Decision:
    """What was expected of one measurement, and the difference of ln Z that its simulation gave."""

    rivals: str
    name: str
    expected: float
    observed: float

    @property
    def true(self) -> bool:
        """True where the simulation is as decisive as expected."""
        return (self.expected >= STRONG) == (self.observed >= STRONG)


def scene(material: str, thickness: float) -> pl.Scene:
    """A film of a page that the catalogue proposes, on silicon, whose native oxide is an effect."""
    return pl.Scene(pl.Layer(material, pl.Free(10, 1000, start=thickness)), "Si")


def decided(number: int, seed: int) -> list[Decision]:
    """Decisions between one pair of rivals, of which the first is true."""
    true, other, depth = RIVALS[number]
    random = np.random.default_rng([seed, number])
    factor = random.normal(1, 0.003)
    # the page that is fitted is the true one: the other rivals are what is to be told apart
    layer = Layer(getattr(pl.material(true), "page", true), depth, factor)

    def sample(signal: str) -> Specimen:
        return Specimen((layer,), "Si", "", drawn_flaws(random, signal, depth))

    first = measured(sample("R"), View("R", 0.0, 0.003), random)
    fits = {name: pl.fit(first, scene(name, depth)) for name in (true, other)}
    levels: dict[str, Any] = {"noise": 0.003, "noise_degrees": 0.1}
    plan = pl.plan_measurement(fits, signals=_NEXT, angles=_ANGLES, polarisations=["unpolarised"], **levels)
    found = []
    for m in plan.measurements:
        view = View(m.signal, m.angle, m.noise, m.lower, m.upper, 101, m.polarisation)
        specimen = sample(m.signal)
        specimen = specimen.twice() if m.times != 1 else specimen
        data = measured(specimen, view, random)
        sigma = np.full(len(data), m.noise)
        errors: dict[str, Any] = {"sigma": sigma} | (
            {"delta_sigma": sigma} if m.signal == "psi-delta" else {}
        )
        data = replace(data, **errors)
        again = {name: pl.fit(data, scene(name, m.times * depth)) for name in fits}
        evidence = {x.name: x.log_evidence for x in pl.compare(again).candidates}
        assert m.delta_ln_z is not None
        found.append(Decision(f"{true}, {other}", m.name, m.delta_ln_z, evidence[true] - evidence[other]))
    return found


def report(seed: int, every: int) -> None:
    """Print all decisions and the share that came true."""
    found: list[Decision] = []
    for number in range(0, len(RIVALS), every):
        for one in decided(number, seed):
            found.append(one)
            mark = "" if one.true else "  not as expected"
            print(f"{one.rivals:20} {one.name:46} {one.expected:9.1f} {one.observed:9.1f}{mark}", flush=True)
    would = [x for x in found if x.expected >= STRONG]
    rest = [x for x in found if x.expected < STRONG]
    hits = sum(x.true for x in would), sum(x.true for x in rest)
    print(f"would decide: true in {hits[0]} of {len(would)}; would not: {hits[1]} of {len(rest)}")
