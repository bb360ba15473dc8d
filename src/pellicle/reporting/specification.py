"""Limits of parameters, and whether a fit meets them by the guard band of its 95 % error.

A parameter passes where its whole 95 % interval lies within the limits, fails where it lies beyond one of
them, and is undecided else (ISO 14253-1: the uncertainty counts against both claims).
"""

import math
from collections.abc import Iterable, Mapping
from typing import Any

from pellicle.data.options import length_range, parse_number
from pellicle.errors import UsageError, did_you_mean

PASS, FAIL, UNDECIDED = "pass", "fail", "undecided"
Limits = Mapping[str, tuple[float, float]]
"""Lower and upper limit of each parameter, in its unit; infinite where there is none."""


def parse_limits(texts: Iterable[str]) -> dict[str, tuple[float, float]]:
    """Limits by name from texts such as `thickness=175:185`; a side may be absent, as in `k=:0.01`.

    Raises UsageError.
    """
    limits = {}
    for text in texts:
        name, equals, words = (part.strip() for part in text.partition("="))
        if not name or not equals:
            raise UsageError(f"--spec must be NAME=LO:HI, as in thickness=175:185, not {text!r}")
        if name in limits:
            raise UsageError(f"--spec names {name} twice: give its limits once")
        label = f"--spec {name}"
        low, colon, high = words.partition(":")
        if colon and bool(low) != bool(high):
            number = parse_number(low or high, label)
            limits[name] = (number, math.inf) if low else (-math.inf, number)
        else:
            limits[name] = length_range(words, label)
    return limits


def verdicts(record: Mapping[str, Any], limits: Limits) -> dict[str, str]:
    """PASS, FAIL or UNDECIDED of each limited parameter of a fit's JSON record.

    Only the parameters of a converged fit are decided: another status has no single answer with its error.
    Raises UsageError for a parameter that the fit does not have.
    """
    known = record["parameters"]
    for name in limits:
        if name not in known:
            near = did_you_mean(name, known)
            raise UsageError(f"--spec {name}{near}: the fit has {', '.join(known)}")
    decided = record["status"] == "converged"
    return {name: _verdict(known[name], *limits[name]) if decided else UNDECIDED for name in limits}


def check_names(limits: Limits, scene: Any) -> None:
    """Raise UsageError, before a fit, for a limit whose name is close to that of a number of a film."""
    from pellicle.fitting.film.parameters import fixed_numbers, parameters, tied_numbers
    from pellicle.scene.film import Scene

    if not isinstance(scene, Scene):
        return
    named = [*parameters(scene), *tied_numbers(scene)]
    known = [*(number.name for number in named), *(name for name, *_ in fixed_numbers(scene))]
    for name in limits:
        near = did_you_mean(name, known)
        if near and name not in known and not name.startswith("instrument."):
            raise UsageError(f"--spec {name}{near}: the fit has {', '.join(known)}")


def _verdict(parameter: Mapping[str, Any], low: float, high: float) -> str:
    value, expanded = parameter["value"], parameter["expanded"]
    if value is None or expanded is None:
        return UNDECIDED
    if low <= value - expanded and value + expanded <= high:
        return PASS
    return FAIL if value + expanded < low or value - expanded > high else UNDECIDED


def lines(record: Mapping[str, Any], limits: Limits, found: Mapping[str, str]) -> list[str]:
    """One line of text for each limited parameter."""
    texts = []
    for name, (low, high) in limits.items():
        parameter = record["parameters"][name]
        unit = f" {parameter['unit']}".rstrip()
        within = f"{low:g} to {high:g}{unit}"
        if math.inf in (-low, high):
            within = f"at most {high:g}{unit}" if low == -math.inf else f"at least {low:g}{unit}"
        texts.append(f"{name}: {found[name].upper()} ({within}; fitted {with_error(parameter)})")
    return texts


def with_error(parameter: Mapping[str, Any]) -> str:
    """A parameter of a record with its 95 % error and unit."""
    value, expanded, unit = parameter["value"], parameter["expanded"], parameter["unit"]
    if value is None or not expanded:
        return "no number" if value is None else f"{value:.6g} {unit}".rstrip()
    places = max(0, 1 - math.floor(math.log10(expanded)))
    return f"{value:.{places}f} ± {expanded:.{places}f} {unit}".rstrip() + " (95 %)"


def one_line(record: Mapping[str, Any]) -> str:
    """A fit of a batch in one line: file, status, free parameters of the film with their 95 % errors; the
    tables have those of the instrument too."""
    data = record["data"]
    parts = data if isinstance(data, list) else [data]
    paths = ", ".join(dict.fromkeys(str(part["path"]) for part in parts))
    fitted = {name: p for name, p in record["parameters"].items() if p["free"]}
    film = {name: p for name, p in fitted.items() if not name.startswith("instrument.")} or fitted
    free = [f"{name} {with_error(p)}" for name, p in film.items()]
    spec = [f"{name} {found.upper()}" for name, found in record.get("spec", {}).items()]
    return f"{paths}: {'; '.join([record['status'], *free, *spec])}"
