"""Zarr store of a map: made whole at the start, filled block by block, continued by a later run.

A block of pixels is one chunk of every variable. Which blocks are finished is kept in the store itself, in
the array `progress/done` with one file for each block, written after the data of the block. Zarr writes a
file under another name and renames it, so a process that is killed leaves no incomplete chunk, and a block
that was not marked is computed and written again.
"""

from __future__ import annotations

import math
import os
import shutil
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING, Any

import numpy as np

from pellicle.data.cube import Cube
from pellicle.errors import UsageError, needs
from pellicle.files import not_written
from pellicle.fitting.batch.data import CODES, NO_DATA, STATUSES, BatchFits
from pellicle.fitting.parameter import Parameter

if TYPE_CHECKING:
    from xarray import Dataset

IDENTITY, DONE = "pellicle_identity", "progress/done"
FORMAT = "pellicle.map-store/1"
"""Version of the layout of a store."""
_OTHERWISE = {
    "format": "has the layout of another version of pellicle",
    "version": "was made by another version of pellicle",
    "input": "is of another input, or of one that was read otherwise",
    "scene": "is of another scene",
    "orders": "keeps another number of minima of each pixel",
}
"""Messages on a store whose identity differs in one of its parts."""
STATUS = "status"
ORDER = "order"
"""Name of the axis of the minima of a pixel, best first."""

BYTES = 64e6
"""Size of the measured values of a block in float64, at most: with the arrays of a fit a process then takes
less than 1 GB."""
PIXELS = 2**14
"""Pixels of a block, at most: a second of fits, which is what a killed process loses."""

_FILTERS = Lock()
"""Held while the filters of warnings differ: threads share them, and one would restore those of another."""

Where = tuple[slice, ...]
"""A block of pixels: one slice for each axis of pixels."""


def zarr_package() -> Any:
    """Import zarr, which not every installation has: it belongs to the extra `maps`.

    **Raises:** UsageError where it is absent.
    """
    with needs("maps", "maps of cubes need"):
        import zarr

        return zarr


@dataclass(frozen=True)
class Variable:
    """A variable of a map; `of` computes it from the fits of some pixels, with the axis of orders last.

    Values of pixels that are not fitted yet are `fill`.
    """

    name: str
    of: Callable[[BatchFits], np.ndarray]
    attributes: dict[str, Any]
    dtype: str = "float32"
    orders: bool = False
    fill: Any = np.nan


def variable_name(parameter: str) -> str:
    """The name of a parameter as a variable: `film.thickness` is `film_thickness`."""
    return parameter.replace(".", "_")


def variables(parameters: Sequence[Parameter]) -> list[Variable]:
    """List the variables of a map of these free parameters, in the order of the fits' arrays."""

    def about(words: str, unit: str = "1") -> dict[str, Any]:
        return {"long_name": words, "units": unit}

    def finite(values: np.ndarray) -> np.ndarray:
        return np.where(np.isfinite(values), values, np.nan)

    flags = {"flag_values": list(range(len(STATUSES))), "flag_meanings": " ".join(STATUSES)}
    status = {"long_name": "status of the fit", **flags}
    listed = [Variable(STATUS, lambda fits: fits.status, status, "uint8", fill=CODES[NO_DATA])]
    for i, parameter in enumerate(parameters):
        name, text = variable_name(parameter.name), parameter.name
        unit = {"degrees": "degree"}.get(parameter.unit, parameter.unit) or "1"
        noise = about(f"standard error of {text}, of the noise alone", unit)
        whole = about(f"standard error of {text}, of noise and model", unit)
        rival = about(f"{text} of the best other minimum", unit)
        orders = about(f"{text} of each minimum, best first", unit)
        value = {**about(text, unit), "parameter": text}
        listed += [
            Variable(name, lambda fits, i=i: fits.values[:, i], value, "float64"),
            Variable(f"{name}_stderr", lambda fits, i=i: fits.stderr[:, i], whole),
            Variable(f"{name}_stderr_noise", lambda fits, i=i: fits.stderr_noise[:, i], noise),
            Variable(f"rival_{name}", lambda fits, i=i: fits.minima[:, 1, i], rival),
            Variable(f"order_{name}", lambda fits, i=i: fits.minima[:, :, i], orders, orders=True),
        ]
    rival, orders = about("delta chi2 of the best other minimum"), about("delta chi2 of each minimum")
    return [
        *listed,
        Variable("rival_delta_chi2", lambda fits: finite(fits.delta_chi2[:, 1]), rival),
        Variable("order_delta_chi2", lambda fits: finite(fits.delta_chi2), orders, orders=True),
        Variable("chi2_reduced", lambda fits: fits.chi2_reduced, about("reduced chi2")),
        Variable("rms", lambda fits: fits.rms, {"long_name": "root mean square of the residuals"}),
    ]


