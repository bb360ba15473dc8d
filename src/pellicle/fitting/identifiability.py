"""Correlated and undetermined parameters, in sentences.

The Jacobian is taken in units of the noise and of a meaningful step of each parameter. A singular value
below 1 means that the parameters can move along its direction by more than a step within one standard
deviation of the noise. Several parameters in such a direction are correlated: only a combination of them is
determined.
"""

import math
import re
from collections.abc import Container, Mapping, Sequence
from typing import Any

import numpy as np

from pellicle.fitting.covariance import Scaled
from pellicle.fitting.result import Estimate
from pellicle.fitting.status import limits_in_words

STEPS = {
    "thickness": 1.0,  # nm, or 1 % where that is more
    "roughness": 1.0,
    "thickness_spread": 1.0,
    "bandwidth": 1.0,
    "wavelength_shift": 0.1,
    "angle": 0.1,  # degrees
    "angle_shift": 0.1,
    "n": 0.01,
    "A": 0.01,
    "n_inf": 0.01,
    "k": 0.001,
    "k0": 0.001,
    "fraction": 0.01,
    "scale": 0.01,  # of a signal that is 1
    "offset": 0.001,
    "stray_light": 0.001,
}
"""Meaningful step of a parameter, by the last part of its name; for others 1 % of their range."""
_RELATIVE = ("exponent", "exponent_reflection", "exponent_transmission", "specular", "diffuse")
"""Parameters whose meaningful step is 1 % of their value."""
_SHARE = 0.01
_FINEST = 1e-4
"""Least step of those, as a share of their range."""
_WORTH = 0.3
"""Steps that a parameter must move along a direction to be named in it."""
_BETTER = 3.0
"""Ratio of a parameter's error to its error with the others fixed, above which they are called correlated."""
_LEAST = 1e-100
_LAW = 0.15
"""Largest deviation of a direction from n·d = const or n/d = const, in logarithms, to be named so."""
_CHANNEL = re.compile(r"(?<=^n)_(r|g|b|\d+)$")
_NUISANCE = re.compile(r"instrument\.(scale|offset)(_\d+)?(\..+)?$")


def step(name: str, estimate: Estimate) -> float:
    """The meaningful step of a parameter, in its own unit."""
    key = _key(name)
    if key == "thickness":
        return max(STEPS[key], _SHARE * abs(estimate.value))
    if key in STEPS and estimate.upper - estimate.lower > STEPS[key]:
        return STEPS[key]
    span = estimate.upper - estimate.lower
    if key in _RELATIVE:
        return max(_SHARE * abs(estimate.value), _FINEST * span)
    return _SHARE * (span if math.isfinite(span) else max(abs(estimate.value), 1e-12))


def _key(name: str) -> str:
    """The last part of a parameter's name, without the name of a spectrum or a channel that it belongs to."""
    parts = name.split(".")
    return parts[1] if parts[0] == "instrument" else re.sub(_CHANNEL, "", parts[-1])


def correlated(jacobian: Scaled, parameters: Mapping[str, Estimate]) -> list[str]:
    """A sentence for each set of parameters of which the data determine only a combination.

    Scale and offset are eliminated first, and named where they enlarge the errors of the others.
    """
    if len(jacobian.names) < 2:
        return []
    steps = np.array([step(name, parameters[name]) for name in jacobian.names])
    matrix = jacobian.by_range(steps)
    nuisance = np.array([bool(_NUISANCE.match(name)) for name in jacobian.names])
    own, linear = matrix[:, ~nuisance], matrix[:, nuisance]
    triangle: Any = np.linalg.qr(np.hstack([linear, own]), mode="r")
    triangular = triangle[linear.shape[1] :, linear.shape[1] :]
    free = [parameters[name] for name, aside in zip(jacobian.names, nuisance, strict=True) if not aside]
    sentences = [
        _sentence([free[i] for i in part], moves) for part, moves in _directions(triangular, steps[~nuisance])
    ]
    drowned = (_spread(triangular) > 1) & (_spread(triangular) > _BETTER * _spread(own))
    if linear.size and drowned.any():
        names = " and ".join(p.name for p, lost in zip(free, drowned, strict=True) if lost)
        sentences.append(f"{names} would be known far better with a known scale and offset of the instrument")
    return sentences


