"""Continuity of a map: the order of interference of undecided pixels by that of their neighbours.

An effect of the map's plan, off unless asked for. A pixel that its own data decide keeps its answer, and
nothing is decided across a gap. How far neighbours can be trusted is measured on the map itself: the answers
of decided pixels are hidden in patches and sought again from what lies around them.
"""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass
from logging import getLogger
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from pellicle.errors import UsageError
from pellicle.fitting.batch.data import BY_NEIGHBOURS, CODES
from pellicle.forward_model.plan import Row
from pellicle.mapping.unwrapping import Field, Neighbourhood, field_of, grow, neighbourhood

if TYPE_CHECKING:
    from xarray import DataArray, Dataset

log = getLogger(__name__)

MARGIN = 12.0
"""A converged pixel with a rival within this Δχ² is undecided: its odds are below exp(12/2), 400 to 1, and
maps have more pixels than that."""
LIMIT = 25.0
"""Largest Δχ² of a minimum that neighbours may choose."""
_READ = 2_000_000
"""Numbers of a variable that are read at a time."""
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
        overruled = f", {self.changed} of them against a Δχ² of up to {self.overruled:.2g}"
        against = overruled if self.changed else ""
        return (
            f"{self.decided} of {self.undecided} {unclear} take the order of their neighbours{against};"
            f" of {self.hidden} decided pixels, hidden as a test, they decided {self.found} and"
            f" {recovered:.4g} % of these rightly;"
            f" {100 * self.continuous:.3g} % of the decided pixels lie on the plane of their neighbours,"
            f" within 5 standard errors and a roughness of {self.roughness:.2g} nm"
        )


def row(continuity: Continuity | None) -> Row:
    """The row "neighbours" of a map's plan; None where the effect is off."""
    if continuity is None:
        return Row("neighbours", False, "each pixel is decided by its own data")
    return Row("neighbours", continuity.decided > 0, str(continuity))


def record_of(effect: Row) -> dict[str, Any]:
    """A row of a plan as in the record of a fit."""
    error = effect.error_bound if math.isfinite(effect.error_bound) else None
    return {"effect": effect.effect, "on": bool(effect.on), "why": effect.why, "error_bound": error}


def evidence(dataset: Dataset) -> Continuity | None:
    """Read the decisions by neighbours from a map's dataset; None where they were not asked."""
    text = dataset.attrs.get("neighbours")
    return None if text is None else Continuity(**json.loads(text))


def decided_by_neighbours(
    dataset: Dataset,
    *,
    limit: float = LIMIT,
) -> Dataset:
    """Choose the orders of undecided pixels of a map by their neighbours.

    Undecided are ambiguous pixels, and converged ones with a rival within `MARGIN`. Their neighbours are
    those in the image, in time, or the nearest sites by their coordinates x and y. A pixel whose order they
    decide has the status `by-neighbours`; all its numbers are those of the chosen minimum, with negative Δχ²
    where another fits better, except `chi2_reduced` and `rms`, which stay those of the best one. Converged
    pixels keep their status where the neighbours confirm them or are not clear.

    **Arguments:**

    - `dataset`: of a map, with `status`, each parameter, `<parameter>_stderr_noise`, `rival_delta_chi2`,
      `order_<parameter>` and `order_delta_chi2`. Other parameters whose minima were not kept become NaN. The
      thickness is the one whose minima lie farthest apart.
    - `limit`: Δχ² up to which the neighbours may choose.

    **Returns:** a new dataset with the attribute `neighbours` (see `evidence`) and, for the pixels that
    neighbours decided, `neighbours_delta_chi2`, the Δχ² that was set aside, and `neighbours_number`.

    **Raises:** UsageError for a map without a thickness whose minima were kept, and for sites without
    coordinates.
    """
    names = [str(name).removeprefix("order_") for name in dataset.data_vars if str(name).startswith("order_")]
    names = [name for name in names if name in dataset.data_vars]
    thicknesses = [name for name in names if name.split("_")[-1] == "thickness"]
    if not thicknesses:
        raise UsageError("neighbours choose between the minima of a thickness, and this map has kept none")
    name = max(thicknesses, key=lambda name: _distance_of_minima(dataset, name))
    near = _neighbourhood(dataset)
    pixels, field, continuous = _field(dataset, name, near)
    test = _hidden_test(dataset, name, field, near)
    choice = _choice(dataset, name, pixels, field, near, limit, test["weight"])
    against = choice.overruled[choice.overruled > 0]
    result = Continuity(
        undecided=len(pixels),
        decided=len(choice.pixels),
        changed=len(against),
        overruled=float(against.max(initial=0.0)),
        median_overruled=float(np.median(against)) if len(against) else 0.0,
        neighbours=int(np.median(choice.number)) if len(choice.number) else 0,
        continuous=continuous if math.isfinite(continuous) else 0.0,
        roughness=field.roughness,
        margin=MARGIN,
        limit=limit,
        **test,
    )
    log.info("neighbours: %s", result)
    return _with_choice(dataset, names, choice, result)


