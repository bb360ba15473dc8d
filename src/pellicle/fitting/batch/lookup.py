"""Scan of many spectra at once: the misfit that each node of a grid leaves after one linear step.

At each node, a thickness with values of the other parameters, the simulated signal and its tangents to all
free parameters are known beforehand, and with the scale and the offset they span the signals near the node.
What a spectrum leaves of that span is the misfit that a Gauss-Newton step predicts. With weights that all
spectra have in common the spans of all nodes are one matrix, and the scan of a block of spectra is one
product of matrices. A step counts up to half the distance to the next node only.
"""

from functools import partial
from logging import getLogger
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from pellicle.fitting.film.nuisance import chebyshev, offset_prior, scale_prior
from pellicle.fitting.film.search import design_points, thickness_grid
from pellicle.fitting.film.view import SpectrumForm, SpectrumView
from pellicle.fitting.problem import Problem
from pellicle.programs.cache import in_chunks, kept
from pellicle.scene.film import Scene
from pellicle.scene.free import insert
from pellicle.scene.instrument import Drift

log = getLogger(__name__)

_FINER = 4
"""Nodes of the thickness for each step of the grid of `fitting.film.search`: an eighth of the shortest
wavelength in the layer apart, a linear step leaves a third of the fringes' amplitude, a fourth of it 2 %."""
_MOST_NUMBERS = 40_000_000
"""Numbers of a table at most, 160 MB: with more the design of the other parameters is coarser."""
_ROWS = 3
"""Candidates for each minimum that is kept, where the thickness is scanned beside a design of other
parameters: the nodes of one minimum at several of its rows are all candidates."""
_DEPENDENT = 1e-9
"""Length of a column beside others, as a share of its own, below which they span it."""
_BATCH = 256


class Lookup(NamedTuple):
    """Table of nodes (design, thickness), in units of the unit cube and of the common weights.

    Columns of the table follow one another, each (design · thickness,): the signal where the scale is known,
    else the terms of the scale, the constant one last; then the tangents, the thickness first.
    """

    units: Any  # (nodes, parameters)
    weight: Any  # (points,): the common weights
    rotation: Any  # (points, columns of the offset), orthonormal together with rows of its priors
    known: Any  # (points,): weighted signal that is subtracted from all
    columns: Any  # (points + columns of the offset, columns · nodes), float32
    square: Any  # (nodes,): square of the signal's distance from `known`
    moved: Any  # (nodes, tangents): tangents' share of that distance
    limit: Any  # (nodes, tangents): how far steps count
    back: Any  # (nodes, tangents, tangents): steps in the unit cube by their shares
    gain: Any  # (nodes,): length of the signal, the constant term of the scale by its share
    prior: Any  # (nodes,): square of the distance from the parameters' priors


class Layout(NamedTuple):
    """Static part of the scan: sizes of a `Lookup`, and candidates that it returns for each spectrum."""

    designs: int
    depths: int
    gains: int  # terms of the scale, 0 where it is known
    order: tuple[int, ...]  # parameters in the order of the tangents
    relative: bool  # spectra are scaled to the level of the table
    candidates: int


class Candidates(NamedTuple):
    """Best nodes of each spectrum after a linear step, best first: (spectra, candidates, ...); and the least
    deviance near each thickness, (spectra, thickness)."""

    units: Any
    deviance: Any
    profile: Any


class _Signals(NamedTuple):
    signal: Any  # (nodes, points)
    slope: Any  # (nodes, parameters, points), by the unit cube


@kept
def _signals(form: SpectrumForm, arrays: tuple[Scene, Any], values: Any) -> _Signals:
    """Simulated signal and its derivatives at values (nodes, parameters)."""
    scene, data = arrays

    def one(values):
        signal, push = jax.linearize(lambda x: form.simulate(insert(scene, list(x)), data), values)
        signal, push = jax.lax.optimization_barrier((signal, push))
        return signal, jax.vmap(push)(jnp.eye(values.size))

    return _Signals(*jax.vmap(one)(values))