def _directions(matrix: np.ndarray, steps: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Sets of parameters (columns) that can move together by more than a step, with their moves.

    A parameter belongs to the direction that most of its variance comes from (D. Belsley, E. Kuh and
    R. Welsch, 1980, Regression Diagnostics), if it would be known far better with the others known.
    """
    _, sizes, rows = np.linalg.svd(matrix, full_matrices=False)
    moved = rows / np.maximum(sizes, _LEAST)[:, None]
    share = moved**2 / np.sum(moved**2, axis=0)
    suffers = _spread(matrix) * np.linalg.norm(matrix, axis=0) > _BETTER
    directions = []
    for move, of_all in zip(moved, share, strict=True):
        part = np.flatnonzero((of_all > 0.5) & suffers & (np.abs(move) > _WORTH))
        if np.linalg.norm(move) > 1 and len(part) > 1:
            directions.append((part, move[part] * steps[part]))
    return directions


def _spread(matrix: np.ndarray) -> np.ndarray:
    """Standard error of each parameter (column), the others being free."""
    _, sizes, rows = np.linalg.svd(matrix, full_matrices=False)
    return np.linalg.norm(rows / np.maximum(sizes, _LEAST)[:, None], axis=0)


def _sentence(parameters: Sequence[Estimate], moves: np.ndarray) -> str:
    """Sentence on correlated parameters; `moves` are their steps along the direction, in their own units."""
    order = sorted(range(len(parameters)), key=lambda i: _key(parameters[i].name) == "thickness")
    parameters, moves = [parameters[i] for i in order], moves[order]
    names = [p.name for p in parameters]
    if len(parameters) > 2:
        every = f"{', '.join(names[:-1])} and {names[-1]}"
        return f"{every} are strongly correlated: none of them is determined alone"
    moves = moves * step(names[0], parameters[0]) / moves[0]
    amounts = f"{_amount(moves[0], parameters[0])} against {_amount(abs(moves[1]), parameters[1])}"
    relative = moves / np.array([p.value or math.inf for p in parameters])
    near = _LAW * np.max(np.abs(relative))
    product, quotient = abs(relative.sum()) < near, abs(relative[0] - relative[1]) < near
    if product or quotient:
        law = f"the product {names[0]}·{names[1]}" if product else f"the quotient {names[0]}/{names[1]}"
        return f"only {law} is determined: {names[0]} and {names[1]} are correlated, {amounts}"
    way = "one rises as the other does" if moves[1] > 0 else "one rises as the other falls"
    return (
        f"{names[0]} and {names[1]} are strongly correlated, {amounts} ({way}): neither is determined alone"
    )


def _amount(size: float, p: Estimate) -> str:
    return f"{size:.2g}{f' {p.unit}' if p.unit else ''}"


def naming(lead: str, trading: Sequence[str]) -> list[str]:
    """The sentences that name the leading parameter."""
    return [sentence for sentence in trading if re.search(rf"(?<![\w.]){re.escape(lead)}(?![\w.])", sentence)]


def bounded(parameters: Mapping[str, Estimate], opaque: Container[str]) -> list[str]:
    """A sentence for each free parameter that the data bound on one side only, or not at all."""
    sentences = []
    for name, p in parameters.items():
        if p.free and math.isfinite(p.stderr) and (p.lower_limit, p.upper_limit) != (None, None):
            end = p.lower if p.upper_limit is not None else p.upper
            sentences.append(
                f"{name} is compatible with {end if math.isfinite(end) else 0:g}: it {limits_in_words(p)}"
            )
        elif p.free and not math.isfinite(p.stderr):
            opening = "the layer is opaque: " if name in opaque and p.lower_limit is not None else ""
            sentences.append(f"{opening}{name} {limits_in_words(p)}")
    return sentences
