"""What the search and the solver evaluate: compiled functions of a problem's views and its parameters."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from pellicle.effects.plan import Plan
from pellicle.fitting.program_cache import kept
from pellicle.fitting.spectra import nuisance
from pellicle.fitting.spectra.nuisance import Data
from pellicle.fitting.spectra.problem import Box
from pellicle.scene.film import Scene
from pellicle.scene.free import free_leaves, insert
from pellicle.scene.layers import Interface
from pellicle.simulation.film import build


def _simulated(plan: Plan, numbers: Scene, data: Data) -> Any:
    """What was measured of the signal: all of it, or of N, C, S the N and C that a folded Δ leaves.

    Ψ and Δ do not tell how much of the light is polarised, so where some is not, N, C, S are brought to
    their sphere; a rotating analyser sees N and C as they are.
    """
    signal = build(plan)(numbers).reshape(numbers.light.wavelength.size, -1)
    channels = data.values.size // len(signal)
    if channels == 3 and _depolarises(plan):
        square = jnp.sum(signal**2, axis=1, keepdims=True)
        signal = signal * jnp.where(square > 0, jax.lax.rsqrt(jnp.where(square > 0, square, 1.0)), 0.0)
    if data.frame is not None:
        signal = jnp.einsum("pij,pj->pi", data.frame, signal)
    return signal[:, :channels].reshape(-1)


def _depolarises(plan: Plan) -> bool:
    """Whether intensities of several polarisations add."""
    return plan.on("back-face") or plan.on("angle-spread") or bool(plan.row("coherence").count)


def _solve(plan: Plan, scene: Scene, data: Data, values: Sequence[Any]) -> nuisance.Solved:
    signal = _simulated(plan, insert(scene, values), data)
    return nuisance.solve(signal, data, scene.instrument)


def _prior(box: Box, unit):
    return (box.values(unit) - box.prior_mean) * box.prior_weight


class Scanned(NamedTuple):
    """−2 log evidence of each candidate."""

    evidence: Any


@kept
def evidences(plan: Plan, scene: Scene, data: Data, box: Box, units: Any) -> Scanned:
    """−2 log evidence, in one view, of candidates `units` (candidates, its parameters) in the unit cube."""

    def one(unit):
        solved = _solve(plan, scene, data, list(box.values(unit)))
        return solved.evidence + jnp.sum(_prior(box, unit) ** 2)

    return Scanned(jax.vmap(one)(units))


Looks = tuple[tuple[Plan, tuple[int, ...]], ...]
"""Of each view the plan, and which of the parameters it takes: what a compiled program depends on."""


def explained(
    looks: Looks, scenes: Sequence[Scene], data: Sequence[Data], box: Box, unit: Any
) -> tuple[list[nuisance.Solved], Any]:
    """Every view at one point of the unit cube, and the rows of the priors."""
    values = list(box.values(unit))
    views = zip(looks, scenes, data, strict=True)
    solved = [_solve(plan, s, d, [values[i] for i in takes]) for (plan, takes), s, d in views]
    return solved, _prior(box, unit)


class Polished(NamedTuple):
    """Local minima in the unit cube, (starts, parameters), their evidence, and whether they settled."""

    units: Any
    evidence: Any
    converged: Any


@kept
def polish(looks: Looks, scenes: tuple[Scene, ...], data: tuple[Data, ...], box: Box, units: Any) -> Polished:
    """The local minimum below each start (starts, parameters), in all views together.

    The box may be one for all, or (starts, parameters): where its bounds meet a parameter is held.
    """
    from pellicle.fitting.levenberg_marquardt import least_squares  # a kept program needs no solver

    def one(unit, lower, upper):
        own = box._replace(lower=lower, upper=upper)

        def residual(unit):
            views, prior = explained(looks, scenes, data, own, unit)
            return jnp.concatenate([*(view.residual for view in views), prior])

        best, converged = least_squares(residual, unit)
        views, prior = explained(looks, scenes, data, own, best)
        return Polished(best, sum(view.evidence for view in views) + jnp.sum(prior**2), converged)

    sides = (jnp.broadcast_to(side, units.shape) for side in (box.lower, box.upper))
    return jax.vmap(one)(units, *sides)


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
    shown = shown_layer(scene)

    def both(values):
        numbers = insert(scene, list(values))
        medium: Any = numbers.substrate if shown is None else numbers.layers[shown]
        index = medium.material(numbers.light.wavelength)
        return _simulated(plan, numbers, data), jnp.stack([index.real, index.imag])

    values = box.values(unit)
    (signal, layer), push = jax.linearize(both, values)
    slope, layer_slope = jax.vmap(push, out_axes=-1)(jnp.eye(len(values)))
    solved = nuisance.solve(signal, data, scene.instrument)
    return Local(signal, slope, solved.model, solved.gain, solved.offset, layer, layer_slope)


class Curves(NamedTuple):
    """The model of each candidate, scale and offset at their best, (candidates, data values)."""

    model: Any


@kept
def curves(plan: Plan, scene: Scene, data: Data, box: Box, units: Any) -> Curves:
    """What one view would have measured at candidates `units` (candidates, its parameters)."""

    def one(unit):
        return _solve(plan, scene, data, list(box.values(unit))).model

    return Curves(jax.vmap(one)(units))
