"""Continuity of a map: the order of interference of undecided pixels by that of their neighbours.

An effect of the map's plan, off unless asked for. A pixel that its own data decide keeps its answer, and
nothing is decided across a gap. How far neighbours can be trusted is measured on the map itself: the answers
of decided pixels are hidden in patches and sought again from what lies around them.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from logging import getLogger
from typing import Any

import numpy as np

from pellicle.errors import UsageError
from pellicle.forward_model.plan import Row
from pellicle.mapping.neighbours import Neighbourhood, grid, scattered
from pellicle.mapping.pixels.results import BY_NEIGHBOURS, CODES
from pellicle.mapping.stored_minima import exchanged, minima_at
from pellicle.mapping.unwrapping import Field, field_of, grow

log = getLogger(__name__)

MARGIN = 12.0
"""A converged pixel with a rival within this Δχ² is undecided: its odds are below exp(12/2), 400 to 1, and
maps have more pixels than that."""
LIMIT = 25.0
"""Largest Δχ² of a minimum that neighbours may choose."""
_HIDDEN, _SHARE, _PATCH = 20_000, 0.1, 4
"""Decided pixels that are hidden to test the neighbours: number in all, share at a time, width of a patch."""


@dataclass(frozen=True)
class Continuity:
    """Decisions by neighbours in a map, and how often they are right.

    Of the `undecided` pixels, `decided` take the order of their neighbours, `changed` of them another one
    than fits best by itself; for that a Δχ² of up to `overruled` was set aside, half of the times more than
    `median_overruled`, against `neighbours` decided neighbours at the median. Of `hidden` decided pixels
    neighbours found an order for `found`, and not their own for `wrong`. `continuous` is the share of decided
    pixels within five standard deviations of the plane of their neighbours, and `roughness` (nm) the usual
    distance from it.
    """

    undecided: int
    decided: int
    changed: int
    overruled: float
    median_overruled: float
    neighbours: int
    hidden: int
    found: int
    wrong: int
    continuous: float
    roughness: float
    weight: float  # largest weight of the neighbours against Δχ²
    margin: float
    limit: float

    def __str__(self) -> str:
        unclear = f"pixels with a rival within Δχ² {self.margin:g}"
        if not self.found:
            return f"neighbours show no continuity: none of {self.undecided} {unclear} decided by them"
        recovered = 100 * (1 - self.wrong / self.found)
        return (
            f"{self.decided} of {self.undecided} {unclear} take the order of their neighbours,"
            f" {self.changed} of them against a Δχ² of up to {self.overruled:.2g}; of {self.hidden} decided"
            f" pixels, hidden as a test, they decided {self.found} and {recovered:.4g} % of these rightly;"
            f" {100 * self.continuous:.3g} % of the decided pixels lie on the plane of their neighbours,"
            f" within 5 standard errors and a roughness of {self.roughness:.2g} nm"
        )


def row(found: Continuity | None) -> Row:
    """The row "neighbours" of a map's plan; None where the effect is off."""
    if found is None:
        return Row("neighbours", False, "each pixel is decided by its own data")
    return Row("neighbours", found.decided > 0, str(found))


def evidence(dataset: Any) -> Continuity | None:
    """Read the decisions by neighbours from a map's dataset; None where they were not asked."""
    text = dataset.attrs.get("neighbours")
    return None if text is None else Continuity(**json.loads(text))


