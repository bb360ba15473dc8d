"""Scores of identifications against the truth."""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass, fields
from itertools import pairwise
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
from nested import STRONG
from suite import Case

LEAST = 10.0
"""Layers thinner than this (nm) count as faces: native oxides, roughness, contamination."""
SAME_INDEX, SAME_DEPTH, ERRORS = 0.025, 0.03, 3.0
"""Relative difference of the mean index and of the thickness, or its standard errors, of one layer."""
FILMS = ("one film", "clean", "two layers", "there", "not there")
"""Groups of samples with films, of which all is stated rightly."""


@dataclass(frozen=True)
class Answer:
    """Answer of one case: `outcome` is "right", "listed", "wrong" (identified, and not so), "missed" or
    "silent" (undecided without the truth, and none); `close` is true where the answer leaves residuals of the
    noise only, so that nothing in the data contradicts it."""

    name: str
    group: str
    status: str
    outcome: str
    layers_right: bool
    films: int
    close: bool
    truth: str
    answer: str
    verdict: str
    seconds: float
    gain: float
    """ln Z of two true layers less that of the best one film, where it was computed."""
    probability: float = np.nan
    """Probability of the best film under all its names, and of what it matches of the truth."""
    best_right: bool = False
    reason: str = ""
    """Reason for which the answer is not right, empty where it is."""


def truth_of(case: Case) -> str:
    """The sample in words."""
    nm = case.view.nm
    layers = [
        f"{x.material} {x.thickness:.0f} nm n {np.mean(np.real(x.index(nm))):.3f}"
        for x in case.specimen.layers
    ]
    return ", ".join([*layers, f"on {case.specimen.substrate}"])


def thick(hypothesis: Any) -> list[Any]:
    """Layers of a hypothesis that are no faces; a bare substrate has none, however thick its oxide may be."""
    if hypothesis.name == "bare substrate":
        return []
    return [layer for layer in hypothesis.layers if layer.thickness.value > LEAST]


def films(case: Case, same: float = SAME_INDEX) -> list[tuple[float, float]]:
    """Mean index and thickness of the films of a sample: neighbours of nearly one index are one."""
    found: list[tuple[float, float]] = []
    for layer in case.specimen.layers:
        n, depth = float(np.mean(np.real(layer.index(case.view.nm)))), layer.thickness
        if depth <= LEAST:
            continue
        if found and abs(found[-1][0] / n - 1) < same:
            above, upper = found.pop()
            n, depth = (above * upper + n * depth) / (upper + depth), upper + depth
        found.append((n, depth))
    return found


def matches(case: Case, hypothesis: Any) -> bool:
    """True where a hypothesis has the layers of the truth, or its films, with their index and thickness."""
    return any(_matches(case, films(case, same), hypothesis) for same in (0.0, SAME_INDEX))


def _matches(case: Case, every: list[tuple[float, float]], hypothesis: Any) -> bool:
    supposed, flaws = thick(hypothesis), case.specimen.flaws
    if len(every) != len(supposed):
        return False
    for (n, thickness), own in zip(every, supposed, strict=True):
        low, high = own.n
        # the mean lies between the least and the largest index
        off = max(low - n, n - high, 0.0) / n
        depth, error = own.thickness.value, own.thickness.stderr
        near = max(SAME_DEPTH * thickness, ERRORS * (error if np.isfinite(error) else 0.0), 2.0)
        near += flaws.carbon + flaws.rough / 2  # which may count as a part of the film
        if off > SAME_INDEX or abs(depth - thickness) > near:
            return False
    return True


def score(case: Case, found: Any) -> tuple[str, bool]:
    """Outcome of an identification, and whether its best hypothesis has the right number of layers."""
    status, hypotheses = str(found.status), list(found.hypotheses)
    count = len(films(case))
    layers = bool(hypotheses) and len(thick(hypotheses[0])) == count
    right = [matches(case, x) for x in hypotheses]
    if case.expected == "mistake":
        # what the mistake does not touch may be right
        return ("wrong" if status == "identified" and not right[0] else "right"), layers
    if status == "identified":
        return ("right" if right[:1] == [True] else "wrong"), layers
    return ("listed" if any(right) else "missed" if status == "undecided" else "silent"), layers


def best_film(case: Case, found: Any) -> tuple[float, bool]:
    """Probability of the best hypothesis and of others with its layers, and whether one is the truth."""
    best, *others = found.hypotheses
    alike = [best, *(x for x in others if _one_film(best, x))]
    return sum(x.probability for x in alike), any(matches(case, x) for x in alike)


def reason(case: Case, found: Any, outcome: str) -> str:
    """Reason for which an identification is not right, without its numbers; empty where it is."""
    right = [matches(case, x) for x in found.hypotheses]
    if outcome in ("right", "wrong") or not right:
        return {"right": "", "wrong": "identified, wrongly"}.get(outcome, "nothing describes the data")
    if found.hypotheses[0].condition:
        return "described with a mistake, unusual errors or an odd index alone"
    if "do not decide between" not in found.verdict:
        why = found.verdict.partition("is not certain, as ")[2].partition(":")[0]
        return f"one answer: {re.sub(r'[0-9.]+', '…', why)}"
    if any(right) and not all(right):
        # odds of 20 to 1, with which one film is identified
        best, other = (
            max(x.ln_z for x, y in zip(found.hypotheses, right, strict=True) if y == z) for z in (True, False)
        )
        return (
            "several films: the data favour the truth"
            if best > other + 3
            else "several films: another is as probable as the truth"
        )
    return (
        "several films, all of them the truth" if all(right) else "several films: the truth is none of them"
    )


