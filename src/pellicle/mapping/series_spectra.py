"""Spectra of a series around points: slopes, curvatures of their misfits, changes by systematic effects."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from pellicle.data.cube import Cube
from pellicle.fitting.batch import polish
from pellicle.fitting.batch.data import BatchData, batch_data
from pellicle.mapping.pixels import PixelModel

_MOST_RESPONSES = 8192
"""Times whose changes by systematic effects are computed."""
_BLOCK = 4096
"""Times that are linearised at once."""


class Spectra(NamedTuple):
    """The spectra of the times with data `used` (times,), and their model."""

    model: PixelModel
    cube: Cube
    used: np.ndarray

    def blocks(self) -> Iterator[tuple[slice, BatchData]]:
        """Some of the times, and their data."""
        for first in range(0, len(self.used), _BLOCK):
            which = self.used[first : first + _BLOCK]
            block = self.cube.pixels((slice(int(which[0]), int(which[-1]) + 1),))
            own = {name: rows[which - which[0]] for name, rows in block.items()}
            yield slice(first, first + _BLOCK), batch_data(own, self.model.problem.views[0].noise)

    def quadratic(self, units: np.ndarray) -> polish.Curved:
        """Slopes and curvatures of the misfits at points (times, parameters) of the unit cube."""
        static, common = self.model.search.static, self.model.search.common
        parts = [
            polish.in_rows(polish.curved, static, common, data, units[own]) for own, data in self.blocks()
        ]
        return polish.Curved(*(np.concatenate(column) for column in zip(*parts, strict=True)))

    def responses(self, units: np.ndarray) -> np.ndarray:
        """Changes (times, effects, parameters) by systematic effects, of the fits of each time alone.

        Those of a long series are interpolated between some of its times.
        """
        every = np.arange(len(self.used))
        at = every[:: -(-len(every) // _MOST_RESPONSES)]
        some = self._replace(used=self.used[at])
        changes = np.concatenate(
            [self.model.errors.responses(data, units[at][own]) for own, data in some.blocks()]
        )
        columns = [np.interp(every, at, column) for column in changes.reshape(len(at), -1).T]
        return np.array(columns).T.reshape(len(every), *changes.shape[1:])
