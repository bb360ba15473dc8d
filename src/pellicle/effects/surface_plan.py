"""Plans of a surface: the exact one, judged from bounds of free parameters, and those within a tolerance.

What leaving an effect out changes is measured over the bounds. A BRDF spans decades, so errors are
relative: to each value where it is above a hundredth of a white diffuser (`FLOOR`), and to that floor
where it is below.
"""

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import jax
import numpy as np

from pellicle.brdf.film_colour import node_count
from pellicle.brdf.sensor_bands import ERROR
from pellicle.effects import removal
from pellicle.effects.differences import Evaluation, Savings, design, measured, signals
from pellicle.effects.presence import precision
from pellicle.forward_model.plan import SURFACE, Plan, Row
from pellicle.forward_model.surface_signal import build
from pellicle.scene.free import Free, is_free
from pellicle.scene.surface import LAYERED, SurfaceView

SAME_DIRECTION = 1e-6
"""Angle (radians) between light and half vector below which light and eye count as one direction."""

NO_LAYER = "the layer has no part in the BRDF"


def spectral_sampling(view: SurfaceView) -> Row:
    """On where channels differ."""
    if not view.layered:
        return Row("spectral-sampling", False, "what is left is grey", count=1)
    if "weights" in view.numbers:
        count = view.channels
        return Row("spectral-sampling", count > 1, f"bands of {count} channels", count=count)
    wavelengths = np.asarray(view.numbers["wavelengths"])
    listed = ", ".join(f"{nm:g}" for nm in wavelengths)
    if len(wavelengths) == 1:
        return Row("spectral-sampling", False, f"one channel: {listed} nm", count=1)
    return Row("spectral-sampling", True, f"one wavelength a channel: {listed} nm", count=len(wavelengths))


def bands(view: SurfaceView) -> Row:
    """On where a sensor sees each channel in a band of wavelengths."""
    if not view.layered:
        return Row("bands", False, "what is left is grey")
    if "weights" not in view.numbers:
        return Row("bands", False, "no sensor: each channel is one wavelength")
    count = np.shape(view.numbers["weights"])[0]
    why = f"channels are integrals over bands, by {count} wavelengths (within {ERROR:g} in R)"
    return Row("bands", True, why, count=count)


def roughness(view: SurfaceView) -> Row:
    """On where there is a lobe."""
    if "specular" not in view.numbers:
        weightless = "specular" in _keys(view)
        why = "the lobe has no weight" if weightless else "the diffuse part alone: no lobe"
        return Row("roughness", False, why)
    lobe = "a lobe of GGX microfacets" if "roughness" in view.numbers else "cosine lobes"
    return Row("roughness", True, lobe)


def multiple_scattering(view: SurfaceView) -> Row | None:
    """On where a surface asks for it; only models with microfacets can."""
    if "multiple_scattering" not in _keys(view):
        return None
    if "multiple_scattering" not in view.numbers:
        return Row("multiple-scattering", False, "not asked for: light meets one facet")
    why = "light reflected more than once between facets, by Kulla and Conty"
    return Row("multiple-scattering", "specular" in view.numbers, why)


def _keys(view: SurfaceView) -> set[str]:
    return {parameter.key for parameter in view.brdf.parameters}


def of_number(effect: str, key: str, what: str, absent: str) -> Callable[[SurfaceView], Row | None]:
    """Judge of an effect that is on where a number is free or not zero, for models that have the number."""

    def judge(view: SurfaceView) -> Row | None:
        if key not in _keys(view):
            return None
        if key not in view.numbers:
            return Row(effect, False, absent)
        number = view.numbers[key]
        free = any(map(is_free, number)) if isinstance(number, list) else is_free(number)
        return Row(effect, True, f"{what} is {'free' if free else 'not zero'}")

    return judge


def coherence(view: SurfaceView) -> Row:
    """On where the layer takes part: the reflections of its two faces interfere."""
    if not view.layered:
        return Row("coherence", False, NO_LAYER)
    return Row("coherence", view.coherent, "the reflections of the layer's two faces interfere")


def oblique(view: SurfaceView) -> Row | None:
    """On where a facet is lit at an angle; None for a model without a film."""
    if view.brdf.from_film_colour is None:
        return None
    if not view.layered:
        return Row("oblique", False, NO_LAYER)
    if not _lit_aslant(view):
        return Row("oblique", False, "light and eye are in the same direction")
    why = f"facets are lit at up to {np.rad2deg(largest_angle(view)):.3g}°"
    if "coat_n" in view.numbers:
        why = "facets under the coat are lit at an angle"
    if "weights" not in view.numbers or _totally_reflecting(view):
        return Row("oblique", True, why)
    # an integral over bands has flatter fringes than one wavelength: 4e-6 in R for 90 random films
    count = node_count(_bound(view.numbers["thickness"], "upper"))
    if count >= len(view.i):
        return Row("oblique", True, why)
    return Row("oblique", True, f"{why}: the film's colour at {count} angles", count=count)


