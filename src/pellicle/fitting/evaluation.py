"""Compiled evaluations of a problem: deviances, polished minima, model curves."""

from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from pellicle.fitting.central_differences import central_differences, evaluations, steps_within
from pellicle.fitting.coordinates import Box
from pellicle.fitting.levenberg_marquardt import Evaluated, normal_equations
from pellicle.fitting.normal_equations import times
from pellicle.fitting.problem import Blocked, Elementary, Explained, Form, Member, Problem, Static
from pellicle.fitting.progress import Progress, quiet
from pellicle.programs.cache import kept

CHUNK = 128
"""Candidates that one call of the compiled program takes."""
_DEVIANCES = 2
"""Factor by which a program without slopes compiles faster than one with them."""


class Deviances(NamedTuple):
    """−2 ln likelihood of each candidate in one view, priors left out."""

    value: Any


def _deviances_by_numpy(form: Form, arrays: Any, values: np.ndarray) -> Deviances | None:
    found = form.explained(arrays, values) if isinstance(form, Elementary) else None
    return None if found is None else Deviances(found.deviance)


def share_without_slopes(form: Form, arrays: Any, values: np.ndarray) -> float:
    """Time of candidates by NumPy, as a share of the compilation of a program without slopes."""
    return _DEVIANCES * len(values) * _numpy_share(form, arrays)


def _numpy_share(form: Form, arrays: Any) -> float:
    return form.numpy_share(arrays) if isinstance(form, Elementary) else np.inf


@partial(kept, at_first=_deviances_by_numpy, share=share_without_slopes)
def deviances(form: Form, arrays: Any, values: Any) -> Deviances:
    """Deviance of one view at candidates `values` (candidates, its parameters)."""
    return Deviances(jax.vmap(lambda each: form.explain(arrays, each).deviance)(values))


class Curves(NamedTuple):
    """The model of each candidate, nuisances at their best, (candidates, data values)."""

    model: Any


@kept
def curves(form: Form, arrays: Any, values: Any) -> Curves:
    """Model of one view at candidates `values` (candidates, its parameters)."""
    return Curves(jax.vmap(lambda each: form.explain(arrays, each).model)(values))


def explained(static: Static, arrays: tuple[Any, ...], box: Box, unit: Any) -> tuple[list[Explained], Any]:
    """Every view at one point of the unit cube, and the values of the parameters.

    Views of one form whose arrays have the same structure and shapes are mapped over: they are traced and
    compiled once.
    """
    coordinates, looks = static
    values = coordinates.values(box, unit)
    alike: dict[Any, list[int]] = {}
    for number, ((form, takes), own) in enumerate(zip(looks, arrays, strict=True)):
        leaves, structure = jax.tree.flatten(own)
        shapes = tuple((jnp.shape(leaf), jnp.result_type(leaf)) for leaf in leaves)
        alike.setdefault((form, len(takes), structure, shapes), []).append(number)
    views: dict[int, Explained] = {}
    for (form, *_), numbers in alike.items():
        if len(numbers) == 1:
            [only] = numbers
            views[only] = form.explain(arrays[only], [values[i] for i in looks[only][1]])
            continue
        stacked = jax.tree.map(lambda *each: jnp.stack(each), *(arrays[number] for number in numbers))
        takes = np.array([looks[number][1] for number in numbers], int)
        every = jax.vmap(form.explain)(stacked, values[takes])
        views |= {n: jax.tree.map(lambda x, i=i: x[i], every) for i, n in enumerate(numbers)}
    return [views[number] for number in range(len(looks))], values


class Polished(NamedTuple):
    """Local minima in the unit cube, (starts, parameters), their deviance, whether they settled, and in how
    many steps."""

    units: Any
    deviance: Any
    converged: Any
    steps: Any


class Until(NamedTuple):
    """The number of starts that are polished, until when (see `lanes.minimise`), and of which problem of a
    family."""

    count: Any
    steps: Any
    atol: Any
    coarse: Any
    member: Any = 0


