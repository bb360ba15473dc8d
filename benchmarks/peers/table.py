"""From answers to errors to Markdown."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from cases import SIGNALS

WRONG = {"values": 5e-4, "slopes": 1e-2}
"""An error above this is set in bold: in the third decimal of R and T, in the second digit of a slope."""

Answers = Mapping[str, Mapping[str, Any]]
"""{case: {"values": {signal: numbers} or a reason, "slopes": ..., "warnings": [...]}}"""


def error(found: Mapping[str, Sequence[float]], truth: Mapping[str, Sequence[float]], kind: str) -> float:
    """The largest over signals and parameters: absolute for values, |g − g*|/(|g*| + 1e-3) for slopes."""
    worst = 0.0
    for signal in (s for s in SIGNALS if s in found):
        for one, other in zip(found[signal], truth[signal], strict=True):
            off = abs(one - other) / (1 if kind == "values" else abs(other) + 1e-3)
            if not math.isfinite(off):
                return math.nan
            worst = max(worst, off)
    return worst


def cell(answer: Mapping[str, Any], truth: Mapping[str, Any], kind: str) -> str:
    """One digit of the error, in bold where it is wrong; a dagger where the package warned."""
    found = answer.get(kind)
    if found is None:
        return ""
    if isinstance(found, str):
        return f"**{found if len(found) < 12 else 'refuses'}**"
    off = error(found, truth[kind], kind)
    text = "nan" if math.isnan(off) else f"{off:.0e}" if off else "0"
    dagger = "†" if answer.get("warnings") else ""
    return (text if off <= WRONG[kind] else f"**{text}**") + dagger


def table(heads: Sequence[str], answers: Sequence[Answers], truths: Answers, kind: str, whole: bool) -> str:
    """A row for each case in which somebody is wrong (each case if `whole`), then how many are."""
    columns = [(h, a) for h, a in zip(heads, answers, strict=True) if any(kind in x for x in a.values())]
    rows = {}
    for name in (n for n, truth in truths.items() if kind in truth):
        rows[name] = [cell(a.get(name, {}), truths[name], kind) for _, a in columns]
    wrong = [sum(row[i].startswith("**") for row in rows.values()) for i in range(len(columns))]
    kept = {name: row for name, row in rows.items() if whole or any(x.startswith("**") for x in row)}
    lines = [["", *(h for h, _ in columns)], ["---"] * (len(columns) + 1)]
    lines += [[name, *row] for name, row in kept.items()]
    lines += [[f"**wrong of {len(rows)}**", *(str(n) for n in wrong)]]
    text = "\n".join("| " + " | ".join(line) + " |" for line in lines)
    rest = [name for name in rows if name not in kept]
    return text + (f"\n\nAll are right in: {'; '.join(rest)}." if rest else "")
