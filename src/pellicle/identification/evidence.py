"""Evidence of structures, with systematic effects integrated out, and whether they describe the data.

The covariance of the data is σ²F + Σ c cᵀ: noise, of which the structure with the least residuals between
neighbouring points sets σ, and columns c of systematic effects; F ≥ 1 is the reduced χ² of the best, so that
what no structure explains counts as noise. Numbers are integrated by Laplace's approximation, with a uniform
prior within their bounds (D. MacKay, 2003, Information Theory, Inference and Learning Algorithms, eq. 28.6).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from pellicle.fitting.discrepancy import improbable
from pellicle.identification.hypothesis import TABLE_UNCERTAINTY
from pellicle.identification.problem import Attempt, Column, Problem
from pellicle.identification.signal_view import SLOTS, SignalView
from pellicle.identification.structure import OXIDE, Material, Structure, half_and_half
from pellicle.scene.uncertainty import Uncertainty

_UNIFORM = 12.0
"""Inverse variance of a number of which the data see nothing, in units of its range."""
_CHOICE = 3.5
"""Price of a further layer, in ln Z, for being one of the films that are tried: ln of their number."""
_PROBE = 0.002
"""Relative change of an index by which its effect is computed."""
NATIVE = 2.0
"""Index of a substrate from which it has a native oxide, as `Uncertainty.interlayer` has it."""
LARGE, TYPICAL = 2.5, 0.015
"""Times the noise, and share of the range, above which residuals that no effect explains are too large."""


class System(NamedTuple):
    """Linear model of an attempt: slopes and effects over the noise, inverse prior variances, residuals."""

    attempt: Attempt
    columns: list[Column]
    matrix: np.ndarray
    prior: np.ndarray
    data: np.ndarray

    def solved(self, factor: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Information, solution, and what is left of the residuals, with noise enlarged by `factor` (σ²).

        A number that would leave its bounds stays there, and the others make up for it.
        """
        information = self.matrix.T @ self.matrix / factor + np.diag(self.prior)
        gradient = self.matrix.T @ self.data / factor
        structure, x = self.attempt.structure, self.attempt.x
        room = np.stack([structure.lower - x, structure.upper - x]) / (structure.upper - structure.lower)
        solution, held = np.linalg.solve(information, gradient), np.zeros(len(gradient), bool)
        for _ in range(len(x)):
            inside = np.clip(solution[: len(x)], *room)
            beyond = np.flatnonzero(np.abs(inside - solution[: len(x)]) > 1e-12)
            if not beyond.size:
                break
            solution[beyond], held[beyond] = inside[beyond], True
            rest = gradient[~held] - information[np.ix_(~held, held)] @ solution[held]
            solution[~held] = np.linalg.solve(information[np.ix_(~held, ~held)], rest)
        return information, solution, self.data - self.matrix @ solution

    @property
    def reduced_chi2(self) -> float:
        """Reduced χ² with the effects at their best sizes."""
        left = self.solved(1.0)[2]
        return float(left @ left) / max(len(left) - len(self.attempt.x) - 8, 1)


class Weighed(NamedTuple):
    """A structure with its evidence.

    `x` are its numbers with the effects at their best sizes, `stderr` their errors with these, `stderr_noise`
    by the noise alone, `index_changes` the relative change of the index of each layer that the effects make.
    `shapeless` is true where it would be adequate but for the shape of a free index.
    `remaining` is the ratio of residuals that no effect explains to the noise, `excess`
    the named effect that must be largest, and its size in standard uncertainties, `strain` the largest of
    those but an error of the wavelengths: those of a real reflectometer were off by 4 of its usual errors.
    """

    attempt: Attempt
    x: np.ndarray
    stderr: np.ndarray
    stderr_noise: np.ndarray
    index_changes: tuple[float, ...]
    ln_z: float
    remaining: float
    adequate: bool
    shapeless: bool
    excess: tuple[str, float]
    strain: float

    @property
    def structure(self) -> Structure:
        return self.attempt.structure


