"""Zarr store of a map: made whole at the start, filled block by block, continued by a later run.

A block of pixels is one chunk of every variable. Which blocks are finished is kept in the store itself, in
the array `progress/done` with one file for each block, written after the data of the block. Zarr writes a
file under another name and renames it, so a process that is killed leaves no incomplete chunk, and a block
that was not marked is computed and written again.
"""

from __future__ import annotations

import os
import shutil
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pellicle.data.cube import Cube
from pellicle.errors import UsageError, install_command
from pellicle.files import not_written
from pellicle.fitting.parameter import Parameter
from pellicle.mapping.blocks import Blocks, blocks_of
from pellicle.mapping.pixels.results import CODES, NO_DATA, STATUSES, PixelFits

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
    "options": "was made with other options",
}
"""Messages on a store whose identity differs in one of its parts."""
STATUS = "status"
ORDER = "order"
"""Name of the axis of the minima of a pixel, best first."""


def zarr_package() -> Any:
    """Import zarr, which not every installation has: it belongs to the extra `maps`.

    **Raises:** UsageError where it is absent.
    """
    try:
        import zarr
    except ImportError:
        raise UsageError(f"maps of cubes need zarr: {install_command('maps')}") from None
    return zarr


@dataclass(frozen=True)
class Variable:
    """A variable of a map; `of` computes it from the fits of some pixels, with the axis of orders last.

    Values of pixels that are not fitted yet are `fill`.
    """

    name: str
    of: Callable[[PixelFits], np.ndarray]
    attributes: dict[str, Any]
    dtype: str = "float32"
    orders: bool = False
    fill: Any = np.nan


def variable_name(parameter: str) -> str:
    """The name of a parameter as a variable: `film.thickness` is `film_thickness`."""
    return parameter.replace(".", "_")


def variables(parameters: Sequence[Parameter]) -> list[Variable]:
    """List the variables of a map of these free parameters, in the order of the fits' arrays."""

    def about(words: str) -> dict[str, Any]:
        return {"long_name": words, "units": "1"}

    flags = {"flag_values": list(range(len(STATUSES))), "flag_meanings": " ".join(STATUSES)}
    status = {"long_name": "status of the fit", **flags}
    rival = about("delta chi2 of the best other minimum")
    orders = about("delta chi2 of each minimum")
    return [
        Variable(STATUS, lambda fits: fits.status, status, "uint8", fill=CODES[NO_DATA]),
        *(variable for i, parameter in enumerate(parameters) for variable in _of_parameter(i, parameter)),
        Variable("rival_delta_chi2", lambda fits: _finite(fits.delta_chi2[:, 1]), rival),
        Variable("order_delta_chi2", lambda fits: _finite(fits.delta_chi2), orders, orders=True),
        Variable("chi2_reduced", lambda fits: fits.chi2_reduced, about("reduced chi2")),
        Variable("rms", lambda fits: fits.rms, {"long_name": "root mean square of the residuals"}),
    ]


def _of_parameter(i: int, parameter: Parameter) -> list[Variable]:
    name, text = variable_name(parameter.name), parameter.name
    unit = {"degrees": "degree"}.get(parameter.unit, parameter.unit) or "1"

    def about(words: str) -> dict[str, Any]:
        return {"long_name": words, "units": unit}

    noise, whole = (f"standard error of {text}, of {part}" for part in ("the noise alone", "noise and model"))
    rival, orders = about(f"{text} of the best other minimum"), about(f"{text} of each minimum, best first")
    value = {**about(text), "parameter": text}
    return [
        Variable(name, lambda fits: fits.values[:, i], value, "float64"),
        Variable(f"{name}_stderr", lambda fits: fits.stderr[:, i], about(whole)),
        Variable(f"{name}_stderr_noise", lambda fits: fits.stderr_noise[:, i], about(noise)),
        Variable(f"rival_{name}", lambda fits: fits.minima[:, 1, i], rival),
        Variable(f"order_{name}", lambda fits: fits.minima[:, :, i], orders, orders=True),
    ]


def _finite(values: np.ndarray) -> np.ndarray:
    return np.where(np.isfinite(values), values, np.nan)


@dataclass(frozen=True)
class MapStore:
    """An open store: its `path`, its `blocks`, and the free `parameters` of the fits."""

    path: Path
    blocks: Blocks
    parameters: tuple[Parameter, ...]

    def write(self, place: tuple[int, ...], fits: PixelFits) -> None:
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

    **Raises:** UsageError where there is something else at `path`, or another process writes it.
    """
    target = Path(path).resolve()  # workers may have another working folder
    if target.exists():
        with held(target):
            if not overwrite:
                return _continued(target, cube, parameters, identity, resume=resume)
            _check_map(target)
            _remove(target)
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
    differs = next((words for key, words in _OTHERWISE.items() if stored.get(key) != identity[key]), "")
    if differs:
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


@contextmanager
def held(path: Path) -> Iterator[None]:
    """Hold the folder of a store for this process, until the block or the process ends.

    **Raises:** UsageError where another run holds it.
    """
    if os.name == "nt":  # folders cannot be locked there
        yield
        return
    import fcntl

    folder = os.open(path, os.O_RDONLY)
    try:
        try:
            fcntl.flock(folder, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise UsageError(
                f"{path}: another run is writing this map; wait for it, or choose another `out`"
            ) from None
        except OSError:  # a file system without locks
            pass
        yield
    finally:
        os.close(folder)


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


def _remove(target: Path) -> None:
    draft = _draft(target)
    target.rename(draft)  # at once: a half-removed store is never taken for a map
    shutil.rmtree(draft)


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
        group.create_array(
            name,
            # zarr 3 specifies texts of any length, and none of a fixed one
            data=values.astype(np.dtypes.StringDType()) if values.dtype.kind == "U" else values,
            dimension_names=_coordinate_dims(cube, name, values),
            attributes={"units": units} if units else {},
        )
    group.create_array(DONE, shape=blocks.grid, chunks=(1,) * len(blocks.grid), dtype="uint8", fill_value=0)
    with _quietly():
        zarr_package().consolidate_metadata(path)


def _coordinate_dims(cube: Cube, name: str, values: np.ndarray) -> tuple[str, ...]:
    """The axes of a coordinate: the one of its name, else the first of its length."""
    if values.ndim != 1:
        return cube.dims[: values.ndim]
    if name in cube.dims:
        return (name,)
    return (cube.dims[cube.shape.index(len(values))],)


@contextmanager
def _quietly() -> Iterator[None]:
    """Without zarr's warning that consolidated metadata are an extension of version 3."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Consolidated metadata")
        yield
