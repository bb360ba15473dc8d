"""A spectrum as a view of a least-squares problem: its simulation by a plan, scaled, compared with data."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple

import jax
import numpy as np

from pellicle.effects.differences import largest_difference, signals
from pellicle.effects.film_plan import full_plan
from pellicle.fitting.central_differences import evaluations
from pellicle.fitting.coordinates import Array
from pellicle.fitting.film import nuisance
from pellicle.fitting.film.nuisance import Coefficient, Data
from pellicle.fitting.film.sweeps import correlation_in_sweeps, sweeps_of
from pellicle.fitting.noise import DRIFT_CORRELATION, rounding, uneven_noise
from pellicle.fitting.problem import Explained, Noise, NoiseGroup
from pellicle.fitting.reported_layer import Linearised, linearised, linearised_by_numpy
from pellicle.forward_model.elementary_signal import by_numpy, is_elementary, points_by_numpy
from pellicle.forward_model.film_signal import build, depolarises
from pellicle.forward_model.plan import Plan
from pellicle.optics.hoisting import compute_once
from pellicle.programs.cache import kept
from pellicle.scene.film import Scene
from pellicle.scene.free import insert
from pellicle.signals.base import Signal

_POINT = 4e-7
"""Time of a point by NumPy as a share of the compilation of a program of slopes: 0.1 to 0.4 µs of 0.5 to
1.2 s for one or two layers, 1.3 µs of 7 s for a tilted axis."""
_QUICKER = 3
"""The program of a local model is called once or twice in a fit, and compiles so much faster than others."""


@dataclass(frozen=True)
class SpectrumForm:
    """The simulation of a spectrum by a plan without words, compared with data by variable projection.

    `signal` is what was measured: which channels, in which frame.
    """

    plan: Plan
    signal: Signal

    def simulate(self, scene: Scene, data: Data) -> Any:
        """The measured channels of the signal, (points · channels,)."""
        return self.compared(build(self.plan)(scene), scene, data)

    def compared(self, signal: Any, scene: Scene, data: Data) -> Any:
        """The measured channels (..., points · channels) of signals (..., values) of the plan."""
        rows = signal.reshape(*signal.shape[:-1], scene.light.wavelength.size, -1)
        seen = self.signal.compared(rows, data.frame, depolarises(self.plan))
        return seen.reshape(*signal.shape[:-1], -1)

    def signals(self, scene: Scene, data: Data, values: np.ndarray) -> np.ndarray | None:
        """The measured channels (candidates, points · channels) of candidates `values` (candidates, free
        numbers) by NumPy; None for a plan that it does not evaluate."""
        if not is_elementary(self.plan):
            return None
        return self.compared(by_numpy(self.plan, scene, values), scene, data)

    def numpy_share(self, arrays: tuple[Scene, Data], /) -> float:
        """Time of one candidate by NumPy, as a share of the compilation of a program of slopes."""
        return _POINT * points_by_numpy(self.plan, arrays[0])

    def explained(self, arrays: tuple[Scene, Data], values: np.ndarray, /) -> Explained | None:
        """The spectrum at candidates by NumPy; None for a plan that it does not evaluate."""
        scene, data = arrays
        signals = self.signals(scene, data, values)
        if signals is None:
            return None
        with np.errstate(all="ignore"):  # of a candidate without a signal
            solved = nuisance.solve(signals, data, scene.instrument)
        return Explained(solved.model, solved.residual, solved.deviance)

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


def _local_by_numpy(form: SpectrumForm, scene: Scene, data: Data, values: np.ndarray) -> Local:
    return _local(linearised_by_numpy(form, scene, data, values), data, scene)


def _share_of_local(form: SpectrumForm, scene: Scene, data: Data, values: np.ndarray) -> float:
    return _QUICKER * evaluations(len(values)) * form.numpy_share((scene, data))


@partial(kept, calls="few", at_first=_local_by_numpy, share=_share_of_local)
def local(form: SpectrumForm, scene: Scene, data: Data, values: Any) -> Local:
    """Signal, its Jacobian, and the layer's index at `values` (parameters,)."""
    return _local(linearised(form, scene, data, values), data, scene)


def _local(linear: Linearised, data: Data, scene: Scene) -> Local:
    solved = nuisance.solve(linear.signal, data, scene.instrument)
    curves = solved.model, solved.gain, solved.offset
    return Local(linear.signal, linear.slope, *curves, linear.layer, linear.layer_slope)


ROUND = 64
"""Spectra are padded to a multiple of this, so that files of nearly one length share a program."""

