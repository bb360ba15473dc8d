"""Warp of the unit square by a bilinear density: first the marginal, then the conditional distribution.

The density is given at the nodes of a grid for each node of further parameters, between which it is
interpolated linearly. Its warp takes uniform points to points of that density, exactly and invertibly.

Source: J. Dupuy and W. Jakob, ACM TOG 37(6), 274 (2018), and the class Marginal2D of Mitsuba 3,
whose results it reproduces.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np


class Corners(NamedTuple):
    """Nodes around each point of a grid of parameters, (corners, N), and their weights."""

    node: np.ndarray
    weight: np.ndarray


def corners(axes: Sequence[np.ndarray], points: Sequence[np.ndarray]) -> Corners:
    """Return the nodes around `points` (N,) of a grid, as indices into its flattened nodes.

    Points outside take the edge; an axis of one node is constant.
    """
    index, weight = np.zeros((1, np.size(points[0])), dtype=np.int64), np.ones((1, np.size(points[0])))
    for axis, x in zip(axes, points, strict=True):
        nodes = np.asarray(axis, dtype=float)
        index = index * nodes.size
        if nodes.size == 1:
            continue
        cell = np.clip(np.searchsorted(nodes, x, side="left") - 1, 0, nodes.size - 2)
        share = np.clip((x - nodes[cell]) / (nodes[cell + 1] - nodes[cell]), 0.0, 1.0)
        index = np.concatenate([index + cell, index + cell + 1])
        weight = np.concatenate([weight * (1 - share), weight * share])
    return Corners(index, weight)


def interpolated(table: np.ndarray, around: Corners, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Interpolate a table (parameters, rows, columns, ...) at x along its columns and y along its rows."""
    column, fx = _cell(x, table.shape[2])
    row, fy = _cell(y, table.shape[1])
    total = np.zeros((x.size, *table.shape[3:]))
    for index, weight in zip(*around, strict=True):
        for dy, wy in ((0, 1 - fy), (1, fy)):
            for dx, wx in ((0, 1 - fx), (1, fx)):
                share = (weight * wy * wx).reshape(-1, *(1,) * (table.ndim - 3))
                total += share * table[index, row + dy, column + dx]
    return total


class BilinearWarp:
    """Warp by densities (parameters, rows, columns) over a unit square for each; x runs along the columns."""

    def __init__(self, density: np.ndarray) -> None:
        raw = np.array(density, dtype=float)
        _, self.rows, self.columns = raw.shape
        halves = 0.5 * (raw[:, :, 1:] + raw[:, :, :-1]) / (self.columns - 1)
        row_sums = halves.sum(axis=2)
        strips = 0.5 * (row_sums[:, 1:] + row_sums[:, :-1]) / (self.rows - 1)
        norm = 1 / strips.sum(axis=1)[:, None]
        self.density = raw * norm[:, :, None]
        self._across = _from_zero(halves * norm[:, :, None])  # integral up to each column, in each row
        self._along = _from_zero(strips * norm)  # integral up to each row

    def invert(self, around: Corners, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the uniform points (u, v) that the warp takes to (x, y); all of shape (N,)."""
        column, fx = _cell(np.clip(x, 0, 1), self.columns)
        row, fy = _cell(np.clip(y, 0, 1), self.rows)
        c0, c1 = (self._between_rows(self.density, around, row, fy, column + d) for d in (0, 1))
        u = self._between_rows(self._across, around, row, fy, column)
        u = u + fx * (c0 + 0.5 * fx * (c1 - c0)) / (self.columns - 1)
        r0, r1 = (_mix(self._across, around, row + d, self.columns - 1) for d in (0, 1))
        total = r0 + fy * (r1 - r0)
        v = _mix(self._along, around, row) + fy * (r0 + 0.5 * fy * (r1 - r0)) / (self.rows - 1)
        return u / np.where(total > 0, total, 1.0), v

    def sample(self, around: Corners, u: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the points (x, y) of uniform points (u, v); all of shape (N,)."""
        tiny = np.finfo(np.float32).eps / 2
        u, v = np.clip(u, tiny, 1 - tiny), np.clip(v, tiny, 1 - tiny)
        marginal = _mix(self._along, around)  # (N, rows)
        row = np.clip(np.sum(marginal[:, 1:] < v[:, None], axis=1), 0, self.rows - 2)
        below, above = (_mix(self._across, around, row + d) for d in (0, 1))  # (N, columns)
        low = np.take_along_axis(marginal, row[:, None], 1)[:, 0]
        fy = _within(v - low, self.rows - 1, below[:, -1], above[:, -1])
        conditional = below + fy[:, None] * (above - below)
        u = u * conditional[:, -1]
        column = np.clip(np.sum(conditional[:, 1:] < u[:, None], axis=1), 0, self.columns - 2)
        left = np.take_along_axis(conditional, column[:, None], 1)[:, 0]
        c0, c1 = (self._between_rows(self.density, around, row, fy, column + d) for d in (0, 1))
        fx = _within(u - left, self.columns - 1, c0, c1)
        return (column + fx) / (self.columns - 1), (row + fy) / (self.rows - 1)

    def _between_rows(
        self, table: np.ndarray, around: Corners, row: np.ndarray, share: np.ndarray, column: np.ndarray
    ) -> np.ndarray:
        low, high = (_mix(table, around, row + d, column) for d in (0, 1))
        return low + share * (high - low)


def _mix(table: np.ndarray, around: Corners, *entry: np.ndarray | int) -> np.ndarray:
    """Interpolate entries of a table over the parameters, (N, ...)."""
    entries = [(table[(node, *entry)], weight) for node, weight in zip(*around, strict=True)]
    return np.sum([one * w.reshape(-1, *(1,) * (one.ndim - 1)) for one, w in entries], axis=0)


def _from_zero(steps: np.ndarray) -> np.ndarray:
    return np.concatenate([np.zeros((*steps.shape[:-1], 1)), np.cumsum(steps, axis=-1)], axis=-1)


def _cell(coordinate: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    position = np.clip(coordinate, 0.0, 1.0) * (count - 1)
    cell = np.minimum(position.astype(np.int64), count - 2)
    return cell, position - cell


def _within(area: np.ndarray, cells: int, left: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Position in a cell below which a linear density from `left` to `right` has this area."""
    area = np.maximum(area, 0.0) * cells
    root = np.sqrt(np.maximum(left * left + 2 * area * (right - left), 0.0))
    sum_ = left + root  # 2 A/(l + √(l² + 2A(r − l))) has no cancellation
    return np.clip(np.where(sum_ > 0, 2 * area / np.where(sum_ > 0, sum_, 1.0), 0.5), 0.0, 1.0)
