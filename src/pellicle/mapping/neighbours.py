"""Neighbours of pixels: windows on a grid of any number of axes, the nearest ones of scattered sites."""

import itertools
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

_REACH, _STEPS = 2, 3
"""Largest distance of a neighbour along one axis, and along all axes together, in pixels."""
_SITES, _FAR = 12, 3.0
"""Number of neighbours of a site, and their largest distance in units of the usual one."""


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
    offsets: np.ndarray  # (neighbours, axes of the grid), the nearest first
    site_axis: int | None = None
    site_index: np.ndarray | None = None
    site_offset: np.ndarray | None = None

    @property
    def fewest(self) -> int:
        """Fewest neighbours that make a plane: one for each of its coefficients on a grid, else two."""
        return max(len(self.positions) + 1, 2)

    @property
    def axes(self) -> int:
        """Number of coordinates of an offset."""
        return len(self.positions) + (0 if self.site_offset is None else self.site_offset.shape[-1])

    def __call__(self, pixels: np.ndarray, present: np.ndarray) -> Near:
        """The neighbours of `pixels` (flat positions) through pixels that are `present` (flat map)."""
        where = np.stack(np.unravel_index(pixels, self.shape), axis=-1)
        grid = [axis for axis in range(len(self.shape)) if axis != self.site_axis]
        step = np.zeros((len(self.offsets), len(self.shape)), int)
        step[:, grid] = self.offsets
        place, index, inside = self._index(where[:, None, :] + step)
        linked = inside & present[index]
        column = {tuple(offset): i for i, offset in enumerate(self.offsets.tolist())}
        for i, offset in enumerate(self.offsets):
            if np.abs(offset).sum() == 1:
                continue
            # a gap is not jumped: one of the pixels one step nearer must be linked, too
            nearer = [
                offset - np.sign(offset) * (np.arange(len(offset)) == a) for a in np.flatnonzero(offset)
            ]
            linked[:, i] &= np.any([linked[:, column[tuple(o.tolist())]] for o in nearer], axis=0)
        offset = np.zeros((*index.shape, self.axes))
        for a, (axis, position) in enumerate(zip(grid, self.positions, strict=True)):
            offset[..., a] = position[place[..., axis]] - position[where[:, None, axis]]
        parts = [Near(index, offset, linked)]
        if self.site_axis is not None:
            one_step = step[np.abs(step).sum(axis=1) == 1]
            parts += [self._beside(where, by, present) for by in (np.zeros_like(where[0]), *one_step)]
        return Near(*(np.concatenate(columns, axis=1) for columns in zip(*parts, strict=True)))

    def _beside(self, where: np.ndarray, by: np.ndarray, present: np.ndarray) -> Near:
        """The sites near those of pixels at `where`, `by` steps along the other axes."""
        assert self.site_index is not None
        assert self.site_offset is not None
        site = where[:, self.site_axis]
        beside = np.repeat(where[:, None, :] + by, self.site_index.shape[1], axis=1)
        beside[..., self.site_axis] = self.site_index[site]
        place, index, inside = self._index(beside)
        others = [axis for axis in range(len(self.shape)) if axis != self.site_axis]
        along = [
            np.broadcast_to(
                (position[place[..., axis]] - position[where[:, None, axis]])[..., None], (*index.shape, 1)
            )
            for axis, position in zip(others, self.positions, strict=True)
        ]
        offset = np.concatenate([*along, self.site_offset[site]], axis=-1)
        return Near(index, offset, inside & present[index])

    def _index(self, place: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Places (..., axes) moved into the map, their flat positions, and whether they were inside."""
        inside = np.all((place >= 0) & (place < self.shape), axis=-1)
        place = np.clip(place, 0, np.array(self.shape) - 1)
        return place, np.asarray(np.ravel_multi_index(tuple(np.moveaxis(place, -1, 0)), self.shape)), inside


def grid(shape: tuple[int, ...], positions: tuple[np.ndarray | None, ...] | None = None) -> Neighbourhood:
    """Neighbours on a grid: those at most two pixels away along each axis, corners left out.

    `positions` are coordinates along each axis, evenly spaced where None.
    """
    given = positions or (None,) * len(shape)
    return Neighbourhood(shape, tuple(map(_in_steps, given, shape)), _offsets(len(shape)))


def scattered(
    shape: tuple[int, ...],
    site_axis: int,
    coordinates: np.ndarray,
    positions: tuple[np.ndarray | None, ...] | None = None,
) -> Neighbourhood:
    """Neighbours of sites at `coordinates` (sites, 1 or 2 or 3), and along the other axes of a grid.

    A site has up to twelve neighbours, none farther than three times the usual distance of the nearest.
    """
    from scipy.spatial import KDTree  # slow to import

    count = min(_SITES + 1, len(coordinates))
    distance, index = KDTree(coordinates).query(coordinates, k=count)
    distance, index = np.reshape(distance, (-1, count)), np.reshape(index, (-1, count))
    itself = index == np.arange(len(index))[:, None]
    apart = np.where(itself | (distance == 0), np.inf, distance).min(axis=1, initial=np.inf)
    usual = np.median(apart[np.isfinite(apart)]) if np.isfinite(apart).any() else 1.0
    near = ~itself & (distance <= _FAR * usual)
    offset = (coordinates[index] - coordinates[:, None]) / usual
    rest = shape[:site_axis] + shape[site_axis + 1 :]
    given = positions or (None,) * len(rest)
    steps = tuple(map(_in_steps, given, rest))
    return Neighbourhood(shape, steps, _offsets(len(rest)), site_axis, np.where(near, index, -1), offset)


def _offsets(axes: int) -> np.ndarray:
    every = np.array(list(itertools.product(range(-_REACH, _REACH + 1), repeat=axes)), int)
    distance = np.abs(every).sum(axis=1)
    near = (distance > 0) & (distance <= _STEPS)
    return every[near][np.argsort(distance[near], kind="stable")]


def _in_steps(position: np.ndarray | None, size: int) -> np.ndarray:
    """Coordinates in units of their usual step; numbers of pixels where they do not rise or fall."""
    if position is None or size < 2:
        return np.arange(size, dtype=float)
    numbers = np.asarray(position, float)
    step = np.diff(numbers)
    if not (np.all(step > 0) or np.all(step < 0)):
        return np.arange(size, dtype=float)
    return numbers / np.median(np.abs(step))
