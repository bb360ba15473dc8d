"""Results that an earlier run of the same command left in a folder."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, NamedTuple

from pellicle.data.fingerprint import fingerprint as content_fingerprint
from pellicle.files import MARKER
from pellicle.reporting.folders import FINGERPRINT, REPORT, SCENE
from pellicle.reporting.json_record import SCHEMA, versions


class Earlier(NamedTuple):
    """The JSON record of a fit that is in its folder, and its report."""

    record: dict[str, Any]
    report: str


def fingerprint(*parts: Any) -> str:
    """Hash of pellicle's version and of `parts`: data, scenes and settings of a fit."""
    return content_fingerprint(versions()["pellicle"], *parts)


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
