"""Hypotheses about a sample, and what an identification concludes from them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Any

import numpy as np

from pellicle.data.spectrum import Spectrum
from pellicle.fitting.report_methods import PlotMixin
from pellicle.fitting.result import Estimate
from pellicle.identification.free_models import FREE_MODELS, built
from pellicle.scene.film import Scene
from pellicle.scene.free import Free
from pellicle.scene.layers import Interface, Layer

TABLE_UNCERTAINTY = 0.01
"""Relative standard uncertainty of the index of a film that a page of the catalogue describes."""
ROUGH = "roughness"
EFFECTS = {
    ROUGH: "roughness",
    "thickness_spread": "uneven thickness",
    "angle_shift": "shifted angle of incidence",
    "scale": "free scale",
}
"""Numbers that stand for an effect and not for a layer, and their names in sentences."""


class Outcome(StrEnum):
    """Outcome of an identification."""

    IDENTIFIED = "identified"
    UNDECIDED = "undecided"
    NONE = "none"
    FAILED = "failed"


@dataclass(frozen=True)
class SupposedLayer:
    """One layer of a hypothesis.

    `material` is a name of the catalogue or of a dispersion model; `like` are the names of the catalogue
    whose index this is within the range of the data, the nearest first, and `n` and `k` the least and the
    largest index there. `numbers` are the estimates of its numbers, of which `thickness` (nm) is the first,
    by their names in a fit of one layer.
    """

    material: str
    like: tuple[str, ...]
    n: tuple[float, float]
    k: tuple[float, float]
    numbers: tuple[Estimate, ...]

    @property
    def thickness(self) -> Estimate:
        """Estimate of the thickness (nm)."""
        return self.numbers[0]

    @property
    def modelled(self) -> bool:
        """True for a dispersion model, False for a page of the catalogue."""
        return self.material in FREE_MODELS

    def layers(self, name: str) -> list[Layer | Interface]:
        """Return it as a layer of a scene, `name`, with its numbers free from their estimates, below a
        mixture of half and half with the medium above where it is rough."""
        free: dict[str, Any] = {x.name: _free(x) for x in self.numbers}
        rough = [Interface(free.pop(ROUGH), name=ROUGH)] if ROUGH in free else []
        own = {key: free.pop(key) for key in ("thickness", "thickness_spread") if key in free}
        if self.modelled:
            return [*rough, Layer(built(self.material, free), name=name, **own)]
        uncertain = TABLE_UNCERTAINTY
        return [*rough, Layer(self.material, name=name, index_uncertainty=uncertain, **own)]


@dataclass(frozen=True)
class Hypothesis:
    """One description of a sample: its layers from the ambient down, effects, and how it explains the data.

    `ln_z` is ln of the evidence, up to a constant that all hypotheses of an identification share,
    `probability` that of the hypothesis among those that survive, each as probable beforehand, and
    `remaining` the ratio of the residuals that no systematic effect explains to the noise. `adequate` is
    true where the hypothesis describes the data within usual errors. `instrument` are estimates of the
    instrument's numbers. `curves` is the signal of each spectrum, (points, quantities) in the order of
    `Spectrum.kind.quantities`. `around` is the scene of the bare substrate, with the given light. `condition`
    says which statement about the measurement is taken to be wrong, "" for none.
    """

    name: str
    layers: tuple[SupposedLayer, ...]
    ln_z: float
    remaining: float
    adequate: bool
    around: Scene = field(repr=False, compare=False)
    curves: tuple[np.ndarray, ...] = field(default=(), repr=False, compare=False)
    instrument: tuple[Estimate, ...] = ()
    condition: str = ""
    probability: float = 0.0

    @property
    def parameters(self) -> dict[str, Estimate]:
        """Estimates by their names in a fit of `scene()`."""
        every = [(number, x) for number, layer in enumerate(self.layers, 1) for x in layer.numbers]
        several = len(self.layers) > 1 or any(x.name == ROUGH for _, x in every)
        found = {}
        for number, x in every:
            name = (
                f"{ROUGH}.thickness" if x.name == ROUGH else f"layer{number}.{x.name}" if several else x.name
            )
            found[name] = replace(x, name=name)
        return found | {x.name: x for x in self.instrument}

    @property
    def status(self) -> str:
        """Status as that of a fit: "misfit", "not-identifiable" without a thickness, or "converged"."""
        if not self.adequate:
            return "misfit"
        return "converged" if math.isfinite(self.layers[0].thickness.stderr) else "not-identifiable"

    @property
    def effects(self) -> tuple[str, ...]:
        """Names of the effects that it needs beside its layers."""
        return tuple(dict.fromkeys(word for word, _ in self.effect_numbers()))

    def effect_numbers(self) -> Iterator[tuple[str, Estimate]]:
        """Each number that stands for an effect, behind the name of that."""
        for x in (*(x for layer in self.layers for x in layer.numbers), *self.instrument):
            if word := EFFECTS.get(x.name.rpartition(".")[2]):
                yield word, x

    def scene(self) -> Scene:
        """Return the scene with the free numbers of the hypothesis, which `pellicle.fit` takes."""
        own: Any = {x.name.partition(".")[2]: _free(x) for x in self.instrument}
        return replace(
            self.around,
            layers=tuple(x for i, layer in enumerate(self.layers, 1) for x in layer.layers(f"layer{i}")),
            instrument=replace(self.around.instrument, **own),
        )


def _free(x: Estimate) -> Free:
    return Free(x.lower, x.upper, start=x.value)


@dataclass(frozen=True)
class NotTried:
    """A material, structure or effect that was not tried, and the reason."""

    material: str
    why: str


@dataclass(frozen=True)
class DecidingSignal:
    """A further measurement, and the difference of ln Z that it would make between those that survive."""

    signal: str
    angle: float
    delta_ln_z: float


@dataclass(frozen=True, repr=False)
class Identification(PlotMixin):
    """Result of an identification: hypotheses of the layers of one sample.

    `hypotheses` are those that the data leave, the best first, and `excluded` the others that were tried,
    the nearest first. `data` are the spectra as they were compared, `noise` their noise: standard deviations
    of each channel, of which ψ and Δ have N, C and S. `seconds` is the time that it took.
    """

    status: Outcome
    hypotheses: tuple[Hypothesis, ...]
    excluded: tuple[Hypothesis, ...]
    not_tried: tuple[NotTried, ...]
    verdict: str
    data: tuple[Spectrum, ...] = field(repr=False, compare=False)
    noise: tuple[np.ndarray, ...] = field(repr=False, compare=False)
    would_decide: tuple[DecidingSignal, ...] = ()
    seconds: float = 0.0

    @property
    def best(self) -> Hypothesis:
        """The hypothesis of most evidence among those that the data leave. Raises ValueError for none."""
        if not self.hypotheses:
            raise ValueError("no hypothesis describes the data: see `excluded` for the nearest")
        return self.hypotheses[0]

    def __str__(self) -> str:
        return f"{self.status}: {self.verdict}"

    __repr__ = __str__