@dataclass(frozen=True)
class Blocks:
    """A grid of blocks over the pixels of a cube: `shape` of the pixels and `size` of a block, per axis."""

    shape: tuple[int, ...]
    size: tuple[int, ...]

    @property
    def grid(self) -> tuple[int, ...]:
        """Number of blocks along each axis."""
        return tuple(math.ceil(n / size) for n, size in zip(self.shape, self.size, strict=True))

    def __iter__(self) -> Iterator[tuple[int, ...]]:
        """Places of all blocks in the grid, row by row."""
        return product(*map(range, self.grid))

    def where(self, place: tuple[int, ...]) -> Where:
        """The pixels of the block at a place in the grid."""
        parts = zip(place, self.size, self.shape, strict=True)
        return tuple(slice(i * size, min((i + 1) * size, n)) for i, size, n in parts)

    def count(self, place: tuple[int, ...]) -> int:
        """Number of pixels of a block."""
        return math.prod(part.stop - part.start for part in self.where(place))


def blocks_of(cube: Cube) -> Blocks:
    """Choose blocks of at most `BYTES` and `PIXELS`, whole chunks of the input where it has chunks.

    A block grows by doubling along the shorter of the last two axes (y and x), and along earlier ones (time)
    when these are covered. A chunk of the input that is larger than a block is divided.
    """
    arrays = sum(len(array.shape) > 1 for array in cube.arrays.values())
    most = max(1, min(PIXELS, int(BYTES / (8 * cube.points * arrays))))
    chunks = tuple(getattr(cube.arrays["values"], "chunks", None) or ())[: len(cube.dims)]
    # of a dask array, the sizes of all chunks along an axis
    chunks = [max(chunk) if isinstance(chunk, tuple) else int(chunk) for chunk in chunks]
    size = [min(chunk, n) for chunk, n in zip(chunks or [1] * len(cube.dims), cube.shape, strict=True)]
    while math.prod(size) > most:
        longest = size.index(max(size))
        size[longest] = math.ceil(size[longest] / 2)
    while short := [axis for axis, n in enumerate(cube.shape) if size[axis] < n]:
        image = [axis for axis in short if axis >= len(size) - 2]
        axis = min(image, key=size.__getitem__) if image else short[-1]
        longer = [*size]
        longer[axis] = min(2 * size[axis], cube.shape[axis])
        if math.prod(longer) > most:
            break
        size = longer
    return Blocks(cube.shape, tuple(size))


@dataclass(frozen=True)
class MapStore:
    """An open store: its `path`, its `blocks`, and the free `parameters` of the fits."""

    path: Path
    blocks: Blocks
    parameters: tuple[Parameter, ...]

    def write(self, place: tuple[int, ...], fits: BatchFits) -> None:
        """Write the fits of the block at a place of the grid, and mark it as finished.

        **Raises:** DataError for a full disk, UsageError where the store cannot be written.
        """
        where = self.blocks.where(place)
        shape = tuple(part.stop - part.start for part in where)
        try:
            for variable in self.variables:
                values = np.asarray(variable.of(fits), variable.dtype)
                self._group[variable.name][where] = values.reshape(*shape, *values.shape[1:])
            self._group[DONE][place] = 1
        except OSError as error:
            raise not_written(self.path, error) from None

    def unfinished(self) -> list[tuple[int, ...]]:
        """Places of the blocks that are not finished, row by row."""
        done = np.asarray(self._group[DONE][...])
        return [place for place in self.blocks if not done[place]]

    @cached_property
    def _group(self) -> Any:
        return zarr_package().open_group(self.path, mode="r+", use_consolidated=False)

    @cached_property
    def variables(self) -> list[Variable]:
        """Variables of the map."""
        return variables(self.parameters)

    def __getstate__(self) -> dict[str, Any]:
        return {name: vars(self)[name] for name in ("path", "blocks", "parameters")}