def polished(
    static: tuple[tuple[Member, ...], int], arrays: tuple[Any, ...], box: Box, units: Any, until: Until
) -> Polished:
    """The local minimum below each start (starts, parameters), in all views together.

    `static` has the problems that share the program, of which `until` names one, and the number of lanes. The
    bounds of the box are (starts, parameters): where lower and upper meet, a parameter is fixed.
    """
    from pellicle.fitting.lanes import minimise  # a kept program needs no solver

    family, lanes = static

    def equations(unit, bounds):
        own = box._replace(lower=bounds[0], upper=bounds[1])
        if len(family) == 1:
            return _equations(family[0].static, arrays, own, unit)
        branches = [partial(_member_equations, each, arrays) for each in family]
        return jax.lax.switch(until.member, branches, own, unit)

    solutions = minimise(
        equations,
        units,
        (box.lower, box.upper),
        until.count,
        jnp.zeros((), units.dtype),
        lanes=lanes,
        steps=until.steps,
        atol=until.atol,
        coarse=until.coarse,
    )
    return Polished(solutions.y, solutions.aux, solutions.converged, solutions.steps)


def _by_numpy(
    static: tuple[tuple[Member, ...], int], arrays: tuple[Any, ...], box: Box, units: Any, until: Until
) -> Polished:
    """Polish as `polished` does, by steps of NumPy around a program that compiles in a third of the time."""
    from pellicle.fitting.lanes import minimise_by_numpy

    family, lanes = static
    member, count = family[int(until.member)], int(until.count)
    own = box.of_first(member.size)

    def evaluated(at: np.ndarray, which: np.ndarray) -> Evaluated:
        rows = np.resize(which, len(units))
        bounded = own._replace(lower=own.lower[rows], upper=own.upper[rows])
        points = at[np.resize(np.arange(len(at)), len(units))]
        every = equations((member.static, lanes), arrays, bounded, points, np.int64(len(which)))
        return Evaluated(*(x[: len(which)] for x in every))

    options = {"steps": int(until.steps), "atol": float(until.atol), "coarse": float(until.coarse)}
    found = minimise_by_numpy(evaluated, units[:count, : member.size], **options)
    result = Polished(np.array(units), *(np.zeros(len(units), kind) for kind in (float, bool, int)))
    result.units[:count, : member.size] = found.y
    for column, rows in zip(result[1:], (found.aux, found.converged, found.steps), strict=True):
        column[:count] = rows
    return result


polish = kept(polished, at_first=_by_numpy)


_STEP = 4e-7
"""Half the distance of points for differences in the unit cube: 0.004 nm for bounds 10 000 nm apart, which
turns a phase by 1e-4 radians."""


