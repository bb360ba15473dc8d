"""Scores of verdicts against the truth."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from statistics import median
from typing import Any

FIRM = "converged"
"""Status of an answer that pellicle vouches for; every other one is a refusal."""
RIGHT = 0.01
"""Relative error of a thickness that is right."""
GROUPS = ("clean", "flawed", "budget-only", "hidden", "wrong", "undecidable", "brdf", "colour", "cause")


@dataclass(frozen=True)
class Answer:
    """Truth and pellicle's answer of one case; lengths in nm.

    `bound` is the Cramér-Rao bound of the noise alone, `evidence` the misfit of the flaw that residuals can
    show (see `detectability`), both of the independent model.
    """

    name: str
    group: str
    family: str
    kind: str
    sigma_given: bool
    truth: float
    value: float
    stderr: float
    stderr_noise: float
    status: str
    chi2_reduced: float
    rms: float
    bound: float
    evidence: float
    seconds: float
    detail: str
    verdict: str
    warnings: str = ""

    @property
    def firm(self) -> bool:
        return self.status == FIRM

    @property
    def relative(self) -> float:
        """Relative error of the thickness; infinite without an answer."""
        return abs(self.value / self.truth - 1) if math.isfinite(self.value) else math.inf

    def pull(self, stderr: float | None = None) -> float:
        """Error of the thickness in stated standard errors."""
        stated = self.stderr if stderr is None else stderr
        off = abs(self.value - self.truth)
        return off / stated if stated > 0 else math.inf

    @property
    def outcome(self) -> str:
        """`within 1`, `within 2`, `within 3` or `outside` if firm; else `refused right` or `refused off`."""
        if not self.firm:
            return "refused right" if self.relative < RIGHT else "refused off"
        pull = self.pull()
        return next((f"within {k}" for k in (1, 2, 3) if pull <= k), "outside")

    @property
    def failed(self) -> bool:
        """True for a verdict that should have been another one."""
        if self.group in ("wrong", "undecidable", "cause"):
            return self.firm
        if self.group == "clean":
            return not self.firm or self.outcome == "outside"
        if self.group in ("budget-only", "hidden", "brdf", "colour"):
            return self.outcome == "outside"
        return self.outcome in ("outside", "refused right")


def share(count: int, total: int) -> str:
    """`3 of 40 (7.5 %)`."""
    return f"{count} of {total}" + (f" ({100 * count / total:.1f} %)" if total else "")


def percent(values: Iterable[float]) -> str:
    """Median of relative numbers in percent, empty without any."""
    finite = [x for x in values if math.isfinite(x)]
    return f"{100 * median(finite):.3f} %" if finite else ""


HEADER = (
    "group",
    "σ",
    "cases",
    "firm, within 1",
    "within 2",
    "within 3",
    "firm, outside 3",
    "refused, right to 1 %",
    "refused, off",
    "median error",
    "median stated (firm)",
)


def table(answers: Sequence[Answer]) -> str:
    """Outcomes of each group, with σ given and not, as Markdown; `within` columns are cumulative."""
    lines = [HEADER, ("---",) * len(HEADER)]
    for group in GROUPS:
        for given in (True, False):
            some = [a for a in answers if a.group == group and a.sigma_given == given]
            if some:
                lines.append(_row(group, given, some))
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def _row(group: str, given: bool, some: Sequence[Answer]) -> tuple[str, ...]:
    firm = [a for a in some if a.firm]
    within = [sum(a.pull() <= k for a in firm) for k in (1, 2, 3)]
    outcomes = [a.outcome for a in some]
    return (
        group,
        "given" if given else "absent",
        str(len(some)),
        *map(str, within),
        *(str(outcomes.count(x)) for x in ("outside", "refused right", "refused off")),
        percent(a.relative for a in some),
        percent(a.stderr / a.truth for a in firm),
    )


def goals(answers: Sequence[Answer]) -> list[str]:
    """The required figures, each with what was found and whether it is met."""

    def of(group: str) -> list[Answer]:
        return [a for a in answers if a.group == group]

    lines: list[str] = []

    def limit(what: str, count: int, total: int, most: float) -> None:
        if total:
            met = "met" if count <= most * total else "MISSED"
            lines.append(f"{met}: {what}: {share(count, total)}, at most {100 * most:g} %")

    flawed, clean = of("flawed"), of("clean")
    firm, right = [a for a in flawed if a.firm], [a for a in flawed if a.relative < RIGHT]
    limit("flawed, firm outside three stated errors", sum(a.pull() > 3 for a in firm), len(firm), 0.02)
    limit("flawed, firm outside two stated errors", sum(a.pull() > 2 for a in firm), len(firm), 0.07)
    limit("flawed, refused of those right to 1 %", sum(not a.firm for a in right), len(right), 0.05)
    hidden = [a for a in of("hidden") if a.firm]
    limit(
        "hidden, firm outside three stated errors", sum(a.pull() > 3 for a in hidden), len(of("hidden")), 0.03
    )
    limit("wrong scenes, firm", sum(a.firm for a in of("wrong")), len(of("wrong")), 0.0)
    limit("undecidable, firm", sum(a.firm for a in of("undecidable")), len(of("undecidable")), 0.0)
    for group in ("brdf", "colour"):
        limit(
            f"{group}, firm outside three stated errors",
            sum(a.outcome == "outside" for a in of(group)),
            len(of(group)),
            0.02,
        )
    limit("clean, refused", sum(not a.firm for a in clean), len(clean), 0.0)
    return [*lines, *coverage(clean)]


def coverage(clean: Sequence[Answer]) -> list[str]:
    """How often the errors of the noise alone cover the truth, and their size beside the Cramér-Rao bound.

    Beside the number of cases stands the 95 % range of a correct error (normal approximation).
    """
    firm = [a for a in clean if a.firm]
    if not firm:
        return []
    lines = []
    for level, width in ((0.68, 0.9945), (0.95, 1.96)):
        inside = sum(a.pull(a.stderr_noise) <= width for a in firm)
        spread = 1.96 * math.sqrt(level * (1 - level) * len(firm))
        met = "met" if abs(inside - level * len(firm)) <= spread + 0.5 else "MISSED"
        expected = f"{level * len(firm):.0f} ± {spread:.0f} expected"
        covered = share(inside, len(firm))
        lines.append(f"{met}: clean, stderr_noise covers {100 * level:.0f} %: {covered}, {expected}")
    for given in (True, False):
        ratios = [a.stderr_noise / a.bound for a in firm if a.sigma_given == given and a.bound > 0]
        if ratios:
            word = "given" if given else "absent"
            lines.append(
                f"clean, σ {word}: stderr_noise over the Cramér-Rao bound: median {median(ratios):.2f},"
                f" {min(ratios):.2f} to {max(ratios):.2f}"
            )
    return lines


def failures(answers: Sequence[Answer]) -> str:
    """Every verdict that should have been another one, two lines each, in the order of the cases."""
    lines: list[str] = []
    for group in GROUPS:
        failed = [a for a in answers if a.group == group and a.failed]
        if failed:
            lines += ["", f"{group}: {len(failed)}"]
        for a in failed:
            lines.append(
                f"  {a.name} | {a.detail}: {a.outcome}; truth {a.truth:.6g}, answer {a.value:.6g}"
                f" ± {a.stderr:.2g} nm ({100 * a.relative:.2g} %), {a.status}, χ² {a.chi2_reduced:.3g},"
                f" rms {a.rms:.3g}, evidence {a.evidence:.3g}"
            )
            lines.append(f"    {a.verdict}")
    return "\n".join(lines)


def write_csv(answers: Sequence[Answer], path: Path) -> None:
    """Write every answer with its outcome."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, [*(f.name for f in fields(Answer)), "relative", "pull", "outcome"])
        writer.writeheader()
        for a in answers:
            derived = {"relative": a.relative, "pull": a.pull(), "outcome": a.outcome}
            writer.writerow(asdict(a) | derived)