def begin(
    path: str | os.PathLike[str],
    cube: Cube,
    parameters: Sequence[Parameter],
    identity: Mapping[str, str],
    attributes: Mapping[str, Any],
    *,
    orders: int,
    resume: bool = True,
    overwrite: bool = False,
) -> MapStore:
    """Make the store of a map, or open the one that an earlier run of the same map began.

    **Arguments:**

    - `identity` of the map: hashes of what it is computed from; `attributes` of the dataset.
    - `orders`: number of minima of each pixel.
    - `resume`: continue a store of the same identity. `overwrite`: remove any store of a map at `path`.

    **Raises:** UsageError where there is something else at `path`. The caller holds it (`held`).
    """
    target = Path(path).resolve()  # workers may have another working folder
    if target.exists():
        if not overwrite:
            return _continued(target, cube, parameters, identity, resume=resume)
        _check_map(target)
        old = _draft(target)
        target.rename(old)  # at once: a half-removed store is never taken for a map
        shutil.rmtree(old)
    store = MapStore(target, blocks_of(cube), tuple(parameters))
    draft = _draft(target)
    try:
        _make(draft, store, cube, {**attributes, IDENTITY: dict(identity)}, orders)
        draft.rename(target)
    except OSError as error:
        raise not_written(target, error) from None
    return store


def _continued(
    target: Path, cube: Cube, parameters: Sequence[Parameter], identity: Mapping[str, str], *, resume: bool
) -> MapStore:
    """Open the store of the same map. Raises UsageError for another one, and without `resume`."""
    stored = _check_map(target)
    if differs := next((words for key, words in _OTHERWISE.items() if stored.get(key) != identity[key]), ""):
        raise UsageError(
            f"{target}: {differs}, and cannot be continued; replace it with `overwrite=True`, or choose"
            " another `out`"
        )
    if not resume:
        raise UsageError(
            f"{target}: exists; leave `resume=False` out to continue it, replace it with"
            " `overwrite=True`, or choose another `out`"
        )
    for stray in target.rglob("*.partial"):  # of a process that was killed while it wrote
        stray.unlink(missing_ok=True)
    status: Any = zarr_package().open_group(target, mode="r", use_consolidated=False)[STATUS]
    return MapStore(target, Blocks(cube.shape, tuple(status.chunks)), tuple(parameters))


def write_dataset(path: str | os.PathLike[str], dataset: Dataset) -> None:
    """Write a changed dataset of a map as a store of its own, whole or not at all.

    **Raises:** UsageError where something else than a map is at `path`.
    """
    target = Path(path).resolve()
    if target.exists():
        _check_map(target)
    draft = _draft(target)
    with _quietly():
        dataset.to_zarr(draft)
    if target.exists():
        shutil.rmtree(target)
    draft.rename(target)


def _draft(target: Path) -> Path:
    """The hidden folder in which a store is made and removed; what a killed process left there is removed."""
    draft = target.with_name(f".{target.name}.draft")
    if draft.exists():
        shutil.rmtree(draft)
    return draft


def _check_map(path: Path) -> dict[str, str]:
    """Return the identity of the map stored at `path`. Raises UsageError where there is none."""
    zarr = zarr_package()
    identity: Any = None
    with suppress(OSError, ValueError, KeyError):
        identity = zarr.open_group(path, mode="r", use_consolidated=False).attrs.get(IDENTITY)
    if not isinstance(identity, Mapping):
        raise UsageError(f"{path}: exists and is no map of pellicle; choose another `out`")
    return dict(identity)


def _make(path: Path, store: MapStore, cube: Cube, attributes: Mapping[str, Any], orders: int) -> None:
    """Make all arrays of a store, without the values of pixels."""
    others = " ".join(name for name in cube.coords if name not in cube.dims)
    known = {"Conventions": "CF-1.11", **attributes, **({"coordinates": others} if others else {})}
    group = zarr_package().create_group(path, attributes=known)
    blocks = store.blocks
    for variable in store.variables:
        axes = (orders,) * variable.orders
        group.create_array(
            variable.name,
            shape=(*blocks.shape, *axes),
            chunks=(*blocks.size, *axes),
            dtype=variable.dtype,
            fill_value=variable.fill,
            dimension_names=(*cube.dims, *(ORDER,) * variable.orders),
            attributes=variable.attributes,
        )
    for name, given in cube.coords.items():
        units, values = cube.units.get(name), np.asarray(given)
        axes = cube.dims[: values.ndim]
        if values.ndim == 1:  # along the axis of its name, else the first of its length
            axes = (name if name in cube.dims else cube.dims[cube.shape.index(len(values))],)
        group.create_array(
            name,
            # zarr 3 specifies texts of any length, and none of a fixed one
            data=values.astype(np.dtypes.StringDType()) if values.dtype.kind == "U" else values,
            dimension_names=axes,
            attributes={"units": units} if units else {},
        )
    group.create_array(DONE, shape=blocks.grid, chunks=(1,) * len(blocks.grid), dtype="uint8", fill_value=0)
    with _quietly():
        zarr_package().consolidate_metadata(path)


@contextmanager
def _quietly() -> Iterator[None]:
    """Without zarr's warning that consolidated metadata extend version 3, one thread at a time."""
    with _FILTERS, warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Consolidated metadata")
        yield
