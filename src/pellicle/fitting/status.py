"""Status of a fit, the first that holds, and its verdict in one or two sentences."""

from __future__ import annotations

import math
from collections.abc import Container, Mapping, Sequence
from dataclasses import replace
from logging import getLogger

from pellicle.fitting.result import LEVEL, Estimate, Rival, Status

log = getLogger(__name__)

RIVAL = 6.0
"""A distinct rival within this Δχ² on the effective points makes a fit ambiguous."""
WELL_KNOWN = 0.1
"""Largest relative error of a thickness beside which a default bound is a remark."""


def judge(
    *,
    converged: bool,
    misfit: bool,
    parameters: Mapping[str, Estimate],
    rivals: tuple[Rival, ...],
    natural: frozenset[str],
    binding: frozenset[str] = frozenset(),
) -> Status:
    """The first status that holds. `natural` names parameters that rest on a bound that physics sets.

    A default bound counts only if `binding` names it or the thickness is not well determined.
    """
    free = [p for p in parameters.values() if p.free and not p.name.startswith("instrument.")]
    depths = [p for p in free if p.name.split(".")[-1] == "thickness"]
    unseen = [p for p in (depths or free) if not math.isfinite(p.stderr)]
    resting = [p for p in free if p.at_bound and p.name not in natural]
    remarks = [p for p in resting if p.default_bounds and _well_known(p, depths, free[0])]
    at_bound = [p for p in resting if p not in remarks or p.name in binding]
    close = distinct_rivals(parameters, rivals)
    for question, answer in (
        ("did the solver converge?", "yes" if converged else "no"),
        ("does the scene not explain the data?", "yes" if misfit else "no"),
        ("which parameters of the sample have no finite error?", ", ".join(p.name for p in unseen) or "none"),
        (f"how many rivals lie within Δχ² {RIVAL:g} and outside the errors?", len(close)),
        ("which parameters lie on a bound?", ", ".join(p.name for p in resting) or "none"),
        ("which of these bounds matter?", ", ".join(p.name for p in at_bound) or "none"),
    ):
        log.info("status: %s %s", question, answer)
    if not converged:
        return Status.NOT_CONVERGED
    if misfit:
        return Status.MISFIT
    if unseen and (depths or len(unseen) == len(free)):
        return Status.NOT_IDENTIFIABLE
    if close:
        return Status.AMBIGUOUS
    return Status.AT_BOUND if at_bound else Status.CONVERGED


def _well_known(resting: Estimate, depths: Sequence[Estimate], lead: Estimate) -> bool:
    """True where the answer stands beside a number on a default bound: the thickness of its layer, else every
    thickness, is well determined; without any, the leading number is another one."""
    if not depths or resting in depths:
        return resting is not lead and not depths
    own = [d for d in depths if resting.name.startswith(d.name.removesuffix("thickness"))]
    return all(d.stderr <= WELL_KNOWN * d.value for d in own or depths)


def distinct_rivals(parameters: Mapping[str, Estimate], rivals: tuple[Rival, ...]) -> list[Rival]:
    """Rivals that fit nearly as well and lie outside the errors of the answer."""
    return [r for r in rivals if r.delta_chi2 < RIVAL and _outside(parameters, r)]


def _outside(parameters: Mapping[str, Estimate], rival: Rival) -> bool:
    return any(
        abs(value - parameters[name].value) > 3 * parameters[name].stderr
        for name, value in rival.parameters.items()
        if math.isfinite(parameters[name].stderr)
    )


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
) -> str:
    """The verdict in one or two sentences.

    `missed`, `rms` with its `unit` behind a space, and `where` name the data that a misfit does not explain,
    by how much and at which wavelengths; `opaque` are thicknesses of layers that absorb, and `trading`
    sentences on parameters that are correlated with the leading one.
    """
    lead = next((p for p in parameters.values() if p.free), None)
    if lead is None:
        return "Nothing was free to fit."
    value, best = expanded(lead), f"{lead.name} {lead.value:.4g}{_unit(lead)}"
    besides = "".join(f" But {sentence}." for sentence in trading[:1])
    if status is Status.CONVERGED:
        return f"The data determine {lead.name}: {value}.{besides}"
    if status is Status.AT_BOUND:
        resting = [p for p in parameters.values() if p.free and p.at_bound]
        given = [p for p in resting if not p.default_bounds]
        names = " and ".join(f"{p.name} ({p.value:.6g}{_unit(p)})" for p in given or resting)
        if not given:
            return f"The best fit, {lead.name} {value}, lies on a default bound: {names}. Give it bounds."
        return (
            f"The best fit, {lead.name} {value}, lies on a bound that was set: {names}."
            " Widen the bound; if the best value moves with it, the scene may be wrong."
        )
    if status is Status.AMBIGUOUS:
        other = _other(parameters, rivals, lead)
        return f"The data do not determine {lead.name}: {value} fits best, but {other} fits nearly as well."
    if status is Status.NOT_IDENTIFIABLE:
        if lead.name in opaque and lead.lower_limit is not None:
            return f"The layer is opaque: {lead.name} {limits_in_words(lead)}."
        return f"The data do not determine {lead.name}: it {limits_in_words(lead)}.{besides}"
    if status is Status.MISFIT:
        return (
            f"The scene does not explain {missed}: even the best fit misses by {rms:.2g}{unit} on average,"
            " more than noise and the usual errors of instruments and samples would"
            f"{f', most of all {where}' if where else ''}. Its {best} should not be used."
        )
    return f"The fit did not converge: its best point so far, {best}, should not be used."


def _other(parameters: Mapping[str, Estimate], rivals: tuple[Rival, ...], lead: Estimate) -> str:
    """The best distinct rival, by its leading parameter, or by those that set it apart if that does not."""
    rival = distinct_rivals(parameters, rivals)[0]
    apart = [
        name for name in rival.parameters if _outside(parameters, Rival({name: rival.parameters[name]}, 0.0))
    ]
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
    if not math.isfinite(p.stderr):
        return f"{p.name} {p.value:.6g}{_unit(p)}"
    digits = 2 if p.stderr == 0 else max(0, min(12, 1 - math.floor(math.log10(p.stderr))))
    return f"{p.name} {p.value:.{digits}f} ± {p.stderr:.{digits}f}{_unit(p)}"


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
