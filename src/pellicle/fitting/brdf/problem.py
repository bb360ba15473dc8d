"""A surface and BRDF samples of it as a least-squares problem."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pellicle.data.brdf_samples import BrdfSamples
from pellicle.fitting.brdf.view import PLAIN_WEIGHTS, SamplesForm, samples_view
from pellicle.fitting.coordinates import LEAST_SQUARE, Coordinates, box
from pellicle.fitting.parameter import Parameter
from pellicle.fitting.problem import Problem
from pellicle.forward_model.plan import Plan
from pellicle.scene.surface import FreeNumber, Surface, nonzero_numbers

NATURAL = frozenset({"k", "base_k", "deviation", "specular", "coat", "diffuse", "thickness"})
"""Their lower bound, 0, is set by physics."""
_MIRROR = frozenset({"exponent", "exponent_reflection", "exponent_transmission"})
"""Beyond their upper bound lies a mirror, which samples at some distance cannot tell from a narrow lobe."""
_TILT = ("deviation", "azimuth")
_RESOLUTION = 1.0
"""Thicknesses (nm) closer than this belong to one minimum."""
_ROUGHNESS = (0.003, 1.0)
_NORMAL = (0.02, 1.0)
_STRONGEST = 100.0


def make(
    samples: Sequence[BrdfSamples],
    names: Sequence[str],
    surface: Surface,
    plans: Sequence[Plan],
    residual: str,
) -> Problem:
    """The problem of fitting the surface to samples of it, with one plan for each set of samples.

    Nonlinear numbers come first, then the weights of lobes.
    """
    free = sorted(surface.free_numbers(), key=lambda number: number.parameter.linear)
    where = {number.name: at for at, number in enumerate(free)}
    tilt = (where[_TILT[0]], where[_TILT[1]]) if all(name in where for name in _TILT) else None
    if tilt is not None:
        deviation, azimuth = (free[at].free for at in tilt)
        tilt = None if deviation.lower > 0 or azimuth.upper - azimuth.lower < 360 else tilt
    # samples in one plane cannot tell a tilt to one side of it from one to the other: its square is searched
    folded = tilt is not None and in_plane(together(samples))
    take = [np.log if number.log else float for number in free]
    lower, upper = (
        np.array([convert(getattr(number.free, side)) for convert, number in zip(take, free, strict=True)])
        for side in ("lower", "upper")
    )
    reach = upper[tilt[0]] if tilt else 0.0
    if tilt is not None:
        lower[list(tilt)], upper[list(tilt)] = (-1.0, LEAST_SQUARE if folded else -1.0), 1.0
    log = tuple(number.log for number in free)
    keys, channels = tuple(number.key for number in free), tuple(number.channel for number in free)
    fixed = {key: x for key, x in nonzero_numbers(surface).items() if key in surface.fixed_numbers()}
    views = []
    for each, name, plan in zip(samples, names, plans, strict=True):
        form = SamplesForm(surface.model, "layer", plan.static_key, keys, channels, residual)
        views.append(samples_view(each, name, plan, form, fixed))
    problem = Problem(
        tuple(views),
        tuple(_parameter(number, tilt is not None, folded) for number in free),
        box(lower, upper, [number.free.prior for number in free], float(reach)),
        Coordinates(log if any(log) else (), tilt, folded),
    )
    return in_family(problem)


def in_family(problem: Problem) -> Problem:
    """The problem of a surface, which shares its programs with those that judge it."""
    every = problem, incoherent(problem), without_layer(problem)
    return problem._replace(family=tuple(each.member for each in every))


def _parameter(number: FreeNumber, tilted: bool, folded: bool) -> Parameter:
    free, key = number.free, number.key
    turns = key == "azimuth" and tilted
    lower, upper = (0.0, 180.0) if turns and folded else (free.lower, free.upper)
    from_zero = (free.lower == 0 and key in NATURAL) or key in ("roughness", "coat_roughness")
    return Parameter(
        *(number.name, key, number.parameter.unit, free.start, lower, upper),
        prior=free.prior,
        natural=(True, True) if turns and folded else (from_zero, key in _MIRROR),
        periodic=turns,
        resolution=np.inf if number.parameter.linear else _RESOLUTION if key == "thickness" else None,
    )


def together(samples: Sequence[BrdfSamples]) -> BrdfSamples:
    """The samples of all sets, without σ."""
    names = ("theta_i", "phi_i", "theta_o", "phi_o", "values")
    columns = (np.concatenate([getattr(each, name) for each in samples]) for name in names)
    return BrdfSamples(*columns, channels=samples[0].channels)


def in_plane(samples: BrdfSamples, tolerance: float = 0.5) -> bool:
    """True where light, eye and normal always lie in one plane, within `tolerance` degrees of the normal."""
    away = np.deg2rad(samples.phi_i[:, None] - np.array([0.0, 1.0]) * samples.phi_i[0])
    oblique = (samples.theta_i > tolerance) & (samples.theta_o > tolerance)
    across = np.sin(np.deg2rad(samples.phi_o - samples.phi_i))[oblique]
    turned = np.sin(away[:, 1])[samples.theta_i > tolerance]
    return bool(np.all(np.abs(across) < 0.01) and np.all(np.abs(turned) < 0.01))


def linear_count(problem: Problem) -> int:
    """Number of weights among the parameters, which come last."""
    return len(problem.parameters) - problem.views[0].form.nonlinear


def restricted(problem: Problem, rows: Sequence[np.ndarray]) -> Problem:
    """Problem of the same program with weight on these rows of each view alone."""
    views = (view.restricted(own) for view, own in zip(problem.views, rows, strict=True))
    return problem._replace(views=tuple(views))


def incoherent(problem: Problem) -> Problem:
    """Problem of the surface without interference, which a layer must beat.

    On PTFE, which has no film, interference halves the error of a fit: a small misfit proves nothing.
    """
    views = (replace(view, form=replace(view.form, kind="incoherent")) for view in problem.views)
    return problem._replace(views=tuple(views))


def without_layer(problem: Problem) -> Problem:
    """Problem of two plain lobes without a layer, which a layer must beat too."""
    count = problem.views[0].data.values.shape[1]
    shapes = {"roughness_1": _ROUGHNESS, "roughness_2": _ROUGHNESS, "normal": _NORMAL}
    weights = [(key, channel) for key in PLAIN_WEIGHTS for channel in range(count)]
    parameters = [Parameter(key, key, "", low, low, high) for key, (low, high) in shapes.items()]
    parameters += [
        Parameter(f"{key}_{channel + 1}", key, "", 1.0, 0.0, _STRONGEST, resolution=np.inf)
        for key, channel in weights
    ]
    keys, log = tuple(p.key for p in parameters), tuple(p.key.startswith("roughness") for p in parameters)
    channels = (None,) * len(shapes) + tuple(channel for _, channel in weights)
    bounds = np.array([(p.lower, p.upper) for p in parameters])
    bounds = np.where(np.array(log)[:, None], np.log(np.maximum(bounds, 1e-300)), bounds)
    # numbers that are fixed stay: two lobes ignore them, and programs are shared by arrays of one structure
    takes = tuple(range(len(keys)))
    forms = (replace(v.form, kind="two lobes", keys=keys, channels=channels) for v in problem.views)
    views = tuple(replace(v, form=form, takes=takes) for v, form in zip(problem.views, forms, strict=True))
    whole = box(bounds[:, 0], bounds[:, 1], [None] * len(keys))
    return Problem(views, tuple(parameters), whole, Coordinates(log), problem.family)
