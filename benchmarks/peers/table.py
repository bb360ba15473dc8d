"""Errors of the packages' answers, as a Markdown table."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

WRONG = {"values": 5e-4, "slopes": 1e-2}
"""Errors above this are bold: the third decimal of R and T, the second digit of a derivative."""

Answers = Mapping[str, Mapping[str, Any]]
"""{case: {"values": {signal: numbers} or a reason, "slopes": ..., "warnings": [...]}}"""


def error(found: Mapping[str, Sequence[float]], truth: Mapping[str, Sequence[float]], kind: str) -> float:
    """Return the largest error over signals and parameters.

    It is absolute for values, and |g − g*|/(|g*| + 1e-3) for slopes.
    """
    worst = 0.0
    for signal in (s for s in truth if s in found):
        for one, other in zip(found[signal], truth[signal], strict=True):
            off = abs(one - other) / (1 if kind == "values" else abs(other) + 1e-3)
            if not math.isfinite(off):
                return math.nan
            worst = max(worst, off)
    return worst


def cell(answer: Mapping[str, Any], truth: Mapping[str, Any], kind: str) -> str:
    """Return one digit of the error, in bold if it is wrong, with a dagger if the package warned."""
    found = answer.get(kind)
    if found is None:
        return ""
    if isinstance(found, str):
        return f"**{found if len(found) < 12 else 'refuses'}**"
    off = error(found, truth[kind], kind)
    text = "nan" if math.isnan(off) else f"{off:.0e}" if off else "0"
    dagger = "†" if answer.get("warnings") else ""
    return (text if off <= WRONG[kind] else f"**{text}**") + dagger


def table(
    heads: Sequence[str], answers: Sequence[Answers], truths: Answers, kind: str, every_case: bool
) -> str:
    """Return a row for each case in which a package is wrong (or for every case), and their number."""
    columns = [(h, a) for h, a in zip(heads, answers, strict=True) if any(kind in x for x in a.values())]
    rows = {}
    for name in (n for n, truth in truths.items() if kind in truth):
        rows[name] = [cell(a.get(name, {}), truths[name], kind) for _, a in columns]
    wrong = [sum(row[i].startswith("**") for row in rows.values()) for i in range(len(columns))]
    kept = {name: row for name, row in rows.items() if every_case or any(x.startswith("**") for x in row)}
    lines = [["", *(h for h, _ in columns)], ["---"] * (len(columns) + 1)]
    lines += [[name, *row] for name, row in kept.items()]
    lines += [[f"**wrong of {len(rows)}**", *(str(n) for n in wrong)]]
    text = "\n".join("| " + " | ".join(line) + " |" for line in lines)
    rest = [name for name in rows if name not in kept]
    return text + (f"\n\nAll are correct in: {'; '.join(rest)}." if rest else "")