def _equations_by_numpy(
    static: tuple[Static, int], arrays: tuple[Any, ...], box: Box, units: np.ndarray, count: Any
) -> Evaluated:
    """The equations of `equations` with slopes by differences."""
    (coordinates, looks), _ = static
    forms: Any = [form for form, _ in looks]
    size, at = units.shape[1], units[: int(count)]

    def residuals(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        sides = (np.resize(side[: len(at)], points.shape) for side in (box.lower, box.upper))
        own = box._replace(**dict(zip(("lower", "upper"), sides, strict=True)))
        values = np.asarray(coordinates.values(own, points))
        takes = (values[:, list(takes)] for _, takes in looks)
        views: Any = [form.explained(*each) for form, *each in zip(forms, arrays, takes, strict=True)]
        prior = own.prior_rows(values)
        deviance = sum(view.deviance for view in views) + np.sum(prior**2, axis=1)
        return np.concatenate([*(view.residual for view in views), prior], axis=1), deviance

    found = central_differences(residuals, at, steps_within(at, np.full(size, _STEP), 0.0, 1.0))
    (residual, deviance), (slope, _) = found
    across = np.swapaxes(slope, 1, 2)
    cost, gradient = np.sum(residual**2, axis=1), times(across, residual)
    padding = len(units) - len(at)
    return Evaluated(
        *(
            np.pad(x, [(0, padding), *[(0, 0)] * (x.ndim - 1)])
            for x in (cost, gradient, across @ slope, deviance)
        )
    )


def _share_of_equations(
    static: tuple[Static, int], arrays: tuple[Any, ...], box: Box, units: np.ndarray, count: Any
) -> float:
    (_, looks), _ = static
    each = sum(_numpy_share(form, own) for (form, _), own in zip(looks, arrays, strict=True))
    return int(count) * evaluations(units.shape[1]) * each


@partial(kept, at_first=_equations_by_numpy, share=_share_of_equations)
def equations(
    static: tuple[Static, int], arrays: tuple[Any, ...], box: Box, units: Any, count: Any
) -> Evaluated:
    """Normal equations and deviances at the first `count` points `units` (points, parameters) of the unit
    cube.

    `static` has the static part of a problem, and how many points are evaluated side by side.
    """
    problem, lanes = static
    size, groups = units.shape[1], len(units) // lanes

    def of_group(k, result):
        own = [jax.lax.dynamic_slice_in_dim(x, k * lanes, lanes) for x in (box.lower, box.upper, units)]

        def one(lower, upper, unit):
            return _equations(problem, arrays, box._replace(lower=lower, upper=upper), unit)

        new = jax.vmap(one)(*own)
        return jax.tree.map(
            lambda old, rows: jax.lax.dynamic_update_slice_in_dim(old, rows, k * lanes, 0), result, new
        )

    zeros = jnp.zeros(len(units))
    nothing = Evaluated(zeros, 0 * units, jnp.zeros((len(units), size, size)), zeros)
    return jax.lax.fori_loop(0, jnp.minimum((count + lanes - 1) // lanes, groups), of_group, nothing)


def _member_equations(member: Member, arrays: tuple[Any, ...], box: Box, unit: Any) -> Evaluated:
    """The equations of one problem, with zeros for the parameters that others have more."""
    more = len(unit) - member.size
    own = _equations(member.static, arrays, box.of_first(member.size), unit[: member.size])
    return own._replace(gradient=jnp.pad(own.gradient, (0, more)), hessian=jnp.pad(own.hessian, (0, more)))


def _equations(static: Static, arrays: tuple[Any, ...], box: Box, unit: Any) -> Evaluated:
    """Normal equations at one point of the unit cube, and the deviance; see `normal_equations`."""

    def residual(unit, about):
        arrays, box = about
        views, values = explained(static, arrays, box, unit)
        prior = box.prior_rows(values)
        deviance = sum(view.deviance for view in views) + jnp.sum(prior**2)
        return [*(view.residual for view in views), prior], deviance

    form = static[1][0][0] if len(arrays) == 1 else None
    if not isinstance(form, Blocked):
        return normal_equations(residual, unit, (arrays, box))
    blocks = form.blocks(arrays[0])

    def add(k, total):
        own = box._replace(prior_weight=jnp.where(k == 0, box.prior_weight, 0))
        return jax.tree.map(jnp.add, total, normal_equations(residual, unit, ((blocks.at(k),), own)))

    zero = jnp.zeros((), unit.dtype)
    nothing = Evaluated(zero, 0 * unit, jnp.zeros((len(unit),) * 2), zero)
    return jax.lax.fori_loop(0, blocks.count, add, nothing)


def scanned(problem: Problem, units: np.ndarray, progress: Progress = quiet) -> np.ndarray:
    """Deviance in each view (candidates, views), priors in the first, of points (candidates, parameters).

    Points are those of the unit cube. A deviance that is not finite is infinite.

    Candidates go in chunks of one size: they share a program, and Ctrl-C is heard between chunks.
    """
    table = np.empty((len(units), len(problem.views)))
    values = np.asarray(problem.values(units))
    progress("scan", 0, len(units))
    for first in range(0, len(units), CHUNK):
        chunk = values[first : first + CHUNK]
        padded = np.concatenate([chunk, np.repeat(chunk[-1:], CHUNK - len(chunk), axis=0)])
        for column, view in zip(table.T, problem.views, strict=True):
            deviance = deviances(view.form, view.arrays, problem.seen_by(view, padded)).value
            column[first : first + CHUNK] = deviance[: len(chunk)]
        progress("scan", min(first + CHUNK, len(units)), len(units))
    table[:, 0] += np.sum(problem.box.prior_rows(values) ** 2, axis=1)
    return np.where(np.isfinite(table), table, np.inf)


def total_deviance(problem: Problem, units: np.ndarray) -> np.ndarray:
    """Deviance of all views and priors at points (points, parameters) of the unit cube."""
    return scanned(problem, units).sum(axis=1)
