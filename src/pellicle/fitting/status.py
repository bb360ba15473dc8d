"""Status of a fit, the first that holds, and its verdict in one or two sentences."""

import math
from collections.abc import Callable, Container, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from pellicle.fitting.result import LEVEL, Estimate, Rival, Status

RIVAL = 6.0
"""A distinct rival within this Δχ² on the effective points makes a fit ambiguous."""
WELL_KNOWN = 0.1
"""Largest relative error of a thickness beside which a default bound is a remark."""
MOST_NAMED = 4
"""Most thicknesses that a verdict names."""


ORDER = (
    Status.NOT_CONVERGED,
    Status.MISFIT,
    Status.NOT_IDENTIFIABLE,
    Status.AMBIGUOUS,
    Status.AT_BOUND,
    Status.CONVERGED,
)
"""The first status that holds is given."""

REFUSED = (Status.MISFIT, Status.NOT_CONVERGED)
"""Statuses of a fit of which causes are looked for by refits."""


class Judged(NamedTuple):
    """Positions (...) of a status in `ORDER`, and the free parameters of the sample (..., parameters) that
    have no finite error, and that rest on a bound that matters."""

    position: Any
    unseen: np.ndarray
    at_bound: np.ndarray


def judged(
    names: Sequence[str],
    default_bounds: Sequence[bool],
    values: np.ndarray,
    stderr: np.ndarray,
    resting: np.ndarray,
    *,
    converged: Any,
    misfit: Any,
    ambiguous: Any,
    binding: Container[str] = (),
) -> Judged:
    """The first status that holds of one fit, or of many with leading axes (...).

    `values`, `stderr` and `resting` (..., parameters), whether a value lies on a bound that physics does not
    set, are those of the free parameters by `names`, without those of instruments. A default bound counts
    only if `binding` names it or the thickness is not well determined.
    """
    depth = np.array([name.split(".")[-1] == "thickness" for name in names], bool)
    unseen = ~np.isfinite(stderr) & (depth | ~depth.any())
    at_bound = np.array(resting)
    for i, name in enumerate(names):
        if default_bounds[i] and name not in binding:
            at_bound[..., i] &= ~_well_known(i, names, depth, values, stderr)
    hidden = unseen.any(axis=-1) if depth.any() else unseen.all(axis=-1) & bool(names)
    holds = [~np.asarray(converged), np.asarray(misfit), hidden, np.asarray(ambiguous), at_bound.any(axis=-1)]
    return Judged(np.select(holds, list(range(len(holds))), len(holds))[()], unseen, at_bound)


def _well_known(
    i: int, names: Sequence[str], depth: np.ndarray, values: np.ndarray, stderr: np.ndarray
) -> Any:
    """True (...) where the answer stands beside parameter `i` on a default bound: the thickness of its layer,
    else every thickness, is well determined; without any, the leading number is another one."""
    if depth[i] or not depth.any():
        return np.full(values.shape[:-1], i != 0 and not depth.any())
    depths = np.flatnonzero(depth).tolist()
    own = [j for j in depths if names[i].startswith(names[j].removesuffix("thickness"))] or depths
    return np.all(stderr[..., own] <= WELL_KNOWN * values[..., own], axis=-1)


def outside(values: np.ndarray, stderr: np.ndarray, rivals: np.ndarray) -> np.ndarray:
    """Numbers of rivals (..., rivals, parameters) that lie outside the errors of the answer (...,
    parameters)."""
    reach = np.where(np.isfinite(stderr), 3 * stderr, np.inf)
    return np.abs(rivals - values[..., None, :]) > reach[..., None, :]


def distinct_rivals(parameters: Mapping[str, Estimate], rivals: tuple[Rival, ...]) -> list[Rival]:
    """Rivals that fit nearly as well and lie outside the errors of the answer."""
    return [r for r in rivals if r.delta_chi2 < RIVAL and apart_from(parameters, r)]


def apart_from(parameters: Mapping[str, Estimate], rival: Rival) -> list[str]:
    """Names of the numbers of a rival that lie outside the errors of the answer."""
    own = [parameters[name] for name in rival.parameters]
    about = np.array([p.value for p in own]), np.array([p.stderr for p in own])
    [apart] = outside(*about, np.array([list(rival.parameters.values())]))
    return [name for name, holds in zip(rival.parameters, apart, strict=True) if holds]