def read_csv(path: Path) -> list[Answer]:
    """Read what `write_csv` wrote."""
    kinds: dict[str, Any] = {"float": float, "bool": "True".__eq__, "str": str}
    with path.open(newline="", encoding="utf-8") as file:
        return [
            Answer(**{f.name: kinds[str(f.type)](row[f.name]) for f in fields(Answer)})
            for row in csv.DictReader(file)
        ]


def changes(answers: Sequence[Answer], old: Sequence[Answer]) -> str:
    """Cases whose outcome is another one than before, and the clean errors relative to those of before."""
    before = {a.name: a for a in old}
    both = [(before[a.name], a) for a in answers if a.name in before]
    lines = [
        f"{past.outcome} → {a.outcome}: {a.name}: truth {a.truth:.6g}, {past.value:.6g} ± {past.stderr:.2g}"
        f" ({past.status}) → {a.value:.6g} ± {a.stderr:.2g} ({a.status})"
        for past, a in both
        if past.outcome != a.outcome
    ]
    lines.append(f"{len(lines)} of {len(both)} outcomes changed, {len(answers) - len(both)} cases are new")
    ratios = [
        a.stderr_noise / past.stderr_noise
        for past, a in both
        if a.group == "clean" and a.firm and past.firm and past.stderr_noise > 0
    ]
    if ratios:
        lines.append(f"clean: stderr_noise is {median(ratios):.2f} times the former one (median)")
    return "\n".join(lines)
