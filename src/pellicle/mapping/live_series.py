"""Live series: each spectrum of a film that changes is fitted when its file arrives.

A spectrum is searched as a pixel of a map, over all thicknesses: what was fitted before only chooses among
its minima, so a film that jumps is not followed into a wrong order.
"""

from __future__ import annotations

from bisect import insort
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from pellicle.data.cube import Cube
from pellicle.data.cubes.time_series import BY_DATE, BY_HEADER, check_time_from, rows_on_grid
from pellicle.data.read_cube import check_signal, read_cube
from pellicle.errors import DataError, UsageError
from pellicle.fitting.batch.data import BY_NEIGHBOURS, ORDERS, STATUSES, BatchFits
from pellicle.fitting.batch.polish import FEW
from pellicle.fitting.film.parameters import parameters
from pellicle.fitting.result import Status
from pellicle.mapping.growth import TIME
from pellicle.mapping.order_path import SHORT, order_path
from pellicle.mapping.pixels import PixelModel, fit_pixels, prepare
from pellicle.mapping.series_result import SURE
from pellicle.scene.film import Scene
from pellicle.scene.instrument import Drift

_GRIDS = 4
"""Most grids of wavelengths, each with a model of its own, which takes seconds to prepare."""
_USABLE = str(Status.CONVERGED), BY_NEIGHBOURS


@dataclass(frozen=True)
class LiveFit:
    """Fit of one file: its name and size in bytes, time, and status; values and both errors of the
    parameters; `jump` where the film changed abruptly before it, and `error`, why it could not be fitted."""

    file: str
    size: int
    time: float = np.nan
    status: str = str(Status.FAILED)
    values: tuple[float, ...] = ()
    stderr: tuple[float, ...] = ()
    stderr_noise: tuple[float, ...] = ()
    rival_delta_chi2: float = np.nan
    chi2_reduced: float = np.nan
    rms: float = np.nan
    jump: bool = False
    error: str = ""


class _Minima(NamedTuple):
    """Thicknesses of the minima of one time, their Δχ² (minima,), the error by the noise, and the systematic
    one."""

    time: float
    thickness: np.ndarray
    delta: np.ndarray
    known: float
    systematic: float


def _systematic(stderr: float, noise: float) -> float:
    """The systematic part of a standard error, 0 where that is not known."""
    square = stderr**2 - noise**2
    return float(np.sqrt(max(square, 0.0))) if np.isfinite(square) else 0.0


def _time(minima: _Minima) -> float:
    return minima.time


