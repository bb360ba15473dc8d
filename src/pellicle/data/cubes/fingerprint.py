"""Digest of the content of a cube and of how it is read, by which an interrupted map is resumed."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from pellicle.data.cubes.raw_cube import RawCube
from pellicle.data.cubes.sampled_checks import sample_blocks

WHOLE = 64 * 2**20
"""Bytes up to which all of a content is read: a tenth of a second."""
_SAMPLES, _SAMPLE = 64, 2**16


def fingerprint(
    raw: RawCube, beside: Iterable[Path], facts: Mapping[str, Any], axes: Iterable[np.ndarray]
) -> tuple[str, str]:
    """Return the SHA-256 of a cube, and a note where it covers a sample of the content only.

    It covers shape, type and axes, `facts` (how it is read) and the content of the cube's files, or else of
    its arrays, and of the files `beside` it. Of more than 64 MB, it covers size, date and 64 samples of each
    file, or some blocks of pixels.
    """
    digest = hashlib.sha256()
    for name, value in sorted(facts.items()):
        digest.update(f"{name}={_text(value)};".encode())
    for name, stored in sorted(raw.arrays.items()):
        digest.update(f"{name} {stored.axes} {stored.data.shape} {stored.data.dtype};".encode())
    for axis in axes:
        digest.update(np.ascontiguousarray(axis, dtype=float).tobytes())
    members = [member for file in (*raw.files, *beside) for member in _members(file)]
    _add_files(digest, members)
    if raw.files:
        return digest.hexdigest(), _note(members)
    total = sum(int(np.prod(s.data.shape)) * np.dtype(s.data.dtype).itemsize for s in raw.arrays.values())
    for _, stored in sorted(raw.arrays.items()):
        # the name of a dask array is a digest of its graph, which may be long to compute
        graph = getattr(stored.data, "graph", "")
        digest.update(graph.encode())
        for where in _blocks(raw, stored.data.shape, stored.axes, bool(graph) or total > WHOLE):
            digest.update(np.ascontiguousarray(stored.read(where)).tobytes())
    return digest.hexdigest(), "" if total <= WHOLE else _sampled(total, "some blocks of pixels")


def _text(value: Any) -> str:
    """A fact as text: arrays by their content."""
    if isinstance(value, np.ndarray):
        return hashlib.sha256(np.ascontiguousarray(value).tobytes()).hexdigest()
    return repr(value)


def _blocks(
    raw: RawCube, shape: tuple[int, ...], axes: tuple[str, ...], part: bool
) -> list[dict[str, slice]]:
    """Blocks of an array to read: some of them, or all at once."""
    if not part:
        return [{}]
    dims = [axis for axis in axes if axis in raw.dims]
    sizes = tuple(shape[axes.index(axis)] for axis in dims)
    return [dict(zip(dims, where, strict=True)) for where in sample_blocks(sizes, 10**9)]


def _members(file: Path) -> list[tuple[str, Path]]:
    """A file, or those in a folder, by name."""
    if file.is_dir():
        return [(str(f.relative_to(file)), f) for f in sorted(file.rglob("*")) if f.is_file()]
    return [(file.name, file)]


def _add_files(digest: Any, members: list[tuple[str, Path]]) -> None:
    whole = sum(file.stat().st_size for _, file in members) <= WHOLE
    for name, file in members:
        digest.update(name.encode())
        if whole:
            digest.update(file.read_bytes())
            continue
        stat = file.stat()
        digest.update(f"{stat.st_size} {stat.st_mtime_ns}".encode())
        if len(members) > _SAMPLES:
            continue  # a store of many chunks: their names, sizes and dates
        with file.open("rb") as opened:
            for start in np.linspace(0, max(stat.st_size - _SAMPLE, 0), _SAMPLES).astype(int):
                opened.seek(int(start))
                digest.update(opened.read(_SAMPLE))


def _note(members: list[tuple[str, Path]]) -> str:
    total = sum(file.stat().st_size for _, file in members)
    return "" if total <= WHOLE else _sampled(total, "size, date and samples of its files")


def _sampled(total: int, by: str) -> str:
    return f"{total / 1e9:.2g} GB: a change of the content is recognised by {by}"