def _distance_of_minima(dataset: Dataset, name: str) -> float:
    """Largest distance of the two best minima of a pixel in a parameter."""
    minima = np.asarray(dataset[f"order_{name}"][..., :2], float)
    return float(np.nanmax(np.abs(minima[..., 1:] - minima[..., :1]), initial=0.0))


def _neighbourhood(dataset: Dataset) -> Neighbourhood:
    """The neighbours of the pixels of a map; a map of sites has their coordinates. Raises UsageError."""
    dims = tuple(map(str, dataset["status"].dims))
    shape = tuple(dataset.sizes[dim] for dim in dims)
    along = [dataset.coords.get(dim) for dim in dims if dim != "site"]
    ordered = tuple(
        None if array is None or array.dtype.kind not in "iufmM" else np.asarray(array.values).astype(float)
        for array in along
    )
    if "site" not in dims:
        return neighbourhood(shape, ordered)
    present = [name for name in ("x", "y") if name in dataset.coords and dataset[name].dims == ("site",)]
    if not present:
        raise UsageError("sites have neighbours by their coordinates: give x and y of each site")
    where = np.stack([np.asarray(dataset[key], float) for key in present], axis=-1)
    return neighbourhood(shape, ordered, dims.index("site"), where)


def _field(dataset: Dataset, name: str, near: Neighbourhood) -> tuple[np.ndarray, Field, float]:
    """Flat positions of the undecided pixels, the field of the decided ones, and the share on its planes."""
    state = np.asarray(dataset["status"]).ravel()
    thickness, stderr, rival = (
        np.asarray(dataset[key], float).ravel() for key in (name, f"{name}_stderr_noise", "rival_delta_chi2")
    )
    known = np.isfinite(thickness) & np.isfinite(stderr)
    close = np.nan_to_num(rival, nan=np.inf) < MARGIN
    converged, again = state == CODES["converged"], state == CODES[BY_NEIGHBOURS]
    undecided = known & ((state == CODES["ambiguous"]) | (converged & close) | again)
    decided = known & converged & ~undecided
    present = undecided | decided | (state == CODES["at-bound"])
    return np.flatnonzero(undecided), *field_of(thickness, stderr, decided, present, near)


class _Decisions(NamedTuple):
    """Flat positions of pixels that neighbours decide, their orders, Δχ² set aside, numbers of neighbours."""

    pixels: np.ndarray
    order: np.ndarray
    overruled: np.ndarray
    number: np.ndarray


def _choice(
    dataset: Dataset,
    name: str,
    pixels: np.ndarray,
    field: Field,
    near: Neighbourhood,
    limit: float,
    weight: float,
) -> _Decisions:
    """Orders of undecided pixels, where neighbours change their answer or decide between equals."""
    minima, delta = minima_at(dataset, name, pixels)
    least = delta.min(axis=1, keepdims=True, initial=np.inf)  # not the answer's, where neighbours chose it
    delta = delta - np.where(np.isfinite(least), least, 0.0)
    best = np.argmin(delta, axis=1) if len(pixels) else np.empty(0, int)
    choice = grow(field, near, pixels, minima, np.where(delta <= limit, delta, np.inf), weight)
    converged = np.asarray(dataset["status"]).ravel()[pixels] == CODES["converged"]
    changes = (choice.order >= 0) & ((choice.order != best) | ~converged)
    order = choice.order[changes]
    return _Decisions(pixels[changes], order, delta[changes, order], choice.number[changes])


def _with_choice(dataset: Dataset, names: list[str], choice: _Decisions, result: Continuity) -> Dataset:
    """The dataset with these decisions, in its plan too."""
    made = exchanged(dataset, names, choice.pixels, choice.order)
    status = np.array(dataset["status"])
    status.ravel()[choice.pixels] = CODES[BY_NEIGHBOURS]
    made["status"] = made["status"].copy(data=status)
    for key, numbers, empty, words in (
        ("delta_chi2", choice.overruled, np.float32(np.nan), "chi-square that the neighbours overruled"),
        ("number", choice.number, np.uint8(0), "number of decided neighbours on the plane that decided"),
    ):
        flat = np.full(status.size, empty)
        flat[choice.pixels] = numbers
        made[f"neighbours_{key}"] = (dataset["status"].dims, flat.reshape(status.shape), {"long_name": words})
    made.attrs["neighbours"] = json.dumps(asdict(result))
    if "plan" in made.attrs:
        others = [effect for effect in json.loads(made.attrs["plan"]) if effect["effect"] != "neighbours"]
        made.attrs["plan"] = json.dumps([*others, record_of(row(result))])
    return made


