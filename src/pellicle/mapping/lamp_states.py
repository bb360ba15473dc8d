"""Level of the lamp and dark level as states of a series, which change with time as the thickness does.

A fit of one spectrum solves its free gain and offset exactly, and has the misfit with these eliminated. With
them again the misfits of all times go to the smoother, which knows that they change slowly.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from pellicle.errors import UsageError
from pellicle.fitting.batch import polish
from pellicle.fitting.film.view import Local
from pellicle.mapping.growth import TIME
from pellicle.mapping.pixels import PixelModel
from pellicle.mapping.series_result import ERRORS
from pellicle.mapping.series_spectra import Spectra
from pellicle.mapping.state_space import Smoothed
from pellicle.scene.free import FREELY, SHARED
from pellicle.scene.instrument import Drift

_RANGE = 2.0
"""Range of a state, in units of the level: a gain of the lamp, or the light itself."""


class _Linear(NamedTuple):
    """Models of some times `at` points, square roots of the weights (times, points) of the data, weighted
    slopes (times, points, parameters and states), and the best states (times, states) there."""

    at: polish.Best
    weight: np.ndarray
    slope: np.ndarray
    states: np.ndarray


class LampStates(NamedTuple):
    """Gain and offset that are states: their `names`, kinds of change, and the sizes of their ranges."""

    names: tuple[str, ...]
    kinds: tuple[str, ...]
    sizes: np.ndarray

    def column(self, name: str, data: Any, signal: np.ndarray) -> np.ndarray:
        """Slope of the light (times, points) by a state, in its range; 0 where nothing was measured."""
        known = data.weight > 0
        return self.sizes[self.names.index(name)] * np.where(known, signal if name == "scale" else 1.0, 0.0)

    def beside(
        self, spectra: Spectra, units: np.ndarray, curved: polish.Curved
    ) -> tuple[polish.Curved, np.ndarray]:
        """Misfits with these states, from those without (of points `units`), and the best states of each time
        (times, states)."""
        if not self.names:
            return curved, np.zeros((len(units), 0))
        gradients, hessians, best = [], [], []
        for own, data in spectra.blocks():
            _, _, slope, states = self._linear(spectra.model, data, units[own])
            own_size = units.shape[1]
            square = np.einsum("tpi,tpj->tij", slope, slope)
            cross, states_square = square[:, :own_size, own_size:], square[:, own_size:, own_size:]
            inverse = np.linalg.pinv(states_square, hermitian=True)
            # what the elimination took away
            square[:, :own_size, :own_size] = curved.hessian[own] + cross @ inverse @ cross.transpose(0, 2, 1)
            hessians.append(square)
            gradients.append(np.pad(curved.gradient[own], [(0, 0), (0, len(self.names))]))
            best.append(states)
        return polish.Curved(np.concatenate(gradients), np.concatenate(hessians)), np.concatenate(best)

    def _linear(self, model: PixelModel, data: Any, units: np.ndarray) -> _Linear:
        """The light around the points `units` (times, parameters)."""
        search = model.search
        at = polish.in_rows(polish.at_best, search.static, search.common, data, units)
        span = np.array([p.upper - p.lower for p in model.parameters])
        weight = data.weight * np.sqrt(np.asarray(search.common.data.independent_fraction))
        own = np.asarray(at.gain)[..., None] * np.asarray(at.slope) * span
        columns = [self.column(name, data, np.asarray(at.signal)) for name in self.names]
        slope = np.concatenate([own, np.stack(columns, axis=2)], axis=2) * weight[..., None]
        best = [np.asarray(at.gain if name == "scale" else at.offset)[:, 0] for name in self.names]
        return _Linear(at, weight, slope, np.stack(best, axis=1) / self.sizes)

    def pushes(self, spectra: Spectra, units: np.ndarray, share: np.ndarray) -> np.ndarray:
        """Changes (times, parameters and states, effects) of the misfits' slopes by systematic effects, each
        multiplied by the `share` (times,)."""
        model, found, none = spectra.model, [], np.zeros(0)
        lower, upper = (np.array([getattr(p, side) for p in model.parameters]) for side in ("lower", "upper"))
        for own, data in spectra.blocks():
            best, weight, slope, _ = self._linear(model, data, units[own])
            names = "signal", "slope", "model", "gain", "offset"
            curves = {name: np.asarray(getattr(best, name)) for name in names}
            at = Local(**curves, layer=none, layer_slope=none)
            values = lower + units[own] * (upper - lower)
            effects = model.errors.effects.changes(model.search.view, at, values)
            changes = [np.asarray(x.change).reshape(len(slope), -1) * weight for x in effects]
            pushed = [np.einsum("tpi,tp->ti", slope, change) for change in changes]
            found.append(np.stack([*pushed, *np.zeros((0, *slope.shape[::2]))], axis=2))
        return np.concatenate(found) * share[:, None, None]

    def variables(self, smoothed: Smoothed, used: np.ndarray, count: int) -> dict[str, tuple[Any, ...]]:
        """The states, the last of the smoothed parameters, with both errors, as variables of a dataset."""
        found: dict[str, tuple[Any, ...]] = {}
        first = smoothed.mean.shape[1] - len(self.names)
        for i, (name, kind, size) in enumerate(zip(self.names, self.kinds, self.sizes, strict=True), first):
            noise, common = smoothed.variance[:, i], smoothed.systematic[:, i]
            columns = smoothed.mean[:, i], np.sqrt(noise + common), np.sqrt(noise)
            about = {"long_name": name, "units": "1"}
            for end, column in zip(ERRORS, columns, strict=True):
                whole = np.full(count, np.nan)
                whole[used] = size * column
                found[f"{name}{end}"] = (
                    ((), whole[used[-1]], about) if kind == SHARED else (TIME, whole, about)
                )
        return found


def lamp_states(model: PixelModel, spectra: Spectra, units: np.ndarray) -> LampStates:
    """The states of a scene's instrument, none where no gain or offset varies as one.

    **Raises:** UsageError beside a gain or an offset that is a curve of the wavelength.
    """
    both = {name: getattr(model.scene.instrument, name) for name in ("scale", "offset")}
    free = {name: x for name, x in both.items() if isinstance(x, Drift)}
    if all(x.varies in (None, FREELY) for x in free.values()):
        return LampStates((), (), np.zeros(0))
    if curve := next((name for name, x in free.items() if x.degree), ""):
        raise UsageError(f'`{curve}` is a curve of the wavelength, which cannot vary in time: write "free"')
    _, data = next(spectra.blocks())
    search = model.search
    at = polish.in_rows(polish.at_best, search.static, search.common, data, units[: len(data.weight)])
    sizes = [np.median(at.gain), np.median(data.level)]
    sizes = [_RANGE * abs(float(x)) for x, name in zip(sizes, both, strict=True) if name in free]
    return LampStates(tuple(free), tuple(x.varies or FREELY for x in free.values()), np.array(sizes))