def weigh(problem: Problem, attempts: list[Attempt], known: dict[int, list[Column]]) -> list[Weighed]:
    """Weigh structures against each other, the best first. `known` keeps the columns of each by its id."""
    noise = np.min([problem.short_range_noise(problem.data - x.values) for x in attempts], axis=0)
    sigma = problem.sigma(noise)
    systems = []
    for attempt in attempts:
        own = known.setdefault(id(attempt), effect_columns(problem, attempt))
        columns = [*own, problem.of_wavelength(attempt.values), *problem.instrument]
        span = attempt.structure.upper - attempt.structure.lower
        effects = np.stack([x.change for x in columns], axis=1)
        matrix = np.concatenate([attempt.slopes * span, effects], axis=1) / sigma[:, None]
        prior = np.concatenate([np.full(len(span), _UNIFORM), np.ones(len(columns))])
        systems.append(System(attempt, columns, matrix, prior, (problem.data - attempt.values) / sigma))
    factor = max(1.0, min(system.reduced_chi2 for system in systems))
    found = [_weighed(problem, system, factor, sigma) for system in systems]
    return sorted(found, key=lambda x: -x.ln_z)


def _weighed(problem: Problem, system: System, factor: float, sigma: np.ndarray) -> Weighed:
    attempt, columns, matrix, prior, data = system
    structure, count = attempt.structure, len(attempt.x)
    span = structure.upper - structure.lower
    information, solution, left = system.solved(factor)
    chi2 = float(left @ left / factor + solution @ (prior * solution))
    ln_z = -0.5 * (chi2 + np.linalg.slogdet(information)[1] - np.sum(np.log(prior)))
    ln_z -= 0.5 * len(data) * math.log(factor) + float(np.sum(np.log(sigma)))
    ln_z -= _CHOICE * max(sum(layer.most > OXIDE for layer in structure.layers) - 1, 0)
    # errors: numbers are bounded by the data alone, effects by their sizes
    loose = np.concatenate([np.full(count, 1e-3), np.ones(len(columns))])
    own = max(1.0, float(left @ left) / factor / max(len(data) - count, 1))
    error = np.sqrt(np.diag(np.linalg.inv(information + np.diag(loose - prior)))[:count] * own) * span
    slopes = matrix[:, :count]
    by_noise = np.sqrt(np.diag(np.linalg.inv(slopes.T @ slopes + np.diag(loose[:count]))) * factor) * span
    shift = solution[:count] * span
    named = np.array([x.named for x in columns])
    sizes = np.abs(solution[count:]) * named
    remaining = float(np.sqrt(np.mean(left**2)))
    rest = sizes * np.array([not x.name.endswith("dispersion") for x in columns])
    implausible, otherwise = (float(x @ x) > improbable(int(named.sum())) for x in (sizes, rest))
    large = remaining > LARGE and _too_large(problem, left * sigma)
    worst = int(np.argmax(sizes))
    of_tables = {x.name: TABLE_UNCERTAINTY * size for x, size in zip(columns, solution[count:], strict=True)}
    return Weighed(
        attempt,
        np.clip(attempt.x + shift, structure.lower, structure.upper),
        np.hypot(error, shift / 2),
        np.minimum(by_noise, error),
        tuple(of_tables.get(_index_effect(x), 0.0) for x in structure.layers),
        ln_z,
        remaining,
        not implausible and not large,
        not otherwise and not large and any(layer.modelled for layer in structure.layers),
        (columns[worst].name, float(sizes[worst])),
        float(max(size for x, size in zip(columns, sizes, strict=True) if x.name != "wavelength")),
    )


def _index_effect(layer: Material) -> str:
    """Name of the effect of a layer whose index is that of a table."""
    return f"index of {layer.name}"


def _too_large(problem: Problem, left: np.ndarray) -> bool:
    """True where the residuals of a spectrum are a visible part of its range."""
    rows = [(view, np.sqrt(np.mean(np.sum(own**2, axis=1)))) for view, own in problem.by_channel(left)]
    return any(size > TYPICAL * view.span for view, size in rows)