def _hidden_test(dataset: Dataset, name: str, field: Field, near: Neighbourhood) -> dict[str, Any]:
    """Hide decided pixels and seek their orders by their neighbours alone, a tenth of the map at a time.

    The pixels are hidden in patches, the same for the same map. Returns the fields of `Continuity` on them.
    """
    pixels = np.flatnonzero(field.decided)
    place = np.unravel_index(pixels, near.shape)
    width = [1 if axis == near.site_axis else _PATCH for axis in range(len(near.shape))]
    patch = np.ravel_multi_index(tuple(p // w for p, w in zip(place, width, strict=True)), near.shape)
    patches = np.random.default_rng(0).permutation(np.unique(patch))
    share = min(_SHARE, _HIDDEN / max(len(pixels), 1))
    counts = np.zeros(3, int)
    for part in np.array_split(patches, math.ceil(1 / share)):
        hidden = pixels[np.isin(patch, part)]
        decided = field.decided.copy()
        decided[hidden] = False
        minima, delta = minima_at(dataset, name, hidden)
        known = np.isfinite(delta)
        free = field._replace(decided=decided)
        choice = grow(free, near, hidden, minima, np.where(known, 0.0, np.inf), np.inf)
        chosen = choice.order[known.sum(axis=1) > 1]
        counts += len(hidden), np.count_nonzero(chosen >= 0), np.count_nonzero(chosen > 0)
        if counts[0] >= _HIDDEN:
            break
    tried, found, wrong = map(int, counts)
    # they are worth no more than they are seen to be: odds of a right order by Jeffreys' rule, as Δχ²
    weight = max(2 * math.log((found - wrong + 0.5) / (wrong + 0.5)), 0.0)
    return {"hidden": tried, "found": found, "wrong": wrong, "weight": weight}


def minima_at(dataset: Dataset, name: str, pixels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Thickness and Δχ² (pixels, orders) of the minima of some pixels, in increasing flat order."""
    thickness, delta = (_read(dataset[key], pixels) for key in (f"order_{name}", "order_delta_chi2"))
    return thickness, np.where(np.isfinite(thickness) & ~np.isnan(delta), delta, np.inf)


def _read(array: DataArray, pixels: np.ndarray) -> np.ndarray:
    """Rows (pixels, orders) of an array (*map, orders), a slab at a time: it may be larger than memory."""
    rows = int(np.prod(array.shape[1:-1], dtype=int))
    slab = max(1, _READ // max(rows * array.shape[-1], 1))
    read = np.empty((len(pixels), array.shape[-1]))
    for first in range(0, array.shape[0], slab):
        low, high = np.searchsorted(pixels, [first * rows, (first + slab) * rows])
        if high > low:
            part = np.asarray(array[first : first + slab], float).reshape(-1, array.shape[-1])
            read[low:high] = part[pixels[low:high] - first * rows]
    return read


def exchanged(dataset: Dataset, names: list[str], pixels: np.ndarray, order: np.ndarray) -> Dataset:
    """The dataset with the chosen minimum of each pixel as its answer, and the former answer as its rival."""
    made = dataset.copy()
    kept = dataset["order_delta_chi2"]
    orders = kept.shape[-1]
    rank = np.tile(np.arange(orders), (len(pixels), 1))
    rank = np.concatenate([order[:, None], rank[rank != order[:, None]].reshape(-1, orders - 1)], axis=1)
    swap, line = order > 0, np.arange(len(pixels))[:, None]

    where = np.unravel_index(pixels[swap], dataset["status"].shape)

    def put(key: str, rows: Any) -> None:
        """Replace the rows of the pixels whose minimum changes."""
        made[key] = dataset[key].copy(data=_replaced(dataset[key].data, where, np.asarray(rows)[swap]))

    delta = _read(kept, pixels)[line, rank]
    put("order_delta_chi2", delta - delta[:, :1])
    if "rival_delta_chi2" in dataset:
        put("rival_delta_chi2", delta[:, 1] - delta[:, 0])
    for key in dataset.data_vars:
        name = str(key)
        if f"{name}_stderr_noise" not in dataset:
            continue
        if name in names:
            minima = _read(dataset[f"order_{name}"], pixels)[line, rank]
            put(f"order_{name}", minima)
            put(name, minima[:, 0])
            if f"rival_{name}" in dataset:
                put(f"rival_{name}", minima[:, 1])
        else:
            for other in (name, f"{name}_stderr", f"{name}_stderr_noise"):
                put(other, np.full(len(pixels), np.nan))
    return made


def _replaced(array: Any, where: tuple[np.ndarray, ...], rows: np.ndarray) -> Any:
    """An array with other rows at some pixels; a dask array is changed chunk by chunk when it is computed."""

    def in_chunk(chunk: np.ndarray, block_info: Any = None) -> np.ndarray:
        """A chunk with its rows replaced, which dask places by `block_info`."""
        if not block_info or not chunk.size:
            return chunk
        low, high = np.array(block_info[0]["array-location"])[: len(where)].T
        place = np.stack(where, axis=-1)
        inside = np.all((place >= low) & (place < high), axis=1)
        changed = chunk.copy()
        changed[tuple((place[inside] - low).T)] = rows[inside]
        return changed

    if hasattr(array, "map_blocks"):
        return array.map_blocks(in_chunk, dtype=array.dtype)
    whole = np.array(array)
    whole[where] = rows
    return whole