def reasons(answers: Sequence[Answer]) -> str:
    """Numbers of samples with films that are not answered rightly, by reason and by signal, in Markdown."""
    lines = ["| not right, as | R or T | ψ and Δ |", "|---|---|---|"]
    missed = [x for x in answers if x.reason and x.group in FILMS]
    for why, _ in Counter(x.reason for x in missed).most_common():
        own = ["psi-delta" in x.name for x in missed if x.reason == why]
        lines.append(f"| {why} | {len(own) - sum(own)} | {sum(own)} |")
    return "\n".join(lines)


def _one_film(a: Any, b: Any) -> bool:
    pairs = list(zip(thick(a), thick(b), strict=False))
    return len(thick(a)) == len(thick(b)) and all(
        abs(np.mean(x.n) / np.mean(y.n) - 1) < 2 * SAME_INDEX
        and abs(x.thickness.value - y.thickness.value)
        < ERRORS * np.hypot(*(min(z.thickness.stderr, 0.1 * z.thickness.value) for z in (x, y)))
        for x, y in pairs
    )


def reliability(answers: Sequence[Answer]) -> str:
    """Stated probabilities of the best film against the share of them that is right, in Markdown."""
    edges = [0.0, 0.5, 0.8, 0.95, 0.99, 1.0 + 1e-9]
    known = [x for x in answers if np.isfinite(x.probability) and not x.group.startswith("wrong ")]
    lines = ["| probability of the best film | cases | mean | right |", "|---|---|---|---|"]
    for low, high in pairwise(edges):
        own = [x for x in known if low <= x.probability < high]
        if own:
            mean, right = np.mean([x.probability for x in own]), np.mean([x.best_right for x in own])
            lines.append(f"| {low:g} to {min(high, 1):g} | {len(own)} | {mean:.2f} | {right:.2f} |")
    return "\n".join(lines)


def described(found: Any) -> str:
    """The best hypotheses in words."""
    words = []
    for x in list(found.hypotheses)[:3]:
        layers = [
            f"{layer.material} {layer.thickness.value:.1f}±{layer.thickness.stderr:.1f} n"
            f" {layer.n[0]:.3f}-{layer.n[1]:.3f}"
            for layer in x.layers
        ]
        words.append(f"{' / '.join(layers) or 'bare'} (remaining {x.remaining:.2f})")
    return "; ".join(words)


def table(answers: Sequence[Answer]) -> str:
    """Outcomes by group, in Markdown."""
    heads = ("right", "listed", "wrong", "missed", "silent")
    columns = ("right", "undecided, truth listed", "confidently wrong", "undecided, truth not listed", "none")
    lines = [f"| group | cases | {' | '.join(columns)} | median s |", "|---" * 8 + "|"]
    groups = list(dict.fromkeys(x.group for x in answers))
    for group in [*groups, "all"]:
        own = [x for x in answers if group in (x.group, "all")]
        counts = [sum(x.outcome == head for x in own) for head in heads]
        seconds = median(x.seconds for x in own)
        lines.append(f"| {group} | {len(own)} | {' | '.join(map(str, counts))} | {seconds:.1f} |")
    return "\n".join(lines)


def goals(answers: Sequence[Answer]) -> list[str]:
    """The figures that are required, with those of this run."""

    def share(kept: Iterable[Answer], wanted: Callable[[Answer], bool]) -> str:
        every = list(kept)
        hits = sum(map(wanted, every))
        return f"{hits} of {len(every)} ({100 * hits / max(len(every), 1):.0f} %)"

    films = [x for x in answers if x.group in FILMS]
    # a layer of its neighbour's index is none to be found, nor one that the data do not need
    there = [x for x in answers if x.group == "there" and x.films > 1]
    strong = [x for x in there if x.gain > STRONG]
    weak = [x for x in there if x.gain <= STRONG]
    group = {name: [x for x in answers if x.group == name] for name in ("not there", "clean")}
    mistakes = [x for x in answers if x.group.startswith("wrong ")]

    def wrong(x: Answer) -> bool:
        return x.outcome == "wrong"

    return [
        f"confidently wrong: {share(answers, wrong)}; goal 3 %",
        f"of these the data contradict: {share(answers, lambda x: wrong(x) and not x.close)}; goal 1 %",
        f"right: {share(films, lambda x: x.outcome == 'right')}; goal 65 %",
        f"right or listed: {share(films, lambda x: x.outcome in ('right', 'listed'))}; goal 90 %",
        f"a layer that is not there: {share(group['not there'], lambda x: wrong(x) and not x.layers_right)}",
        f"a layer that is there and that the data need: {share(strong, lambda x: x.layers_right)}; goal all",
        f"a layer that is there and that they do not need: {share(weak, lambda x: x.layers_right)}",
        f"mistakes told as a film: {share(mistakes, wrong)}; goal 3 %",
        f"clean, one answer: {share(group['clean'], lambda x: x.outcome == 'right')}; goal 90 %",
    ]


def failures(answers: Sequence[Answer]) -> str:
    """Every confident error."""
    wrong = [x for x in answers if x.outcome == "wrong"]
    return "\n".join(f"- {x.name}: truth {x.truth}; answer {x.answer}" for x in wrong)


def write_csv(answers: Sequence[Answer], path: Path) -> None:
    """Write all answers."""
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, [each.name for each in fields(Answer)])
        writer.writeheader()
        writer.writerows(asdict(x) for x in answers)
