"""Orders of interference of pixels from their neighbours: region growing from the decided pixels.

Each pixel has a few minima, the orders of interference, with their Δχ². The map is a Markov random field: the
energy of an order is its Δχ² plus the squared distance of its thickness from a plane through the decided
neighbours, in standard deviations, and no more than a limit, so that real steps stay. Pixels are decided one
front after the other, where the prediction is best first.

**Source:** Besag 1986, J. R. Stat. Soc. B 48, 259 (field and local decisions); Ghiglia and Pritt 1998,
Two-dimensional phase unwrapping, ch. 4 (growth by quality).
"""

import itertools
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from pellicle.fitting.status import RIVAL

_REACH, _STEPS = 2, 3
"""Largest distance of a neighbour along one axis, and along all axes together, in pixels."""
_SITES, _FAR = 12, 3.0
"""Number of neighbours of a site, and their largest distance in units of the usual one."""
_OUTLIER, _OUTLIERS = 5.0, 0.25
"""Distance from the plane, in standard deviations, of a thickness that does not lie on it, and the share of
such neighbours that marks an edge. At a straight edge 40 % of the window lie beyond it."""
_BATCH = 20_000
"""Pixels that are predicted at a time: 30 MB for a window on a plane."""
_SAMPLE = 20_000
"""Decided pixels from which the usual slope and roughness are computed."""


class Near(NamedTuple):
    """Neighbours of some pixels, arrays (pixels, neighbours, ...).

    `pixel` are flat positions in the map, `offset` (..., axes) the way to the neighbour in units of the usual
    step along each axis, and `linked` is False where there is no neighbour, or only across a gap.
    """

    pixel: np.ndarray
    offset: np.ndarray
    linked: np.ndarray


@dataclass(frozen=True)
class Neighbourhood:
    """The neighbours of the pixels of a map of this `shape`.

    `positions` are the coordinates along each axis of a grid. One axis, `site_axis`, may be of sites, whose
    neighbours are `site_index` (sites, neighbours), −1 where there are fewer, at `site_offset` (sites,
    neighbours, coordinates), at the same place along the other axes and one step away. Offsets along those
    axes come first.
    """

    shape: tuple[int, ...]
    positions: tuple[np.ndarray, ...]
    steps: np.ndarray  # (neighbours, axes of the map), the nearest first, along the grid only
    site_axis: int | None
    site_index: np.ndarray
    site_offset: np.ndarray

    @property
    def fewest(self) -> int:
        """Fewest neighbours that make a plane: one for each of its coefficients on a grid, else two."""
        return max(len(self.positions) + 1, 2)

    @property
    def axes(self) -> int:
        """Number of coordinates of an offset."""
        return len(self.positions) + self.site_offset.shape[-1]

    def __call__(self, pixels: np.ndarray, present: np.ndarray) -> Near:
        """The neighbours of `pixels` (flat positions) through pixels that are `present` (flat map)."""
        where = np.stack(np.unravel_index(pixels, self.shape), axis=-1)[:, None, :]
        on_grid = self._at(where, where + self.steps, present)
        column = {tuple(step): i for i, step in enumerate(self.steps.tolist())}
        for i, step in enumerate(self.steps):
            if np.abs(step).sum() > 1:
                # a gap is not jumped: one of the pixels one step nearer must be linked, too
                axes = np.flatnonzero(step)
                nearer = [step - np.sign(step) * (np.arange(len(step)) == axis) for axis in axes]
                linked = [on_grid.linked[:, column[tuple(one.tolist())]] for one in nearer]
                on_grid.linked[:, i] &= np.any(linked, axis=0)
        parts = [on_grid]
        if self.site_axis is not None:
            site = where[:, 0, self.site_axis]
            for step in (0, *self.steps[np.abs(self.steps).sum(axis=1) == 1]):
                place = np.repeat(where + step, self.site_index.shape[1], axis=1)
                place[..., self.site_axis] = self.site_index[site]
                parts.append(self._at(where, place, present))
                parts[-1].offset[..., len(self.positions) :] = self.site_offset[site]
        return Near(*(np.concatenate(columns, axis=1) for columns in zip(*parts, strict=True)))

    def _at(self, where: np.ndarray, place: np.ndarray, present: np.ndarray) -> Near:
        """The pixels at places (pixels, neighbours, axes), with their offsets along the grid."""
        inside = np.all((place >= 0) & (place < self.shape), axis=-1)
        place = np.clip(place, 0, np.array(self.shape) - 1)
        index = np.asarray(np.ravel_multi_index(tuple(np.moveaxis(place, -1, 0)), self.shape))
        offset = np.zeros((*index.shape, self.axes))
        grid = [axis for axis in range(len(self.shape)) if axis != self.site_axis]
        for i, (axis, position) in enumerate(zip(grid, self.positions, strict=True)):
            offset[..., i] = position[place[..., axis]] - position[where[..., axis]]
        return Near(index, offset, inside & present[index])