SCAN_POINTS = 448
"""Wavelengths used while scanning: enough for four samples in a fringe of 5 µm at index 2."""


def error_of_plan(plan: Plan, scene: Scene, values: np.ndarray) -> float:
    """Error of a plan of a scene with its free parameters at `values`, in the unit of the signal."""
    if not plan.tolerance:
        return 0.0
    at = np.asarray(values)[None]
    planned, whole = (signals(each, scene, at, build) for each in (plan, full_plan(scene)))
    return largest_difference(planned, whole, plan.degrees)


@dataclass(frozen=True)
class SpectrumView:
    """One spectrum of a problem, or many of one scene and grid, whose data have leading axes (...).

    `scene` has anonymous free parameters and sampled media; `takes` are the positions of its parameters in
    the problem. `data` is padded to a round length. `signal` is what was measured, as in `SpectrumForm`.
    """

    name: str  # empty where there is no other
    plan: Plan
    scene: Scene
    data: Data
    takes: tuple[int, ...]
    noise: Noise
    points: int  # data values: all channels of each wavelength
    channels: int
    largest_index: float
    signal: Signal
    sweeps: Sequence[np.ndarray]  # positions of the rows of each

    @property
    def form(self) -> SpectrumForm:
        return SpectrumForm(self.plan.static_key, self.signal)

    @property
    def arrays(self) -> tuple[Scene, Data]:
        return self.scene, self.data

    @property
    def rows(self) -> int:
        """Wavelengths without padding."""
        return self.points // self.channels

    @property
    def measured_channels(self) -> int:
        """The first channels, which are measured: outwards from the sphere of N, C, S nothing is."""
        return self.channels if self.data.frame is None else self.channels - self.signal.outwards

    @property
    def independent(self) -> int:
        """Independent data values: N, C and S lie on a sphere, so two of the three; elements count each."""
        return sum(group.independent for group in self.noise_groups)

    @property
    def noise_groups(self) -> tuple[NoiseGroup, ...]:
        """The channels of each noise."""
        return tuple(
            NoiseGroup(
                group.channels,
                self.noise.known if group.known is None else group.known,
                group.independent * self.rows,
            )
            for group in self.signal.groups(self.channels, self.data.frame is not None)
        )

    @property
    def independent_fraction(self) -> Any:
        """Effective points per point (...): correlated errors count less."""
        return self.data.independent_fraction

    def local(self, values: Any) -> Local:
        """The model around `values` (its parameters,)."""
        return local(self.form, self.scene, self.data, values)

    def residuals(self, at: Local) -> np.ndarray:
        """Weighted residuals (..., rows, channels)."""
        weighted = np.asarray((self.data.values - np.asarray(at.model)) * self.data.weight)
        return self._in_rows(weighted)

    def _in_rows(self, values: np.ndarray) -> np.ndarray:
        """Data values (..., data values) without padding, (..., rows, channels)."""
        return values[..., : self.points].reshape(*values.shape[:-1], self.rows, self.channels)

    def nuisances(self, at: Local) -> list[Coefficient]:
        """Coefficients of scale and offset, recovered from their curves."""
        own = f".{self.name}" if self.name else ""
        return nuisance.coefficients(self.data, self.scene.instrument, at.gain, at.offset, self.points, own)

    def nuisance_freedom(self, at: Local) -> float:
        """Number of coefficients: a spectrum determines nearly all of them."""
        return float(len(self.nuisances(at)))

    def at_model(self, at: Any) -> float:
        """1: the noise of a spectrum does not depend on the model."""
        return 1.0

    def by_local_noise(self, values: Any) -> SpectrumView:
        """The view with weights by the noise of neighbouring points at `values` (its parameters,), where σ is
        not given and differs."""
        if self.noise.known:
            return self
        columns = self.residuals(self.local(values)).T
        ratio = np.stack([uneven_noise(column, self.sweeps) for column in columns], axis=-1)
        return self.reweighted(1 / ratio, self.independent_fraction) if np.any(ratio > 1) else self

    def jacobian(self, at: Local) -> np.ndarray:
        """Weighted ∂ model / ∂ parameter, then by each coefficient of scale and offset in units of its prior,
        (..., points, parameters and coefficients)."""
        keep = slice(self.points)
        signal, gain, weight = (np.asarray(x)[..., keep] for x in (at.signal, at.gain, self.data.weight))
        steep = gain[..., None] * np.asarray(at.slope)[..., keep, :]
        flat = [
            c.basis * (signal if c.on_signal else 1.0) * np.asarray(c.prior_sd)[..., None]
            for c in self.nuisances(at)
        ]
        columns = [np.broadcast_to(column, weight.shape)[..., None] for column in flat]
        return weight[..., None] * np.concatenate([steep, *columns], axis=-1)

    def correlation_length(self, residuals: np.ndarray) -> Any:
        """Number of points (...) of one channel whose residuals (..., rows, channels) count as one: see
        `correlation_in_sweeps`."""
        return correlation_in_sweeps(residuals[..., : self.measured_channels], self.sweeps)

    def reweighted(self, factor: Any, fraction: Any) -> SpectrumView:
        """Weights times `factor` (broadcast to (..., rows, channels)), each point for `fraction` of one."""
        whole = np.ones(self.data.weight.shape)
        own = np.broadcast_to(factor, (*whole.shape[:-1], self.rows, self.channels))
        whole[..., : self.points] = own.reshape(*whole.shape[:-1], -1)
        most = 1 / DRIFT_CORRELATION if self.noise.drifting else 1.0
        data = self.data._replace(weight=self.data.weight * whole)
        return replace(self, data=data).counting(np.minimum(fraction, most))

    def counting(self, fraction: Any) -> SpectrumView:
        """The view with each point counting for `fraction` (...) of an independent one."""
        return replace(self, data=self.data._replace(independent_fraction=np.asarray(fraction, float)[()]))

    def thinned(self) -> SpectrumView:
        """Every so-many-th wavelength, at most about `SCAN_POINTS`, with the weight of those left out."""
        stride = -(-self.rows // SCAN_POINTS)
        if stride <= 1:
            return self
        size, channels = len(self.scene.light.wavelength), self.channels
        chosen = np.arange(0, self.rows, stride)
        padding = -len(chosen) % ROUND
        scene, data = self._taken(np.concatenate([chosen, np.full(padding, size - 1)]))
        real = np.repeat(np.concatenate([np.ones(len(chosen)), np.zeros(padding)]), channels)
        data = data._replace(
            weight=data.weight * real, independent_fraction=data.independent_fraction * stride
        )
        return replace(
            self,
            scene=scene,
            data=data,
            points=len(chosen) * channels,
            sweeps=sweeps_of(scene.light, len(chosen)),
        )

    def unpadded(self) -> SpectrumView:
        """The view without the points that make its length round."""
        scene, data = self._taken(np.arange(self.rows))
        return replace(self, scene=scene, data=data)

    def _taken(self, take: np.ndarray) -> tuple[Scene, Data]:
        """The arrays at the wavelengths of positions `take`."""
        size, channels = len(self.scene.light.wavelength), self.channels

        def picked(x):
            if np.ndim(x) not in (1, 3) or len(x) not in (size, size * channels):
                return x
            taken = x.reshape(size, -1)[take]
            return taken.reshape(-1) if np.ndim(x) == 1 else taken.reshape(-1, *x.shape[1:])

        leaves, structure = jax.tree_util.tree_flatten((self.scene, self.data))
        own = {id(x): picked(x) for x in leaves}  # what is one object stays one
        return jax.tree_util.tree_unflatten(structure, [own[id(x)] for x in leaves])

    def off_tolerance(self, values: np.ndarray) -> float:
        """Error of the view's plan at `values`, in the unit of its signal."""
        return error_of_plan(self.plan, self.scene, values)

    @property
    def rounding(self) -> Any:
        """Standard deviation (...) of the rounding of the values; 0 of components in a frame of each point,
        which are whole numbers."""
        step = rounding(np.asarray(self.data.values)[..., : self.points])[..., 0]
        return step if self.data.frame is None else np.zeros_like(step)

    def in_columns(self, values: Any) -> np.ndarray:
        """Data values or a model of them (..., data values) as columns of the signal, such as N, C and S,
        without padding, (..., rows, columns). A depolarisation is the last."""
        columns = self._in_rows(np.asarray(values))
        if self.data.frame is None:
            return columns
        return np.einsum("...pij,...pi->...pj", np.asarray(self.data.frame)[..., : self.rows, :, :], columns)

    def in_channels(self, change: np.ndarray) -> np.ndarray:
        """A change of the columns (..., rows, columns) as (..., rows, measured channels)."""
        if self.data.frame is not None:
            frame = np.asarray(self.data.frame)[..., : self.rows, :, :]
            change = np.einsum("...pij,...pj->...pi", frame, change)
        return change[..., : self.measured_channels]

    def rms(self, model: Any) -> Any:
        """rms (...) of the residuals. For Ψ and Δ it is in degrees of Ψ: half the distance on the sphere, in
        each of its two directions."""
        return self.signal.rms(self.in_columns(self.data.values - np.asarray(model)))