class LiveSeries:
    """Fits of files as they arrive, in any order of their times: `fits` by name, `done` in this process,
    `failed` of these without a fit.

    **Arguments:** `scene`, with free parameters; `time_from` and `reading`, as `pellicle.read_cube` takes
    them. Times by dates count from the `origin`, that of the first file by default; `unit` is that of the
    times, by default of the first file.

    **Raises:** UsageError where nothing is free, and for a signal or source of times that there is not.
    """

    def __init__(
        self,
        scene: Scene,
        time_from: str | None = None,
        *,
        origin: float = np.nan,
        unit: str = "",
        **reading: Any,
    ):
        self.scene, self.parameters = scene, parameters(scene)
        if not self.parameters:
            raise UsageError("nothing varies in this series: free a thickness")
        check_signal(reading.get("signal"))
        if time_from is not None:
            check_time_from(time_from)
        uncalibrated = isinstance(scene.instrument.scale, Drift)
        self.reading: dict[str, Any] = {"calibrated": False} if uncalibrated else {}
        self.reading |= reading | {"time_from": time_from}
        self.origin = origin if time_from in (BY_DATE, BY_HEADER) else 0.0
        self.unit, self.done, self.failed = unit, 0, 0
        self.fits: dict[str, LiveFit] = {}
        self._latest: list[_Minima] = []
        self._models: list[tuple[Cube, PixelModel]] = []

    def restore(self, fits: Iterable[LiveFit]) -> None:
        """Take over the fits of an earlier run."""
        depth = next((i for i, p in enumerate(self.parameters) if p.key == "thickness"), None)
        for fit in fits:
            self.fits[fit.file] = fit
            if fit.status in _USABLE and depth is not None:
                thickness, delta = np.full((2, ORDERS), np.nan)
                thickness[0], delta[:] = fit.values[depth], np.inf
                delta[0] = 0.0
                known, whole = fit.stderr_noise[depth], fit.stderr[depth]
                minima = _Minima(fit.time, thickness, delta, known, _systematic(whole, known))
                insort(self._latest, minima, key=_time)
        del self._latest[:-SHORT]

    def fit(self, path: Path) -> LiveFit:
        """Fit a file; one that cannot be read or fitted has the status `failed`, and an `error`."""
        old = self.fits.pop(path.name, None)
        if old is not None:
            self._latest = [one for one in self._latest if one.time != old.time]
        size = 0
        try:
            size = path.stat().st_size
            made = self._fit(path, size)
        except (ValueError, OSError) as error:
            made = LiveFit(path.name, size, error=str(error).removeprefix(f"{path}: "))
        self.fits[path.name] = made
        self.done += 1
        self.failed += bool(made.error)
        return made

    def _fit(self, path: Path, size: int) -> LiveFit:
        cube = read_cube([path], **self.reading)
        if cube.dims != (TIME,) or cube.shape != (1,):
            raise DataError(f"{path}: holds {cube.shape[0]} spectra, and a watch takes files of one each")
        stamp, unit = float(cube.coords[TIME][0]), cube.units[TIME]
        if self.unit and unit != self.unit:
            raise DataError(f"{path}: its time is in {unit}, and others are in {self.unit}: use one unit")
        origin = stamp if np.isnan(self.origin) else self.origin
        time = stamp - origin
        if not np.isfinite(time):
            raise DataError(f"{path}: has no time: complete the table of times")
        if twice := next((fit.file for fit in self.fits.values() if fit.time == time), ""):
            raise DataError(f"{path}: has the time of {twice}, {time:g} {unit}: leave one of them out")
        cube, model = self._prepared(cube)
        fits = fit_pixels(model, cube, (slice(0, 1),))
        self.origin, self.unit = origin, unit
        return self._chosen(LiveFit(path.name, size, time), fits)

    def _prepared(self, cube: Cube) -> tuple[Cube, PixelModel]:
        """A cube on the wavelengths of an earlier one, and the model of these, or its own for a new grid.

        Raises DataError for another kind of data, and for yet another grid.
        """
        for grid, model in self._models:
            if (on_grid := _on_grid(cube, grid)) is not None:
                return on_grid, model
        if len(self._models) == _GRIDS:
            raise DataError(
                f"{cube.path}: its wavelengths differ from those of {self._models[0][0].path} and of"
                f" {_GRIDS - 1} other grids: give the instrument one grid, or use pellicle fit"
            )
        self._models.append((cube, prepare(cube, self.scene, rows=FEW)))
        return self._models[-1]

    def _chosen(self, made: LiveFit, fits: BatchFits) -> LiveFit:
        """The fit with the minimum that is its own best, or the one that continuity decides."""
        depth, status, order, jump = (
            self._models[0][1].problem.thickness_axis,
            STATUSES[fits.status[0]],
            0,
            False,
        )
        rival = float(fits.delta_chi2[0, 1])
        thickness = fits.minima[0, :, depth] if depth is not None else np.full(ORDERS, np.nan)
        delta = np.where(np.isfinite(thickness), fits.delta_chi2[0], np.inf)
        if depth is not None and np.isfinite(delta[0]):
            noise = float(fits.stderr_noise[0, depth])
            known = noise if np.isfinite(noise) else thickness[0]
            if status == str(Status.NOT_IDENTIFIABLE):  # there is only a limit
                known = max(known, thickness[0])
            systematic = _systematic(float(fits.stderr[0, depth]), noise)
            order, sure, jump = self._order(_Minima(made.time, thickness, delta, known, systematic))
            if status == str(Status.AMBIGUOUS) and sure > SURE:
                status, rival = BY_NEIGHBOURS, sure
            else:
                order = 0
        return replace(
            made,
            status=status,
            values=tuple(map(float, fits.minima[0, order])),
            stderr=tuple(map(float, fits.stderr[0])),
            stderr_noise=tuple(map(float, fits.stderr_noise[0])),
            rival_delta_chi2=rival if np.isfinite(rival) else np.nan,
            chi2_reduced=float(fits.chi2_reduced[0]),
            rms=float(fits.rms[0]),
            jump=jump and status in _USABLE,
        )

    def _order(self, minima: _Minima) -> tuple[int, float, bool]:
        """The minimum of a time that continues the times before it best, the Δχ² of the best path through
        another one, and whether the film jumped before it."""
        insort(self._latest, minima, key=_time)
        del self._latest[:-SHORT]
        at = next((i for i, one in enumerate(self._latest) if one is minima), -1)
        if at < 0 or len(self._latest) < 3:
            return 0, 0.0, False
        path = order_path(*map(np.array, zip(*self._latest, strict=True)))
        sure = path.rival > SURE
        jump = path.breaks[at] and sure[at] and sure[at - 1]
        return int(path.chosen[at]), float(path.rival[at]), bool(jump)


def _on_grid(cube: Cube, grid: Cube) -> Cube | None:
    """A cube on the wavelengths of another one, NaN where it has none, or None if it has others.

    Raises DataError for another kind of data.
    """
    kinds = [(one.signal, one.polarisation, sorted(one.arrays)) for one in (cube, grid)]
    if kinds[0] != kinds[1] or str(cube.angle) != str(grid.angle):
        raise DataError(
            f"{cube.path}: differs from {grid.path} in signal, polarisation, angle or stated errors: watch"
            " files of one kind"
        )
    try:
        at = rows_on_grid(cube.wavelength, grid.wavelength, cube.path, grid.path)
    except DataError:
        return None
    if at.size == grid.wavelength.size:
        return cube
    arrays = {}
    for name, values in cube.pixels((slice(0, 1),)).items():
        arrays[name] = np.full((1, grid.points), np.nan)
        arrays[name][:, at] = values
    return replace(grid, arrays=arrays)
