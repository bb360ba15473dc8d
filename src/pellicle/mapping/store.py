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
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pellicle.data.cube import Cube
from pellicle.errors import UsageError, install_command
from pellicle.files import not_written
from pellicle.fitting.parameter import Parameter
from pellicle.mapping.blocks import Blocks, blocks_of
from pellicle.mapping.map_identity import difference
from pellicle.mapping.map_variables import ORDER, Variable, variables
from pellicle.mapping.pixels.results import PixelFits

if TYPE_CHECKING:
    from xarray import Dataset

IDENTITY, DONE = "pellicle_identity", "progress/done"


def zarr_package() -> Any:
    """Import zarr, which not every installation has: it belongs to the extra `maps`.

    **Raises:** UsageError where it is absent.
    """
    try:
        return import_module("zarr")
    except ImportError:
        raise UsageError(f"maps of cubes need zarr: {install_command('maps')}") from None


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
            for variable in self._variables:
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
    def _variables(self) -> list[Variable]:
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

    - `identity` of the map, as `map_identity.identity`; `attributes` of the dataset.
    - `orders`: number of minima of each pixel.
    - `resume`: continue a store of the same identity. `overwrite`: remove any store of a map at `path`.

    **Raises:** UsageError where there is something else at `path`.
    """
    target = Path(path).resolve()  # workers may have another working folder
    if target.exists():
        stored = _identity_at(target)
        if stored is None:
            raise UsageError(f"{target}: exists and is no map of pellicle; choose another `out`")
        differs = difference(stored, identity)
        if overwrite:
            _remove(target)
        elif differs:
            raise UsageError(
                f"{target}: {differs}, and cannot be continued; replace it with `overwrite=True`, or choose"
                " another `out`"
            )
        elif not resume:
            raise UsageError(
                f"{target}: exists; leave `resume=False` out to continue it, replace it with"
                " `overwrite=True`, or choose another `out`"
            )
        else:
            for stray in target.rglob("*.partial"):  # of a process that was killed while it wrote
                stray.unlink(missing_ok=True)
            size = tuple(zarr_package().open_group(target, mode="r", use_consolidated=False)["status"].chunks)  # pyright: ignore
            return MapStore(target, Blocks(cube.shape, size), tuple(parameters))
    store = MapStore(target, blocks_of(cube), tuple(parameters))
    draft = _draft(target)
    try:
        _make(draft, store, cube, {**attributes, IDENTITY: dict(identity)}, orders)
        draft.rename(target)
    except OSError as error:
        raise not_written(target, error) from None
    return store


def write_dataset(path: str | os.PathLike[str], dataset: Dataset) -> None:
    """Write a changed dataset of a map as a store of its own, whole or not at all.

    **Raises:** UsageError where something else than a map is at `path`.
    """
    target = Path(path).resolve()
    if target.exists() and _identity_at(target) is None:
        raise UsageError(f"{target}: exists and is no map of pellicle; choose another `out`")
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


def _identity_at(path: Path) -> dict[str, str] | None:
    """The identity of the map stored at `path`, None where there is none."""
    zarr = zarr_package()
    try:
        found: Any = zarr.open_group(path, mode="r", use_consolidated=False).attrs.get(IDENTITY)
    except (OSError, ValueError, KeyError):
        return None
    return dict(found) if isinstance(found, Mapping) else None


def _make(path: Path, store: MapStore, cube: Cube, attributes: Mapping[str, Any], orders: int) -> None:
    """Make all arrays of a store, without the values of pixels."""
    group = zarr_package().create_group(path, attributes=_attributes(cube, attributes))
    blocks = store.blocks
    for variable in store._variables:
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
            dimension_names=coordinate_dims(cube, name),
            attributes={"units": units} if units else {},
        )
    group.create_array(DONE, shape=blocks.grid, chunks=(1,) * len(blocks.grid), dtype="uint8", fill_value=0)
    with _quietly():
        zarr_package().consolidate_metadata(path)


def coordinate_dims(cube: Cube, name: str) -> tuple[str, ...]:
    """The axes of a coordinate: the one of its name, else the first of its length."""
    values = np.asarray(cube.coords[name])
    if name in cube.dims or values.ndim != 1:
        return (name,) if values.ndim == 1 else cube.dims[: values.ndim]
    lengths = zip(cube.dims, cube.shape, strict=True)
    return (next(dim for dim, n in lengths if n == len(values)),)


def _attributes(cube: Cube, attributes: Mapping[str, Any]) -> dict[str, Any]:
    others = [name for name in cube.coords if name not in cube.dims]
    known = {"coordinates": " ".join(others)} if others else {}
    return {"Conventions": "CF-1.11", **attributes, **known}


@contextmanager
def _quietly() -> Iterator[None]:
    """Without zarr's warning that consolidated metadata are an extension of version 3."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Consolidated metadata")
        yield
