"""Result of a map: thickness, errors and status of every pixel, in a zarr store."""

from __future__ import annotations

import os
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from pellicle.errors import DataError
from pellicle.files import replacing
from pellicle.fitting.batch.data import BY_NEIGHBOURS, CODES, NO_DATA, STATUSES
from pellicle.fitting.report_methods import PlotMixin
from pellicle.mapping.store import DONE, IDENTITY, STATUS, variable_name, write_dataset, zarr_package

if TYPE_CHECKING:
    import xarray

CONVERGED = "converged"
_IN_MEMORY = 256 * 2**20
"""Bytes up to which the variables of a map are no dask arrays."""


class Run(NamedTuple):
    """The computation of a map: pixels that were fitted, and those of an earlier run; processes; seconds of
    all of it, and of compilation in the process where that took longest."""

    pixels: int
    earlier: int
    workers: int
    seconds: float
    compiling: float


class Map(PlotMixin):
    """Thickness map of a cube.

    **Arguments:**

    - `path`: zarr store of a map, finished or not, of `pellicle.map` or `pellicle map`.
    - `run`: how it was computed, None for a map of an earlier run.

    **Raises:** DataError where there is no map at `path`; UsageError where zarr is not installed.

    ```python
    made = pl.Map("wafer/map.zarr")
    made.thickness.plot()
    ```
    """

    def __init__(self, path: str | os.PathLike[str], run: Run | None = None):
        self.path, self.run = Path(path), run
        zarr = zarr_package()
        try:
            self._group: Any = zarr.open_group(self.path, mode="r", use_consolidated=False)
            self._group.attrs[IDENTITY]
        except (OSError, ValueError, KeyError):
            raise DataError(f"{path}: holds no map of pellicle; give the folder map.zarr of one") from None

    def __repr__(self) -> str:
        shape = " x ".join(map(str, self.shape))
        share = f"{100 * self.converged:.3g} % converged" + ("" if self.finished else ", unfinished")
        return f"{self.input or self.path}: map of {shape} pixels, {share}"

    @cached_property
    def dataset(self) -> xarray.Dataset:
        """All variables as an xarray Dataset, read when they are needed: of a large map as dask arrays."""
        import xarray

        arrays = [array for _, array in self._group.arrays()]
        small = sum(array.nbytes for array in arrays) <= _IN_MEMORY  # dask and its scheduler load for 0.3 s
        return xarray.open_zarr(self.path, chunks=None if small else {})

    def __getitem__(self, name: str) -> xarray.DataArray:
        """A variable by its name, or the best values of a parameter by the parameter's name."""
        return self.dataset[variable_name(name)]

    @property
    def input(self) -> str:
        """Path of the cube, empty for one in memory."""
        return str(self._group.attrs["path"])

    @property
    def dims(self) -> tuple[str, ...]:
        """Names of the axes of pixels."""
        return tuple(self._group[STATUS].metadata.dimension_names)

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of pixels along each axis."""
        return tuple(self._group[STATUS].shape)

    @property
    def parameters(self) -> dict[str, str]:
        """Free parameters by name, with their units, in the order of the fit."""
        return dict(self._group.attrs["parameters"])

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences on how the input was read, and what was done with it."""
        return tuple(self._group.attrs["notes"])

    @property
    def finished(self) -> bool:
        """True where every block of pixels has been fitted."""
        return DONE not in self._group or bool(np.all(self._group[DONE][...]))

    @cached_property
    def status(self) -> dict[str, int]:
        """Number of pixels of each status that occurs, in the order of `pellicle.fit`'s rules."""
        array, counts = self._group[STATUS], np.zeros(len(STATUSES), int)
        rows = array.chunks[0]
        for start in range(0, array.shape[0], rows):
            counts += np.bincount(np.ravel(array[start : start + rows]), minlength=len(STATUSES))
        return {word: int(counts[code]) for word, code in CODES.items() if counts[code]}

    @property
    def converged(self) -> float:
        """Share of the pixels with data whose fit has converged, without help of neighbours."""
        known = sum(self.status.values()) - self.status.get(NO_DATA, 0)
        return self.status.get(CONVERGED, 0) / known if known else 0.0

    @property
    def decided(self) -> float:
        """Share of the pixels with data that have one answer, by themselves or by their neighbours."""
        known = sum(self.status.values()) - self.status.get(NO_DATA, 0)
        return (self.status.get(CONVERGED, 0) + self.status.get(BY_NEIGHBOURS, 0)) / known if known else 0.0

    @property
    def thickness(self) -> xarray.DataArray:
        """Thickness of each pixel in nm, of the first layer with a free one. Raises KeyError."""
        for name in self.parameters:
            if name.rpartition(".")[2] == "thickness":
                return self[name]
        raise KeyError("the map has no free thickness")

    def by_neighbours(self) -> Map:
        """Decide ambiguous pixels by the order of interference of their neighbours.

        The store of the result lies beside this one, with "-neighbours" in its name, and replaces an earlier
        one. Raises UsageError for a map without a free thickness.
        """
        from pellicle.mapping.continuity import decided_by_neighbours

        target = self.path.with_name(f"{self.path.stem}-neighbours{self.path.suffix}")
        write_dataset(target, decided_by_neighbours(self.dataset))
        return Map(target, self.run)

    def growth(self, *, window: int | None = None, unit: str | None = None) -> xarray.Dataset:
        """Rates of change of the thicknesses of a map with an axis of time, as of `pellicle.mapping.growth`.

        Only the new variables are returned.
        """
        from pellicle.mapping.growth import growth

        made = growth(self.dataset, window=window, unit=unit)
        rates = made[[name for name in made.data_vars if name not in self.dataset.data_vars]]
        rates.attrs = {name: made.attrs[name] for name in ("Conventions", "source", "path", "recipe")}
        return rates

    def to_netcdf(self, path: str | os.PathLike[str], *, overwrite: bool = False) -> None:
        """Write all variables to a NetCDF 4 file, block by block, complete or not at all.

        **Raises:** UsageError where `path` exists without `overwrite`, or cannot be written; DataError for a
        full disk.
        """
        from dask import config

        data = self.dataset.copy()
        data.attrs = {name: value for name, value in data.attrs.items() if name != IDENTITY}
        data.attrs["parameters"] = [f"{name} ({unit})" for name, unit in self.parameters.items()]
        flags = data[STATUS].attrs
        data[STATUS].attrs = flags | {"flag_values": np.asarray(flags["flag_values"], np.uint8)}
        for variable in data.variables.values():
            chunks = variable.encoding.get("chunks")
            variable.encoding = {"zlib": True, "complevel": 1, "shuffle": True} if variable.ndim else {}
            if chunks:
                variable.encoding["chunksizes"] = tuple(map(min, chunks, variable.shape))
        # in this thread: HDF5 writes one block at a time, and blocks that wait take memory
        with replacing(path, overwrite=overwrite) as draft, config.set(scheduler="synchronous"):
            data.to_netcdf(draft, engine="h5netcdf")
