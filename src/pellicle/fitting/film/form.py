"""The simulation of a spectrum by a plan, compared with data: values, residuals and slopes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from pellicle.fitting.coordinates import Array
from pellicle.fitting.film import generalised, nuisance
from pellicle.fitting.film.nuisance import Data
from pellicle.fitting.problem import Explained
from pellicle.fitting.program_cache import kept
from pellicle.fitting.reported_layer import linearised
from pellicle.forward_model.film_signal import build, depolarises
from pellicle.forward_model.plan import Plan
from pellicle.optics.hoisting import compute_once, stack_rows
from pellicle.scene.film import Scene
from pellicle.scene.free import insert


@dataclass(frozen=True)
class SpectrumForm:
    """The simulation of a spectrum by a plan without words, compared with data by variable projection.

    With `depolarisation` a channel of it follows N, C, S. `elements` are the positions of measured elements
    of a Mueller matrix among m12, m13, ..., m44, `ratios` those of measured ratios of generalised Ψ and Δ;
    both are empty for other signals.
    """

    plan: Plan
    depolarisation: bool = False
    elements: tuple[int, ...] = ()
    ratios: tuple[int, ...] = ()

    def simulate(self, scene: Scene, data: Data) -> Any:
        """The signal as measured: all of it, or of N, C, S the N and C that a folded Δ leaves, or those
        elements of a Mueller matrix that were measured.

        Ψ and Δ do not depend on the degree of polarisation, so where some light is unpolarised, N, C, S are
        brought to their sphere; a rotating analyser measures N and C as they are. 1 − N² − C² − S² is the
        depolarisation.
        """
        signal = build(self.plan)(scene).reshape(scene.light.wavelength.size, -1)
        if self.elements:
            return stack_rows([signal[:, i] for i in self.elements]).T.reshape(-1)
        if self.ratios:
            return self._of_ratios(signal, data)
        channels = data.values.size // len(signal)
        if self.depolarisation:
            square = jnp.sum(signal**2, axis=1)
            length = jnp.where(square > 0, jax.lax.rsqrt(jnp.where(square > 0, square, 1.0)), 0.0)
            columns = [signal[:, i] * length for i in range(channels - 1)]
            signal = stack_rows([*columns, 1 - square]).T
        elif channels == 3 and depolarises(self.plan):
            square = jnp.sum(signal**2, axis=1, keepdims=True)
            signal = signal * jnp.where(square > 0, jax.lax.rsqrt(jnp.where(square > 0, square, 1.0)), 0.0)
        if data.frame is not None:
            signal = jnp.einsum("pij,pj->pi", data.frame, signal)
        return signal[:, :channels].reshape(-1)

    def _of_ratios(self, signal: Any, data: Data) -> Any:
        """N, C, S of the measured ratios, each brought to its sphere, in the frame of the data."""
        signal = stack_rows([signal[:, i] for i in generalised.positions(self.ratios)]).T
        if depolarises(self.plan):
            each = signal.reshape(len(signal), -1, generalised.CHANNELS)
            square = jnp.sum(each**2, axis=-1, keepdims=True)
            length = jnp.where(square > 0, jax.lax.rsqrt(jnp.where(square > 0, square, 1.0)), 0.0)
            signal = (each * length).reshape(signal.shape)
        return jnp.einsum("pij,pj->pi", data.frame, signal).reshape(-1)

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
    found = linearised(form, scene, data, values)
    solved = nuisance.solve(found.signal, data, scene.instrument)
    curves = solved.model, solved.gain, solved.offset
    return Local(found.signal, found.slope, *curves, found.layer, found.layer_slope)