def table(
    problem: Problem, view: SpectrumView, weight: np.ndarray, level: float, orders: int
) -> tuple[Lookup, Layout, np.ndarray]:
    """The lookup of a problem's one view, its layout, and the thicknesses of its nodes in nm.

    **Arguments:** `view` without padding and without a frame; `weight` (points,), which all spectra have
    about in common, of values in units of their level where the scale is free, else of values of this
    `level`; `orders`, the minima of each spectrum that are kept.
    """
    instrument, data, points = view.scene.instrument, view.data, len(weight)
    gain_sd = scale_prior(instrument.scale)[1] if isinstance(instrument.scale, Drift) else np.zeros(0)
    offset_sd = offset_prior(instrument.offset)[1] if isinstance(instrument.offset, Drift) else np.zeros(0)
    depth, free_scale, gains = problem.thickness_axis, isinstance(instrument.scale, Drift), len(gain_sd)
    order = tuple(sorted(range(len(problem.parameters)), key=lambda i: i != depth))
    design, grid = _design(problem, max(gains, 1) * points + len(order) * points)
    units = np.repeat(design, len(grid), axis=0)
    if depth is not None:
        units[:, depth] = np.tile(grid, len(design))
    near = _reach(design, depth, grid)[:, list(order)]
    signal, slope = _simulated(problem, view, units)
    scale = 1.0 if isinstance(instrument.scale, Drift) else float(instrument.scale)
    mean = np.zeros(points) if free_scale else signal.mean(axis=0)
    weight = weight * np.sqrt(float(data.independent_fraction))
    terms = np.array([np.broadcast_to(t, points) for t in chebyshev(data.position, max(gains, 3))])
    offset_sd = offset_sd * (1.0 if free_scale else level)
    basis = _Basis(weight, scale, mean, terms, gain_sd, _offset_columns(weight, terms, offset_sd, gains))
    parts = (slice(first, first + _BATCH) for first in range(0, len(units), _BATCH))
    blocks = [basis.block(signal[own], slope[own][:, list(order)], near[own]) for own in parts]
    columns = np.concatenate([block.columns for block in blocks], axis=2)
    square, moved, limit, back, gain = (
        np.concatenate([getattr(block, name) for block in blocks]) for name in _Block._fields[1:]
    )
    prior = np.sum(np.asarray(problem.box.prior_rows(np.asarray(problem.values(units)))) ** 2, axis=1)
    candidates = orders * (1 if len(design) == 1 else _ROWS)
    layout = Layout(len(design), len(grid), gains, order, free_scale, candidates)
    lookup = Lookup(
        units=units,
        weight=weight,
        rotation=basis.rotation[:points],
        known=weight * scale * mean,
        columns=columns.reshape(len(columns), -1),
        square=square,
        moved=moved,
        limit=limit,
        back=back,
        gain=gain,
        prior=prior,
    )
    log.info("lookup: %d nodes of %d columns, %.3g MB", len(units), columns.shape[1], columns.nbytes / 1e6)
    p = None if depth is None else problem.parameters[depth]
    return lookup, layout, np.zeros(0) if p is None else p.lower + grid * (p.upper - p.lower)


def _design(problem: Problem, numbers: int) -> tuple[np.ndarray, np.ndarray]:
    """Points of the unit cube beside the thickness (designs, parameters), as many as `numbers` for each node
    allow, and the thicknesses (nodes,) in the unit cube."""
    design, grid = design_points(problem), np.zeros(1)
    if problem.thickness_axis is not None:
        grid = np.linspace(0.0, 1.0, _FINER * (len(thickness_grid(problem, len(design))) - 1) + 1)
    most = _MOST_NUMBERS // (numbers * len(grid))
    return (design if len(design) <= most else design_points(problem, most)), grid


def _offset_columns(weight: np.ndarray, terms: np.ndarray, sd: np.ndarray, gains: int) -> np.ndarray:
    """Orthonormal columns (rows, terms) of the offset: rows of the data, then of the priors of the offset and
    of a scale of so many `gains`."""
    points = len(weight)
    columns = np.zeros((points + len(sd) + max(gains - 1, 0), len(sd)))
    columns[:points] = (weight * terms[: len(sd)]).T
    columns[points : points + len(sd)] = np.diag(1 / sd)
    return np.linalg.qr(columns)[0]