def decided_by_neighbours(
    dataset: Any,
    *,
    parameter: str | None = None,
    sites: Sequence[str] = ("x", "y"),
    margin: float = MARGIN,
    limit: float = LIMIT,
) -> Any:
    """Choose the orders of undecided pixels of a map by their neighbours.

    Undecided are ambiguous pixels, and converged ones with a rival within `margin`. Their neighbours are
    those in the image, in time, or the nearest sites. A pixel whose order they decide has the status
    `by-neighbours`; all its numbers are those of the chosen minimum, with negative Δχ² where another fits
    better, except `chi2_reduced` and `rms`, which stay those of the best one. Converged pixels keep their
    status where the neighbours confirm them or are not clear.

    **Arguments:**

    - `dataset`: of a map, with `status`, each parameter, `<parameter>_stderr_noise`, `rival_delta_chi2`,
      `order_<parameter>` and `order_delta_chi2`. Other parameters whose minima were not kept become NaN.
    - `parameter`: name of the thickness, by default the one whose minima lie farthest apart.
    - `sites`: names of the coordinates of a map with an axis `site`.
    - `margin`, `limit`: Δχ² within which a rival makes a pixel undecided, and up to which the neighbours may
      choose.

    **Returns:** a new dataset with the attribute `neighbours` (see `evidence`) and, for the pixels that
    neighbours decided, `neighbours_delta_chi2`, the Δχ² that was set aside, and `neighbours_number`.

    **Raises:** UsageError for a map without a thickness whose minima were kept.

    **Source:** see `pellicle.mapping.unwrapping`.
    """
    names = [str(name).removeprefix("order_") for name in dataset.data_vars if str(name).startswith("order_")]
    names = [name for name in names if name in dataset.data_vars]
    name = parameter or _widest(dataset, names)
    if name is None or f"order_{name}" not in dataset:
        raise UsageError("neighbours choose between the minima of a thickness, and this map has kept none")
    status = np.asarray(dataset["status"])
    shape, state = status.shape, status.ravel()
    near = neighbourhood(dataset, tuple(map(str, dataset["status"].dims)), sites)
    thickness = np.asarray(dataset[name], float).ravel()
    stderr = np.asarray(dataset[f"{name}_stderr_noise"], float).ravel()
    rival = np.nan_to_num(np.asarray(dataset["rival_delta_chi2"], float).ravel(), nan=np.inf)
    known = np.isfinite(thickness) & np.isfinite(stderr)
    converged, again = state == CODES["converged"], state == CODES[BY_NEIGHBOURS]
    undecided = known & ((state == CODES["ambiguous"]) | (converged & (rival < margin)) | again)
    decided = known & converged & ~undecided
    present = undecided | decided | (state == CODES["at-bound"])
    pixels = np.flatnonzero(undecided)
    field, continuous = field_of(thickness, stderr, decided, present, near)

    hidden, found, wrong = _tested(dataset, name, field, near)
    # odds of a right order (Jeffreys' rule): neighbours outweigh no more Δχ² than they are seen to be worth
    weight = max(2 * math.log((found - wrong + 0.5) / (wrong + 0.5)), 0.0)

    minima, delta = minima_at(dataset, name, pixels)
    least = delta.min(axis=1, keepdims=True, initial=np.inf)  # not the answer's, where neighbours chose it
    delta = delta - np.where(np.isfinite(least), least, 0.0)
    best = np.argmin(delta, axis=1) if len(pixels) else np.empty(0, int)
    choice = grow(field, near, pixels, minima, np.where(delta <= limit, delta, np.inf), weight)
    changes = (choice.order >= 0) & ((choice.order != best) | ~converged[pixels])
    chosen, order, number = pixels[changes], choice.order[changes], choice.number[changes]
    overruled = delta[changes, order]
    against = overruled[overruled > 0]
    result = Continuity(
        undecided=len(pixels),
        decided=len(chosen),
        changed=len(against),
        overruled=float(against.max(initial=0.0)),
        median_overruled=float(np.median(against)) if len(against) else 0.0,
        neighbours=int(np.median(number)) if len(number) else 0,
        hidden=hidden,
        found=found,
        wrong=wrong,
        continuous=continuous if math.isfinite(continuous) else 0.0,
        roughness=field.roughness,
        weight=weight,
        margin=margin,
        limit=limit,
    )
    log.info("neighbours: %s", result)
    made = exchanged(dataset, names, chosen, order)
    state = state.copy()
    state[chosen] = CODES[BY_NEIGHBOURS]
    made["status"] = made["status"].copy(data=state.reshape(shape))
    for key, numbers, kind, words in (
        ("delta_chi2", overruled, np.float32, "chi-square that the neighbours overruled"),
        ("number", number, np.uint8, "number of decided neighbours on the plane that decided"),
    ):
        flat = np.full(len(state), np.nan if kind == np.float32 else 0, kind)
        flat[chosen] = numbers
        made[f"neighbours_{key}"] = (dataset["status"].dims, flat.reshape(shape), {"long_name": words})
    made.attrs["neighbours"] = json.dumps(asdict(result))
    return made


