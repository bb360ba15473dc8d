"""A spectrum and a scene as numbers: what the search and the solver evaluate."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from pellicle.effects import largest_index
from pellicle.fitting import nuisance
from pellicle.fitting.nuisance import Data
from pellicle.fitting.parameters import Parameter, anonymous, bounds, parameters
from pellicle.fitting.programs import kept
from pellicle.model import build, sampled
from pellicle.planning import Plan, plan
from pellicle.scene import Interface, Scene, coherent_layers, free_leaves, insert, with_wavelength

_ROUND = 64
"""Spectra are padded to a multiple of this, so that files of nearly one length share a program."""


class Box(NamedTuple):
    """Bounds and normal priors; the search lives in the unit cube between the bounds."""

    lower: Any
    upper: Any
    prior_mean: Any
    prior_weight: Any  # 1/sd, 0 for none

    def values(self, unit):
        return self.lower + unit * (self.upper - self.lower)


class Problem(NamedTuple):
    """Everything about one fit. `scene` has anonymous free parameters and sampled media."""

    plan: Plan
    scene: Scene
    data: Data
    box: Box
    parameters: tuple[Parameter, ...]
    points: int  # data values: three for each wavelength in ellipsometry
    largest_index: float

    @property
    def channels(self) -> int:
        """Data values at each wavelength."""
        return len(self.data.values) // len(self.scene.light.wavelength)

    @property
    def rows(self) -> int:
        """Wavelengths that are real, not padding."""
        return self.points // self.channels

    @property
    def thickness_axis(self) -> int | None:
        """Which thickness is scanned finely: the one with the widest bounds, None where all are fixed."""
        spans = {i: p.upper - p.lower for i, p in enumerate(self.parameters) if p.key == "thickness"}
        return max(spans, key=lambda i: spans[i]) if spans else None

    @property
    def program(self) -> tuple[Any, ...]:
        """The arguments that the compiled functions take, the plan first (static)."""
        return self.plan.wordless, self.scene, self.data, self.box


def make(scene: Scene, wavelength, values, sigma, temper: float) -> Problem:
    """The problem of fitting `values` with weights 1/`sigma` at `wavelength` (nm).

    `values` are fractions (points,), or N, C, S (points, 3) for ellipsometry; `sigma` is (points,).
    Raises ValueError where a material has no data at a wavelength.
    """
    points, channels = len(wavelength), values.size // len(wavelength)
    extra = -points % _ROUND
    wavelength, values = _pad(wavelength, extra), _pad(values, extra)
    scene = with_wavelength(scene, wavelength, _pad_angle(scene.light.angle, extra))
    chosen = plan(scene)
    free = parameters(scene)
    span = max(wavelength.max() - wavelength.min(), 1e-9)  # one wavelength at many angles has none
    weight = np.concatenate([1 / np.broadcast_to(sigma, points), np.zeros(extra)])
    data = Data(
        values=values.reshape(-1),
        weight=np.repeat(weight, channels),
        position=np.repeat(2 * (wavelength - wavelength.min()) / span - 1, channels),
        temper=np.float64(temper),
        level=np.float64(max(float(np.median(np.abs(values[:points]))), 1e-12)),
    )
    lower, upper = bounds(free)
    box = Box(
        lower,
        upper,
        np.array([p.prior.mean if p.prior else 0.0 for p in free]),
        np.array([1 / p.prior.sd if p.prior else 0.0 for p in free]),
    )
    scene = sampled(scene, chosen.on("coherence"))
    steepest = max((largest_index(x.material, wavelength) for x in coherent_layers(scene)), default=1.0)
    return Problem(chosen, anonymous(scene), data, box, free, points * channels, steepest)


def _pad(x: np.ndarray, extra: int) -> np.ndarray:
    return np.concatenate([x, np.repeat(x[-1:], extra, axis=0)])


def _pad_angle(angle: Any, extra: int) -> Any:
    return _pad(angle, extra) if np.ndim(angle) else angle


def thin(problem: Problem, most: int) -> Problem:
    """Every so-many-th wavelength, at most about `most`, with the weight of those left out."""
    stride = -(-problem.rows // most)
    if stride <= 1:
        return problem
    size, channels = len(problem.scene.light.wavelength), problem.channels
    kept = np.arange(0, problem.rows, stride)
    padding = -len(kept) % _ROUND
    take = np.concatenate([kept, np.full(padding, size - 1)])

    def pick(x):
        if np.ndim(x) != 1 or len(x) not in (size, size * channels):
            return x
        return x.reshape(size, -1)[take].reshape(-1)

    scene, data = jax.tree_util.tree_map(pick, (problem.scene, problem.data))
    real = np.repeat(np.concatenate([np.ones(len(kept)), np.zeros(padding)]), channels)
    data = data._replace(weight=data.weight * real, temper=data.temper * stride)
    return problem._replace(scene=scene, data=data, points=len(kept) * channels)


def _solve(plan: Plan, scene: Scene, data: Data, box: Box, unit) -> nuisance.Solved:
    signal = build(plan)(insert(scene, list(box.values(unit))))
    solved = nuisance.solve(signal, data, scene.instrument)
    prior = (box.values(unit) - box.prior_mean) * box.prior_weight
    return solved._replace(
        residual=jnp.concatenate([solved.residual, prior]), evidence=solved.evidence + jnp.sum(prior**2)
    )


class Scanned(NamedTuple):
    """−2 log evidence of each candidate."""

    evidence: Any


@kept
def evidences(plan: Plan, scene: Scene, data: Data, box: Box, units: Any) -> Scanned:
    """−2 log evidence of candidates `units` (candidates, parameters) in the unit cube."""
    return Scanned(jax.vmap(lambda unit: _solve(plan, scene, data, box, unit).evidence)(units))


class Polished(NamedTuple):
    """Local minima in the unit cube, (starts, parameters), their evidence, and whether they settled."""

    units: Any
    evidence: Any
    converged: Any


@kept
def polish(plan: Plan, scene: Scene, data: Data, box: Box, units: Any) -> Polished:
    """The local minimum below each start (starts, parameters)."""
    from pellicle.fitting.solve import least_squares  # a kept program needs no solver

    def one(unit):
        best, converged = least_squares(lambda u: _solve(plan, scene, data, box, u).residual, unit)
        return Polished(best, _solve(plan, scene, data, box, best).evidence, converged)

    return jax.vmap(one)(units)


class Local(NamedTuple):
    """The model around one point of the box, for errors and reports."""

    signal: Any  # simulated, without scale and offset
    slope: Any  # ∂ signal / ∂ parameter in its own unit, (points, parameters)
    model: Any
    gain: Any
    offset: Any
    layer: Any  # n and k of the layer at each wavelength
    layer_slope: Any  # their derivatives, (2, points, parameters)


def shown_layer(scene: Scene) -> int | None:
    """Which layer's n and k are reported: the first with free numbers of its own, else the uppermost;
    None, the substrate, where nothing but interfaces lies on it."""
    known = [(i, x.material) for i, x in enumerate(scene.layers) if not isinstance(x, Interface)]
    free = [i for i, material in known if free_leaves(material)]
    return next(iter([*free, *(i for i, _ in known)]), None)


@kept
def local(plan: Plan, scene: Scene, data: Data, box: Box, unit: Any) -> Local:
    """Signal, its Jacobian, and the layer's index at one point of the box."""
    simulate, shown = build(plan), shown_layer(scene)

    def both(values):
        numbers = insert(scene, list(values))
        medium: Any = numbers.substrate if shown is None else numbers.layers[shown]
        index = medium.material(numbers.light.wavelength)
        return simulate(numbers), jnp.stack([index.real, index.imag])

    values = box.values(unit)
    (signal, layer), push = jax.linearize(both, values)
    slope, layer_slope = jax.vmap(push, out_axes=-1)(jnp.eye(len(values)))
    solved = nuisance.solve(signal, data, scene.instrument)
    return Local(signal, slope, solved.model, solved.gain, solved.offset, layer, layer_slope)