def verdict(
    status: Status,
    parameters: Mapping[str, Estimate],
    rivals: tuple[Rival, ...],
    rms: float,
    missed: str = "the data",
    unit: str = "",
    where: str = "",
    opaque: Container[str] = (),
    trading: Sequence[str] = (),
    found: str = "",
) -> str:
    """The verdict in one or two sentences, on all free thicknesses, on the leading parameter where none is
    free, or on what is `found` instead.

    `missed`, `rms` with its `unit` behind a space, and `where` name the data that a misfit does not explain,
    by how much and at which wavelengths; `opaque` are thicknesses of layers that absorb, and `trading`
    sentences on parameters that are correlated with the leading one.
    """
    leads = _leading(status, parameters, rivals)
    if not leads:
        return "Nothing was free to fit."
    lead, value = leads[0], expanded(leads[0])
    best = found or _listed(leads, " ", lambda p: f"{p.value:.4g}{_unit(p)}")
    besides = "".join(f" But {sentence}." for sentence in trading[:1])
    if status is Status.CONVERGED:
        return f"The data determine {_listed(leads, ': ', expanded)}.{besides}"
    if status is Status.AT_BOUND:
        resting = [p for p in parameters.values() if p.binding]
        given = [p for p in resting if not p.default_bounds]
        names = " and ".join(f"{p.name} ({p.value:.6g}{_unit(p)})" for p in given or resting)
        best = found or f"{lead.name} {value}"
        if not given:
            return f"The best fit, {best}, lies on a default bound: {names}. Give it bounds."
        return (
            f"The best fit, {best}, lies on a bound that was set: {names}."
            " Widen the bound; if the best value moves with it, the scene may be wrong."
        )
    if status is Status.AMBIGUOUS:
        other = _other(parameters, rivals, lead)
        return f"The data do not determine {lead.name}: {value} fits best, but {other} fits nearly as well."
    if status is Status.NOT_IDENTIFIABLE:
        if lead.name in opaque and lead.lower_limit is not None:
            return f"The layer is opaque: {lead.name} {limits_in_words(lead)}."
        most = math.nan if lead.upper_limit is None or lead.lower_limit is not None else lead.upper_limit
        absent = lead.at_bound or (lead.lower == 0 and lead.value <= most)
        if lead.name.endswith("thickness") and absent and most > 0:
            return f"No film is needed: {lead.name} {limits_in_words(lead)}."
        return f"The data do not determine {lead.name}: it {limits_in_words(lead)}.{besides}"
    if status is Status.MISFIT:
        return (
            f"The scene does not explain {missed}: even the best fit misses by {rms:.2g}{unit} on average,"
            " more than noise and the usual errors of instruments and samples would"
            f"{f', most of all {where}' if where else ''}. Its {best} should not be used."
        )
    return f"The fit did not converge: its best point so far, {best}, should not be used."


def _listed(leads: Sequence[Estimate], between: str, text: Callable[[Estimate], str]) -> str:
    """Names and numbers in a row, the first `MOST_NAMED` of many."""
    rest = len(leads) - MOST_NAMED
    each = " and ".join(f"{p.name}{between}{text(p)}" for p in leads[:MOST_NAMED])
    return f"{each} and {rest} more" if rest > 0 else each


def _leading(status: Status, parameters: Mapping[str, Estimate], rivals: tuple[Rival, ...]) -> list[Estimate]:
    """The numbers that a verdict is about: all free thicknesses, or else the first free number.

    Those that are not determined come first: by their error, or by the best distinct rival.
    """
    free = [p for p in parameters.values() if p.free]
    leads = [p for p in free if p.name.split(".")[-1] == "thickness"] or free[:1]
    if status is Status.NOT_IDENTIFIABLE:
        return sorted(leads, key=lambda p: math.isfinite(p.stderr))
    if status is Status.AMBIGUOUS:
        apart = apart_from(parameters, distinct_rivals(parameters, rivals)[0])
        return sorted(leads, key=lambda p: p.name not in apart)
    return leads


def _other(parameters: Mapping[str, Estimate], rivals: tuple[Rival, ...], lead: Estimate) -> str:
    """The best distinct rival, by its leading parameter, or by those that set it apart if that does not."""
    rival = distinct_rivals(parameters, rivals)[0]
    apart = apart_from(parameters, rival)
    value = rival.parameters.get(lead.name, math.nan)
    share = "" if rival.probability is None else f" (probability {100 * rival.probability:.2g} %)"
    if lead.name in apart or not apart:
        return f"{value:.4g}{_unit(lead)}{share}"
    each = (f"{name} {rival.parameters[name]:.4g}{_unit(parameters[name])}" for name in apart[:2])
    return " and ".join(each) + share


def expanded(p: Estimate) -> str:
    """`751.7 ± 8.6 nm (95 %; ± 0.42 nm by noise alone)`: the value with its expanded uncertainty."""
    if not math.isfinite(p.stderr):
        return f"{p.value:.6g}{_unit(p)}"
    value = describe(replace(p, stderr=p.expanded)).removeprefix(f"{p.name} ")
    level = f"{100 * LEVEL:.0f} %"
    noise = p.coverage_factor * p.stderr_noise
    if noise > 0.95 * p.expanded:
        return f"{value} ({level})"
    return f"{value} ({level}; ± {noise:.2g}{_unit(p)} by noise alone)"


def describe(p: Estimate) -> str:
    """`thickness 751.66 ± 0.12 nm`: the value with its standard error."""
    return f"{p.name} {with_error(p.value, p.stderr)}{_unit(p)}"


def with_error(value: float, stderr: float) -> str:
    """`751.66 ± 0.12`, or the value alone where the error is not finite."""
    if not math.isfinite(stderr):
        return f"{value:.6g}"
    digits = 2 if stderr == 0 else max(0, min(12, 1 - math.floor(math.log10(stderr))))
    return f"{value:.{digits}f} ± {stderr:.{digits}f}"


def _unit(p: Estimate) -> str:
    return f" {p.unit}" if p.unit else ""


def limits_in_words(p: Estimate) -> str:
    """`is at least 145 nm (95 %)`, of a parameter that is bounded on one side or on none."""
    if p.lower_limit is not None and p.upper_limit is None:
        return f"is at least {_rounded(p.lower_limit)}{_unit(p)} (95 %)"
    if p.upper_limit is not None and p.lower_limit is None:
        return f"is at most {_rounded(p.upper_limit)}{_unit(p)} (95 %)"
    return f"may be anything between {p.lower:.6g} and {p.upper:.6g}{_unit(p)}"


def _rounded(limit: float) -> str:
    """Two digits below 10, four above."""
    return f"{limit:.2g}" if abs(limit) < 10 else f"{limit:.4g}"