def neighbourhood(
    shape: tuple[int, ...],
    positions: tuple[np.ndarray | None, ...],
    site_axis: int | None = None,
    coordinates: np.ndarray | None = None,
) -> Neighbourhood:
    """Return the neighbours on a grid: those at most two pixels away along each axis, corners left out.

    `positions` are coordinates along each axis of the grid, evenly spaced where None. Along `site_axis` there
    are sites at `coordinates` (sites, 1 or 2 or 3): a site has up to twelve neighbours, none farther than
    three times the usual distance of the nearest.
    """
    reach = [(0,) if axis == site_axis else range(-_REACH, _REACH + 1) for axis in range(len(shape))]
    every = np.array(list(itertools.product(*reach)), int)
    distance = np.abs(every).sum(axis=1)
    near = (distance > 0) & (distance <= _STEPS)
    steps = every[near][np.argsort(distance[near], kind="stable")]
    rest = [n for axis, n in enumerate(shape) if axis != site_axis]
    in_steps = tuple(map(_in_steps, positions, rest))
    if coordinates is None:
        return Neighbourhood(shape, in_steps, steps, None, np.empty((0, 0), int), np.empty((0, 0, 0)))
    from scipy.spatial import KDTree  # slow to import

    count = min(_SITES + 1, len(coordinates))
    distance, index = KDTree(coordinates).query(coordinates, k=count)
    distance, index = np.reshape(distance, (-1, count)), np.reshape(index, (-1, count))
    itself = index == np.arange(len(index))[:, None]
    apart = np.where(itself | (distance == 0), np.inf, distance).min(axis=1, initial=np.inf)
    usual = np.median(apart[np.isfinite(apart)]) if np.isfinite(apart).any() else 1.0
    site_index = np.where(~itself & (distance <= _FAR * usual), index, -1)
    offset = (coordinates[index] - coordinates[:, None]) / usual
    return Neighbourhood(shape, in_steps, steps, site_axis, site_index, offset)


def _in_steps(position: np.ndarray | None, size: int) -> np.ndarray:
    """Coordinates in units of their usual step; numbers of pixels where they do not rise or fall."""
    if position is not None and size > 1:
        step = np.diff(np.asarray(position, float))
        if np.all(step > 0) or np.all(step < 0):
            return np.asarray(position, float) / np.median(np.abs(step))
    return np.arange(size, dtype=float)


class Field(NamedTuple):
    """Thicknesses of a map, flat arrays (pixels,): nm, standard errors by the noise.

    `present` is False in gaps. `slope` (axes,) is the usual slope in nm per step along each axis and
    `roughness` the usual distance from a local plane in nm, at one step.
    """

    thickness: np.ndarray
    stderr: np.ndarray
    decided: np.ndarray
    present: np.ndarray
    slope: np.ndarray
    roughness: float


class Prediction(NamedTuple):
    """Thickness by a plane through decided neighbours: nm, its variance, and their number.

    The variance is infinite where the neighbours are too few, or do not lie on one plane.
    """

    thickness: np.ndarray
    variance: np.ndarray
    number: np.ndarray


class Choice(NamedTuple):
    """Orders chosen for undecided pixels: positions in their minima, −1 where none is clear.

    `number` is that of the neighbours at the time of the choice.
    """

    order: np.ndarray
    number: np.ndarray