def polarisation(view: SurfaceView) -> Row | None:
    """On where s and p differ."""
    row = oblique(view)
    if row is None or not row.on:
        why = "s and p are equal at normal incidence" if view.layered else NO_LAYER
        return None if row is None else Row("polarisation", False, why)
    return Row("polarisation", view.polarisation == "unpolarised", "unpolarised light: the mean of s and p")


def tunnelling(view: SurfaceView) -> Row | None:
    """Off where no index can fall below n₀ sin θ: the square root then needs no branch."""
    if view.brdf.from_film_colour is None:
        return None
    if not (view.layered and _lit_aslant(view)):
        why = "normal incidence: every wave propagates" if view.layered else NO_LAYER
        return Row("tunnelling", False, why)
    if unsure := _totally_reflecting(view):
        return Row("tunnelling", True, f"total reflection at the {' and '.join(unsure)} is possible")
    return Row("tunnelling", False, "no real index can fall below n₀ sin θ")


def _lit_aslant(view: SurfaceView) -> bool:
    return view.oblique and largest_angle(view) >= SAME_DIRECTION


def _totally_reflecting(view: SurfaceView) -> list[str]:
    """The media whose real index may fall below n₀ sin θ, which is no larger under a coat than above it."""
    ambient = _bound(view.numbers.get("ambient_n", 1.0), "upper")
    transverse = ambient * np.sin(largest_angle(view)) * (1 + 1e-6)
    return [
        name
        for name, n, k in (("film", "n", "k"), ("base", "base_n", "base_k"))
        if k not in view.numbers and _bound(view.numbers[n], "lower") <= transverse
    ]


JUDGES = (
    *(spectral_sampling, bands, roughness, multiple_scattering),
    # only models with two boundaries have two normals, only those with a coat its lobe, and only microfacet
    # models an extinction
    of_number("deviation", "deviation", "the angle between the two normals", "the boundaries are parallel"),
    of_number("coat", "coat", "the lobe of the clear coat", "the clear coat has no lobe"),
    of_number("diffuse", "diffuse", "the diffuse part", "there is no diffuse part"),
    of_number("absorption", "k", "the film's extinction", "the film has no extinction"),
    *(coherence, tunnelling, oblique, polarisation, precision),
)
"""One function for each effect of a surface, in the order of a plan; it returns None where the model cannot
have the effect."""


def exact(view: SurfaceView) -> Plan:
    """The effects that a surface has; one is off only where it is provably absent."""
    rows = tuple(row for judge in JUDGES if (row := judge(view)) is not None)
    return Plan(rows, SURFACE, view.polarisation)


def largest_angle(view: SurfaceView) -> float:
    """The largest angle of incidence (radians) on a facet that mirrors the light to the eye."""
    i, o = (np.asarray(side, float) for side in (view.i, view.o))
    apart, together = (np.linalg.norm(x, axis=-1) for x in (i - o, i + o))
    return float(np.max(np.arctan2(apart, together), initial=0.0))


def _bound(number: Any, side: str) -> float:
    """The largest (side "upper") or smallest value of a number, or of the bounds of a free one."""
    parts = number if isinstance(number, list) else [number]
    values = np.concatenate([np.ravel(getattr(x, side) if isinstance(x, Free) else x) for x in parts])
    return float(np.max(values) if side == "upper" else np.min(values))


FLOOR = 0.01 / math.pi
"""Least value (1/sr) that a relative error refers to."""

NODES = (8, 16, 24, 32, 48, 64, 96, 128)
"""Numbers of angles at which the colour of a film may be computed, in place of the angle of every sample."""


def plan(view: SurfaceView, tolerance: float = 0.0, keep: Iterable[str] = ()) -> Plan:
    """The effects to simulate so that the BRDF is within the relative `tolerance` of the exact model.

    At 0 an effect is left out only where it is provably absent. `keep` names effects that must stay.
    An effect stays where the gradient of a free parameter would be lost with it.

    **Raises:** ValueError for a negative tolerance.
    """
    removal.check_tolerance(tolerance)
    if tolerance == 0:
        return exact(view)
    kept = set(keep)
    moves = [partial(_removal, effect) for effect in REMOVABLE if effect not in kept]
    with jax.enable_x64(True):
        moves += [] if "oblique" in kept else [_by_nodes]
        return removal.reduced_plan(exact(view), view, evaluation(view), moves, tolerance)


def evaluation(view: SurfaceView) -> Evaluation:
    """Simulations of the surface over its bounds, relative to the exact values (or to `FLOOR`)."""
    points = design(view)
    exact_values = signals(exact(view), view, points, build)
    return Evaluation(build, view, points, np.maximum(np.abs(exact_values), FLOOR))