def effect_columns(problem: Problem, attempt: Attempt) -> list[Column]:
    """Systematic effects of the sample at an attempt: what its structure states and leaves out."""
    every = [_of_view(attempt, view) for view in problem.views]
    names = dict.fromkeys(name for own in every for name in own)
    zeros = [np.zeros(view.data.size) for view in problem.views]
    return [
        Column(name, np.concatenate([own.get(name, zero) for own, zero in zip(every, zeros, strict=True)]))
        for name in names
    ]


def _of_view(attempt: Attempt, view: SignalView) -> dict[str, np.ndarray]:
    """Change of the values of one view by each effect of the sample."""
    structure, allowed = attempt.structure, Uncertainty()
    index, depth = (x[0] for x in structure.slots(attempt.x[None], view))
    layers = range(SLOTS - len(structure.layers), SLOTS)
    top = SLOTS - len(structure.layers) - ("roughness" in structure.effects)
    thickest = max(layers, key=lambda i: depth[i])
    rows, of = [(index, depth, 0.0)], []

    def changed(name: str, factor: float, n: np.ndarray, d: np.ndarray, angle: float = 0.0) -> None:
        rows.append((n, d, angle))
        of.append((name, factor))

    def tilted(position: int, by: np.ndarray | float) -> np.ndarray:
        fresh = index.copy()
        fresh[position] = fresh[position] * (1 + _PROBE * by)
        return fresh

    for i, layer in zip(layers, structure.layers, strict=True):
        if not layer.modelled:
            changed(_index_effect(layer), TABLE_UNCERTAINTY / _PROBE, tilted(i, 1.0), depth)
    slope = 2 * (view.wavelength - view.wavelength[0]) / np.ptp(view.wavelength) - 1
    changed("dispersion", allowed.dispersion / _PROBE, tilted(thickest, slope), depth)
    changed("curved dispersion", allowed.dispersion / _PROBE, tilted(thickest, 2 * slope**2 - 1), depth)
    if top > 0:
        first = index[top] if depth[top] > 0 or top == SLOTS - 1 else index[top + 1]
        if "roughness" not in structure.effects:
            mixed = half_and_half(first[None], view)[0]
            changed("roughness", 1.0, *_put(index, depth, top - 1, mixed, allowed.roughness))
        changed("overlayer", 1.0, *_put(index, depth, top - 1, np.full_like(first, 1.5), allowed.overlayer))
        if float(np.mean(view.media[1].real)) > NATIVE and structure.layers[-1].name != "SiO2":
            up = np.concatenate([index[1:], index[:1]]), np.concatenate([depth[1:], depth[:1]])
            oxide = np.full_like(first, 1.46)
            changed("native oxide", 1.0, *_put(*up, SLOTS - 1, oxide, allowed.interlayer))
    if "thickness_spread" not in structure.effects:
        width = min(allowed.thickness_spread * depth[thickest], 12.0)
        for sign in (1, -1):
            uneven = depth.copy()
            uneven[thickest] += sign * width
            changed("thickness spread", 0.5, index, uneven)
    if view.oblique and "angle_shift" not in structure.effects:
        changed("angle", 1.0, index, depth, allowed.angle)
    n, d, angle = (np.stack(x) for x in zip(*rows, strict=True))
    if "angle_shift" in structure.effects:
        angle = angle + attempt.x[structure.column("angle_shift")]
    values = view.simulate(n, d, angle)
    found: dict[str, np.ndarray] = {}
    for (name, factor), row in zip(of, values[1:], strict=True):
        found[name] = found.get(name, 0.0) + factor * (row - values[0])
    media = view.media.copy()
    media[1] = media[1] * (1 + _PROBE)
    substrate = view.simulate(n[:1], d[:1], angle[:1], media)[0] - values[0]
    return {**found, "index of the substrate": allowed.index / _PROBE * substrate}


def _put(
    index: np.ndarray, depth: np.ndarray, slot: int, own: np.ndarray, thickness: float
) -> tuple[np.ndarray, np.ndarray]:
    """Slots with another layer in one of them."""
    index, depth = index.copy(), depth.copy()
    index[slot], depth[slot] = own, thickness
    return index, depth