class _Block(NamedTuple):
    """Fields of a `Lookup` for some of its nodes; `columns` (rows, columns, nodes)."""

    columns: np.ndarray
    square: np.ndarray
    moved: np.ndarray
    limit: np.ndarray
    back: np.ndarray
    gain: np.ndarray


class _Basis(NamedTuple):
    """Common part of the columns of all nodes: see `Lookup`.

    `terms` (terms, points) are those of the nuisances, `gain_sd` the priors of the scale's, and `rotation`
    are the offset's columns.
    """

    weight: np.ndarray
    scale: float
    mean: np.ndarray
    terms: np.ndarray
    gain_sd: np.ndarray
    rotation: np.ndarray

    def block(self, signal: np.ndarray, slope: np.ndarray, near: np.ndarray) -> _Block:
        """The columns of nodes by their signals (nodes, points), slopes (nodes, parameters, points) and the
        distance to the next ones (nodes, parameters)."""
        nodes, points = signal.shape
        gains, count, offsets = len(self.gain_sd), slope.shape[1], self.rotation.shape[1]
        away = self.weight * self.scale * (signal - self.mean)
        vectors = np.zeros((nodes, len(self.rotation), gains + count))
        if gains:
            size = np.median(np.abs(signal), axis=1)
            for j, term in enumerate([*range(1, gains), 0]):
                vectors[:, :points, j] = self.weight * self.terms[term] * signal
                if term:
                    vectors[:, points + offsets + term - 1, j] = size / self.gain_sd[term]
        vectors[:, :points, gains:] = np.swapaxes(self.weight * self.scale * slope, 1, 2)
        basis, triangle = _orthonormal(vectors, self.rotation)
        basis = basis[:, :points]
        tangents = triangle[:, gains:, gains:]
        length = np.diagonal(tangents, axis1=1, axis2=2)
        seen, limit = length > 0, length * near
        safe = tangents + np.where(seen, 0.0, 1.0)[:, :, None] * np.eye(count)
        back = np.linalg.inv(safe) * seen[:, :, None] * seen[:, None]
        square, gain, moved, chosen = np.zeros(nodes), np.ones(nodes), np.zeros((nodes, count)), basis
        if gains:
            gain = triangle[:, gains - 1, gains - 1]
            limit = limit / gain[:, None]
        else:
            common = away @ self.rotation[:points]
            square = np.sum(away**2, axis=1) - np.sum(common**2, axis=1)
            moved = np.einsum("npt,np->nt", basis, away)
            chosen = np.concatenate([away[:, :, None], basis], axis=2)
        below = np.einsum("po,npc->ocn", self.rotation[:points], chosen)
        if not gains:
            below[:, 0] = 0.0  # what is left of the data is orthogonal to the offset already
        columns = np.concatenate([np.moveaxis(chosen, 0, 2), below]).astype(np.float32)
        return _Block(columns, square, moved, limit, back, gain)


