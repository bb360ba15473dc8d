"""The simulation of a spectrum by a plan, compared with data: values, residuals and slopes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from pellicle.fitting.coordinates import Array
from pellicle.fitting.film import nuisance
from pellicle.fitting.film.nuisance import Data
from pellicle.fitting.problem import Explained
from pellicle.fitting.reported_layer import linearised
from pellicle.forward_model.film_signal import build, depolarises
from pellicle.forward_model.plan import Plan
from pellicle.optics.hoisting import compute_once
from pellicle.programs.cache import kept
from pellicle.scene.film import Scene
from pellicle.scene.free import insert
from pellicle.signals.base import Signal


@dataclass(frozen=True)
class SpectrumForm:
    """The simulation of a spectrum by a plan without words, compared with data by variable projection.

    `signal` is what was measured: which channels, in which frame.
    """

    plan: Plan
    signal: Signal

    def simulate(self, scene: Scene, data: Data) -> Any:
        """The measured channels of the signal, (points · channels,)."""
        rows = build(self.plan)(scene).reshape(scene.light.wavelength.size, -1)
        return self.signal.compared(rows, data.frame, depolarises(self.plan))

    def with_plan(self, plan: Plan) -> SpectrumForm:
        """Return the form with another plan."""
        return replace(self, plan=plan)

    def explain(self, arrays: tuple[Scene, Data], values: Any, /) -> Explained:
        """The spectrum with the free parameters of its scene at `values`."""
        scene, data = arrays
        # stored: fused into sums over the points, the simulation runs in scalar loops
        signal = compute_once(self.simulate(insert(scene, values), data))
        solved = nuisance.solve(signal, data, scene.instrument)
        return Explained(solved.model, solved.residual, solved.deviance)


class Local(NamedTuple):
    """The model of a spectrum around one point, for errors and reports."""

    signal: Array  # simulated, without scale and offset
    slope: Array  # ∂ signal / ∂ parameter in its own unit, (points, parameters)
    model: Array
    gain: Array
    offset: Array
    layer: Array  # n and k of the layer at each wavelength
    layer_slope: Array  # their derivatives, (2, points, parameters)


@kept
def local(form: SpectrumForm, scene: Scene, data: Data, values: Any) -> Local:
    """Signal, its Jacobian, and the layer's index at `values` (parameters,)."""
    linear = linearised(form, scene, data, values)
    solved = nuisance.solve(linear.signal, data, scene.instrument)
    curves = solved.model, solved.gain, solved.offset
    return Local(linear.signal, linear.slope, *curves, linear.layer, linear.layer_slope)
