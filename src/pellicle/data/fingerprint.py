"""Fingerprint of data, scenes and settings: equal for equal content in every process."""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np


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