def predict(field: Field, near: Neighbourhood, pixels: np.ndarray) -> Prediction:
    """Predict the thickness of `pixels` (flat positions) by a plane through their decided neighbours.

    The plane is the weighted least-squares one with a normal prior on its slopes. Neighbours off it are left
    out, and it predicts nothing where they are many.
    """
    parts = [_predict(field, near, pixels[i : i + _BATCH]) for i in range(0, len(pixels), _BATCH)]
    if not parts:
        return Prediction(np.empty(0), np.empty(0), np.empty(0, int))
    return Prediction(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))


def _predict(field: Field, near: Neighbourhood, pixels: np.ndarray) -> Prediction:
    around = near(pixels, field.present)
    used = around.linked & field.decided[around.pixel]
    number = used.sum(axis=1)
    offset = np.where(used[..., None], around.offset, 0.0)
    value = np.where(used, field.thickness[around.pixel], 0.0)
    level = value.sum(axis=1) / np.maximum(number, 1)
    value = np.where(used, value - level[:, None], 0.0)
    distance = np.sum(offset**2, axis=-1)
    variance = np.where(used, field.stderr[around.pixel] ** 2, 1.0) + field.roughness**2 * distance
    design = np.concatenate([np.ones((*used.shape, 1)), offset], axis=-1)
    prior = np.diag([1e-12, *field.slope**-2.0])

    def plane(weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Residuals in standard deviations and the plane's (value, variance) at the pixel."""
        normal = np.einsum("pni,pn,pnj->pij", design, weight, design) + prior
        right = np.einsum("pni,pn,pn->pi", design, weight, value)
        solved = np.linalg.solve(normal, np.stack([right, np.eye(near.axes + 1)[[0] * len(right)]], axis=-1))
        away = (value - np.einsum("pni,pi->pn", design, solved[..., 0])) / np.sqrt(variance)
        return np.where(used, away, 0.0), solved[:, 0, :]

    whole = used / variance
    away, _ = plane(whole)
    for _ in range(10):  # weights of the absolute deviation: steps of an order are many times their σ
        away, _ = plane(whole / np.maximum(np.abs(away), 1.0))
    off = np.abs(away) > _OUTLIER
    inner = np.where(off, 0.0, whole)
    away, solution = plane(inner)
    free = np.maximum((inner > 0).sum(axis=1) - near.axes - 1, 1)
    excess = np.maximum(np.sum(np.where(off, 0.0, away) ** 2, axis=1) / free, 1.0)
    number = number - off.sum(axis=1)
    enough = (number >= near.fewest) & (off.sum(axis=1) <= _OUTLIERS * used.sum(axis=1))
    spread = solution[:, 1] * excess + field.roughness**2
    return Prediction(solution[:, 0] + level, np.where(enough, spread, np.inf), number)


def field_of(
    thickness: np.ndarray,
    stderr: np.ndarray,
    decided: np.ndarray,
    present: np.ndarray,
    near: Neighbourhood,
) -> tuple[Field, float]:
    """The field of a map's decided pixels, with slope and roughness, and the share that is continuous.

    The slope is the 95 % quantile of differences of neighbours; the roughness is such that 95 % of the pixels
    lie within two standard deviations of the plane of their neighbours. The share counts pixels within five
    standard deviations of that plane, and those at an edge as discontinuous.
    """
    pixels = np.flatnonzero(decided)
    pixels = pixels[:: max(1, len(pixels) // _SAMPLE)]
    around = near(pixels, present)
    used = around.linked & decided[around.pixel]
    change = np.abs(thickness[around.pixel] - thickness[pixels][:, None])
    length = np.sqrt(np.sum(around.offset**2, axis=-1))
    slope = np.ones(near.axes)
    for axis in range(near.axes):
        along = used & (np.abs(around.offset[..., axis]) > 0.9 * length) & (length > 0)
        noise = stderr[pixels][:, None] * np.ones(along.shape)
        if along.any():
            rise = np.quantile(change[along] / length[along], 0.95)
            slope[axis] = max(rise, float(np.median(noise[along])), 1e-9)
    field = Field(thickness, stderr, decided, present, slope, 0.0)
    for _ in range(2):  # the weights of the plane depend on the roughness
        plane = predict(field, near, pixels)
        known = np.isfinite(plane.variance)
        if known.sum() < 2:
            return field, np.nan
        away = thickness[pixels] - plane.thickness
        variance = plane.variance - field.roughness**2 + stderr[pixels] ** 2
        excess = np.quantile(np.abs(away[known]), 0.95) ** 2 / 4 - np.median(variance[known])
        field = field._replace(roughness=float(np.sqrt(max(excess, 0.0))))
    plane = predict(field, near, pixels)
    spread = np.sqrt(plane.variance + stderr[pixels] ** 2)
    judged = plane.number >= near.fewest
    agrees = np.abs(thickness[pixels] - plane.thickness) <= _OUTLIER * spread
    return field, float(np.mean((agrees & np.isfinite(spread))[judged])) if judged.any() else np.nan


def grow(
    field: Field,
    near: Neighbourhood,
    pixels: np.ndarray,
    minima: np.ndarray,
    delta_chi2: np.ndarray,
    most: float,
) -> Choice:
    """Choose the orders of undecided `pixels` by their decided neighbours, from the regions' edges inwards.

    **Arguments:** `minima`, `delta_chi2` (pixels, orders): thicknesses in nm and how much worse they are,
    infinite where there is none or none may be chosen; `most` is the largest weight of the neighbours against
    Δχ². A choice continues the plane of the neighbours within five standard deviations, and is better than
    the next by 6, the Δχ² below which a fit is ambiguous.
    """
    thickness, stderr, decided = field.thickness.copy(), field.stderr, field.decided.copy()
    field = field._replace(thickness=thickness, decided=decided)
    count = len(pixels)
    order, number = np.full(count, -1), np.zeros(count, int)
    best, quality, seen = np.zeros(count, int), np.full(count, np.inf), np.zeros(count, int)
    row = np.full(len(thickness), -1, np.int32)
    row[pixels] = np.arange(count)
    stale = np.arange(count)
    complete = True  # all open pixels have been predicted since the last choice
    while True:
        if stale.size:
            plane = predict(field, near, pixels[stale])
            spread = plane.variance + stderr[pixels[stale]] ** 2
            best[stale], clear = _least(plane, spread, minima[stale], delta_chi2[stale], most)
            seen[stale], quality[stale] = plane.number, np.where(clear, spread, np.inf)
        ready = np.flatnonzero(np.isfinite(quality) & (order < 0))
        if not ready.size:
            if complete:
                return Choice(order, number)
            stale, complete = np.flatnonzero(order < 0), True
            continue
        taken = ready[quality[ready] <= np.median(quality[ready])]
        order[taken], number[taken] = best[taken], seen[taken]
        thickness[pixels[taken]] = minima[taken, best[taken]]
        decided[pixels[taken]] = True
        around = near(pixels[taken], field.present)
        touched = row[np.unique(around.pixel[around.linked])]
        touched = touched[touched >= 0]
        stale, complete = touched[order[touched] < 0], False


def _least(
    plane: Prediction, spread: np.ndarray, minima: np.ndarray, delta_chi2: np.ndarray, most: float
) -> tuple[np.ndarray, np.ndarray]:
    """The order of least energy of each pixel, and whether it is clear."""
    away = (minima - plane.thickness[:, None]) ** 2 / spread[:, None]
    energy = delta_chi2 + np.minimum(np.where(np.isfinite(away), away, 0.0), most)
    energy = np.where(np.isfinite(delta_chi2), energy, np.inf)
    ranked, choice = np.sort(energy, axis=1), np.argmin(energy, axis=1)
    with np.errstate(invalid="ignore"):
        lead = ranked[:, 1] - ranked[:, 0]
    clear = np.isfinite(spread) & np.isfinite(ranked[:, 0]) & (lead >= RIVAL)
    return choice, clear & (away[np.arange(len(choice)), choice] <= _OUTLIER**2)
