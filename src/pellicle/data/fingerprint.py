"""Fingerprint of data, files, scenes and settings: equal for equal content in every process."""

import dataclasses
import hashlib
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

WHOLE = 64 * 2**20
"""Bytes up to which all of a content is read: a tenth of a second."""
_SAMPLES, _SAMPLE = 64, 2**16


def fingerprint(*parts: Any) -> str:
    """SHA-256 hash of everything that `parts` contain: data, scenes, mappings, arrays, plain values."""
    digest = hashlib.sha256()
    for part in _flat(parts):
        digest.update(b"%d:" % len(part) + part)
    return digest.hexdigest()


def _flat(value: Any) -> Iterator[bytes]:
    """Everything that a record, a mapping, a sequence, an array or a plain value contains."""
    if dataclasses.is_dataclass(value):
        yield type(value).__name__.encode()
        for field in dataclasses.fields(value):
            yield field.name.encode()
            yield from _flat(getattr(value, field.name))
    elif isinstance(value, Mapping | list | tuple):
        items = [x for item in value.items() for x in item] if isinstance(value, Mapping) else value
        yield b"%d items" % len(items)
        for item in items:
            yield from _flat(item)
    elif hasattr(value, "__array__"):
        array = np.asarray(value)
        yield f"{array.dtype} {array.shape}".encode()
        yield array.tobytes()
    else:
        yield repr(value).encode()


def file_fingerprint(files: Iterable[Path]) -> tuple[str, int]:
    """Hash the content of files and of the files in folders; returns the hash, and their size in bytes.

    Of more than `WHOLE` bytes, it covers size, date and 64 samples of each file; of a folder of more than 64
    files no samples.
    """
    members: list[tuple[str, Path]] = []
    for file in files:
        inside = sorted(f for f in file.rglob("*") if f.is_file())
        members += [(str(f.relative_to(file)), f) for f in inside] if file.is_dir() else [(file.name, file)]
    total = sum(file.stat().st_size for _, file in members)
    samples = _SAMPLES if len(members) <= _SAMPLES else 0
    return fingerprint([(name, _content(file, total <= WHOLE, samples)) for name, file in members]), total


def _content(file: Path, whole: bool, samples: int) -> str:
    """Hash of a whole file, or of its size, its date and so many samples."""
    with file.open("rb") as opened:
        if whole:
            return hashlib.file_digest(opened, "sha256").hexdigest()
        stat = file.stat()
        digest = hashlib.sha256(f"{stat.st_size} {stat.st_mtime_ns}".encode())
        for start in np.linspace(0, max(stat.st_size - _SAMPLE, 0), samples).astype(int):
            opened.seek(int(start))
            digest.update(opened.read(_SAMPLE))
        return digest.hexdigest()