def neighbourhood(dataset: Any, dims: tuple[str, ...], sites: Sequence[str] = ("x", "y")) -> Neighbourhood:
    """The neighbours of the pixels of a map with these `dims`; a map of sites has their coordinates `sites`.

    **Raises:** UsageError for sites without coordinates.
    """
    shape = tuple(dataset.sizes[dim] for dim in dims)

    def position(dim: str) -> np.ndarray | None:
        along = dataset.coords.get(dim)
        if along is None or along.dtype.kind not in "iufmM":
            return None
        return np.asarray(along.values).astype(float)

    if "site" not in dims:
        return grid(shape, tuple(map(position, dims)))
    present = [name for name in sites if name in dataset.coords and dataset[name].dims == ("site",)]
    if not present:
        raise UsageError(
            f"sites have neighbours by their coordinates: give {' and '.join(sites)} of each site"
        )
    where = np.stack([np.asarray(dataset[key], float) for key in present], axis=-1)
    rest = tuple(position(dim) for dim in dims if dim != "site")
    return scattered(shape, dims.index("site"), where, rest)


def _widest(dataset: Any, names: list[str]) -> str | None:
    """The thickness whose minima lie farthest apart."""
    thicknesses = [name for name in names if name.split("_")[-1] == "thickness"]

    def spread(name: str) -> float:
        minima = np.asarray(dataset[f"order_{name}"][..., :2], float)
        return float(np.nanmax(np.abs(minima[..., 1:] - minima[..., :1]), initial=0.0))

    return max(thicknesses, key=spread) if len(thicknesses) > 1 else next(iter(thicknesses), None)


def _tested(dataset: Any, name: str, field: Field, near: Neighbourhood) -> tuple[int, int, int]:
    """Hide decided pixels and seek their orders by their neighbours alone, a tenth of the map at a time.

    Returns how many were hidden, for how many of those with several minima neighbours chose one, and for how
    many of these not their own. The pixels are hidden in patches, the same for the same map.
    """
    pixels = np.flatnonzero(field.decided)
    if not len(pixels):
        return 0, 0, 0
    place = np.unravel_index(pixels, near.shape)
    width = [1 if axis == near.site_axis else _PATCH for axis in range(len(near.shape))]
    patch = np.ravel_multi_index(tuple(p // w for p, w in zip(place, width, strict=True)), near.shape)
    patches = np.random.default_rng(0).permutation(np.unique(patch))
    share = min(_SHARE, _HIDDEN / len(pixels))
    counts = np.zeros(3, int)
    for part in np.array_split(patches, math.ceil(1 / share)):
        hidden = pixels[np.isin(patch, part)]
        decided = field.decided.copy()
        decided[hidden] = False
        minima, delta = minima_at(dataset, name, hidden)
        known = np.isfinite(delta)
        choice = grow(
            field._replace(decided=decided), near, hidden, minima, np.where(known, 0.0, np.inf), np.inf
        )
        chosen = choice.order[known.sum(axis=1) > 1]
        counts += len(hidden), np.count_nonzero(chosen >= 0), np.count_nonzero(chosen > 0)
        if counts[0] >= _HIDDEN:
            break
    hidden, found, wrong = map(int, counts)
    return hidden, found, wrong
