"""Results that an earlier run of the same command left in a folder."""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from pellicle.files import MARKER
from pellicle.reporting.folders import FINGERPRINT, REPORT, SCENE
from pellicle.reporting.json_record import SCHEMA, versions


class Earlier(NamedTuple):
    """The JSON record of a fit that is in its folder, and its report."""

    record: dict[str, Any]
    report: str


def fingerprint(*parts: Any) -> str:
    """SHA-256 hash of pellicle's version and of `parts`: data, scenes and settings of a fit."""
    digest = hashlib.sha256()
    for part in _flat((versions()["pellicle"], *parts)):
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


def earlier(folder: Path, identity: str) -> Earlier | None:
    """The finished result of a fit with this fingerprint, None where the folder has none.

    A chain that was too short goes on, so its result does not count.
    """
    try:
        record = json.loads((folder / MARKER).read_text(encoding="utf-8"))
        report = (folder / REPORT).read_text(encoding="utf-8")
    except (OSError, ValueError):
        return None
    if not isinstance(record, dict) or record.get("schema") != SCHEMA or "data" not in record:
        return None
    record.pop(SCENE, None)  # printed by no fit
    if record.pop(FINGERPRINT, None) != identity or not record.get("posterior", {}).get("trusted", True):
        return None
    return Earlier(record, report)