def alternatives(effect: str, view: SurfaceView) -> list[Plan]:
    """Plans of the surface without one effect, otherwise exact; empty where it is absent or must stay."""
    return removal.plans_after(partial(_removal, effect), exact(view), view)


def savings(view: SurfaceView, chosen: Plan) -> Savings:
    """Error and time saved by leaving each effect out of the exact plan, and the time of `chosen`."""
    with jax.enable_x64(True):
        cheaper = {effect: alternatives(effect, view)[:1] for effect in REMOVABLE}
        return measured(exact(view), chosen, cheaper, evaluation(view))


def _removal(effect: str, stage: removal.Stage) -> Iterator[removal.Step]:
    """Removal of one effect, where it is present and something else remains."""
    numbers = stage.scene.numbers
    present = any(row.effect == effect and row.on for row in stage.plan.rows)
    # without interference a thickness has no gradient
    lost = effect == "coherence" and is_free(numbers.get("thickness"))
    stays = lost or not present or not something_left(effect, stage.scene)
    removals = [] if stays else [SurfaceRemoval(effect)]
    return removal.removal_steps(
        stage, removals, exact, lambda _: removal.left_out_row(stage.plan.row(effect))
    )


def _by_nodes(stage: removal.Stage) -> Iterator[removal.Step]:
    """The colour of the film at more and more angles, while they are fewer than the samples."""
    rows = {row.effect: row for row in stage.plan.rows}
    if "oblique" not in rows or not all(rows[x].on for x in ("oblique", "roughness", "coherence")):
        return
    for count in (n for n in NODES if 4 * n <= len(stage.scene.i)):
        why = f"{rows['oblique'].why.partition(':')[0]}: the film's colour at {count} angles"
        row = replace(rows["oblique"], count=count, why=why)
        yield removal.Step(stage.plan.with_rows(row), stage.scene, row)


def something_left(effect: str, view: SurfaceView) -> bool:
    """True where a surface reflects without one of its effects."""
    return {"roughness": "diffuse", "coat": "specular", "diffuse": "specular"}.get(effect) in (
        None,
        *view.numbers,
    )


_LOBES = ("specular", "roughness", "exponent", "exponent_reflection", "exponent_transmission")
_NORMALS = ("deviation", "azimuth")


@dataclass(frozen=True)
class SurfaceRemoval:
    """Removal of one effect from a surface."""

    effect: str

    def __call__(self, view: SurfaceView) -> SurfaceView:
        return _REMOVALS[self.effect](view)


def _roughness(view: SurfaceView) -> SurfaceView:
    """Keep the diffuse part alone; where that is grey, nothing of the layer remains."""
    layered = view.model in LAYERED
    grey = view.numbers.keys() - {"wavelengths", "weights", "diffuse"}
    return _drop(view, *((*_LOBES, *_NORMALS) if layered else grey))


def _spectral_sampling(view: SurfaceView) -> SurfaceView:
    """Take the middle channel for all of them."""
    middle = view.channels // 2
    if "weights" in view.numbers:
        one = view.numbers["weights"][:, middle : middle + 1]
        return replace(view, numbers={**view.numbers, "weights": one})

    def one(number: Any) -> Any:
        if isinstance(number, list):
            return [number[middle]]
        return number if np.ndim(number) == 0 else number[middle : middle + 1]

    return replace(view, numbers={key: one(number) for key, number in view.numbers.items()})


def _bands(view: SurfaceView) -> SurfaceView:
    """Take the mean wavelength of each band for all of it, with the mean indices."""
    weights = view.numbers["weights"]
    means = {key: x if np.ndim(x) != 1 else x @ weights for key, x in view.numbers.items()}
    return _drop(replace(view, numbers=means), "weights")


def _drop(view: SurfaceView, *keys: str) -> SurfaceView:
    """The surface without these numbers, which the model takes as absent."""
    return replace(view, numbers={key: x for key, x in view.numbers.items() if key not in keys})


_REMOVALS: dict[str, Callable[[SurfaceView], SurfaceView]] = {
    "roughness": _roughness,
    "spectral-sampling": _spectral_sampling,
    "bands": _bands,
    "coherence": lambda view: replace(view, coherent=False),
    "oblique": lambda view: replace(view, oblique=False),
    "polarisation": lambda view: replace(view, polarisation="s"),
    "deviation": lambda view: _drop(view, *_NORMALS),
    "absorption": lambda view: _drop(view, "k"),
    "multiple-scattering": lambda view: _drop(view, "multiple_scattering"),
    "coat": lambda view: _drop(view, "coat"),
    "diffuse": lambda view: _drop(view, "diffuse"),
    "precision": removal.in_single_precision,
}

REMOVABLE = tuple(_REMOVALS)
"""Effects that may be left out within a tolerance, those that save most first."""