def _simulated(problem: Problem, view: SpectrumView, units: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Signals (nodes, points) and slopes by the unit cube (nodes, parameters, points) at nodes."""
    values = np.asarray(problem.values(units))
    signal, slope = in_chunks(lambda own: _signals(view.form, view.arrays, own), values, _BATCH)
    return np.nan_to_num(signal), np.nan_to_num(slope) * (problem.box.upper - problem.box.lower)[:, None]


def _reach(design: np.ndarray, depth: int | None, grid: np.ndarray) -> np.ndarray:
    """Half the distance to the farther neighbouring node, in each parameter's unit: (nodes, parameters)."""
    reach = np.empty_like(design)
    for column, own in zip(design.T, reach.T, strict=True):
        levels = np.unique(column)
        ends = [-levels[0], *levels.tolist(), 2 - levels[-1]]
        gaps = 0.5 * np.diff(np.array(ends, dtype=float))
        own[:] = np.maximum(gaps[:-1], gaps[1:])[np.searchsorted(levels, column)]
    if depth is not None:
        reach[:, depth] = 0.5 / max(len(grid) - 1, 1)
    return np.repeat(reach, len(grid), axis=0)


def _orthonormal(vectors: np.ndarray, rotation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Orthonormal columns of `vectors` (nodes, rows, columns) beside those of `rotation` (rows, any), and the
    triangle by which they make them up. A column that the others span is 0."""
    basis, count = np.array(vectors), vectors.shape[2]
    triangle = np.zeros((len(vectors), count, count))
    for j in range(count):
        column = basis[:, :, j]
        before = np.linalg.norm(column, axis=1)
        for _ in range(2):
            column = column - (column @ rotation) @ rotation.T
            for i in range(j):
                share = np.einsum("nr,nr->n", basis[:, :, i], column)
                triangle[:, i, j] += share
                column = column - share[:, None] * basis[:, :, i]
        length = np.linalg.norm(column, axis=1)
        length = np.where(length > _DEPENDENT * before, length, 0.0)
        triangle[:, j, j] = length
        basis[:, :, j] = column / np.where(length > 0, length, np.inf)[:, None]
    return basis, triangle


@partial(kept, calls="many")
def scan(layout: Layout, lookup: Lookup, values: Any, weight_scale: Any) -> Candidates:
    """Best nodes of spectra (spectra, points), each with weights `weight_scale` (spectra,) times the
    common."""
    gains, count = layout.gains, len(layout.order)
    shape, nodes = (layout.designs, layout.depths), layout.designs * layout.depths
    distance = values * lookup.weight - lookup.known
    common = distance @ lookup.rotation
    rest = distance - common @ lookup.rotation.T
    base = jnp.sum(distance**2, axis=1) - jnp.sum(common**2, axis=1)
    joined = jnp.concatenate([rest, common], axis=1).astype(jnp.float32)
    shares = (joined @ lookup.columns).reshape(len(values), -1, nodes)
    small = jax.tree.map(lambda x: jnp.asarray(x, jnp.float32), lookup._replace(columns=None))
    fall, room = 0.0, 1.0
    if gains:
        room = jnp.maximum(shares[:, gains - 1], 0.0)
        fall = jnp.sum(shares[:, : gains - 1] ** 2, axis=1) + room**2
    else:
        fall = 2 * shares[:, 0] - small.square
    first = max(gains, 1)
    for t in range(count):
        own = shares[:, first + t] - small.moved[:, t]
        beyond = jnp.maximum(jnp.abs(own) - small.limit[:, t] * room, 0.0)
        fall = fall + own**2 - beyond**2
    deviance = (base * weight_scale**2)[:, None] - fall * (weight_scale**2)[:, None] + small.prior
    deviance = jnp.where(jnp.isfinite(deviance), deviance, jnp.inf).reshape(-1, *shape)
    profile = jnp.min(deviance, axis=1)
    if layout.depths > 1:
        ends = jnp.pad(deviance, ((0, 0), (0, 0), (1, 1)), constant_values=jnp.inf)
        lowest = (deviance <= ends[:, :, :-2]) & (deviance < ends[:, :, 2:])
        deviance = jnp.where(lowest, deviance, jnp.inf)
    left = deviance.reshape(-1, nodes)
    position = jnp.arange(nodes)
    chosen = []
    for _ in range(min(layout.candidates, nodes)):
        least = jnp.min(left, axis=1)
        at = jnp.min(jnp.where(left <= least[:, None], position, nodes - 1), axis=1)
        left = jnp.where(position == at[:, None], jnp.inf, left)
        chosen.append((at, least))
    at, least = (jnp.stack(x, axis=1) for x in zip(*chosen, strict=True))
    own = jnp.moveaxis(jnp.take_along_axis(shares, at[:, None], axis=2), 1, 2)
    scale, room = jnp.ones(at.shape), jnp.ones(at.shape)
    if gains:
        room = jnp.maximum(own[..., gains - 1], 0.0).astype(float)
        scale = room / lookup.gain[at]
    limit = lookup.limit[at] * room[..., None]
    moves = jnp.clip(own[..., first:] - lookup.moved[at], -limit, limit)
    steps = jnp.einsum("pcij,pcj->pci", lookup.back[at], moves) / jnp.maximum(scale, 1e-30)[..., None]
    steps = jnp.where(jnp.isfinite(steps), steps, 0.0)
    inverse = np.argsort(np.array(layout.order))
    units = jnp.clip(lookup.units[at] + steps[..., inverse], 0.0, 1.0)
    return Candidates(units, least, profile)
