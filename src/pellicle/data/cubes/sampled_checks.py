"""Checks of a cube on a sample of its pixels: dead bands, counts, percent, radians, zeros.

The sample has some blocks in a grid, so that memory and time do not grow with the cube.
"""

import itertools
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from pellicle.errors import DataError
from pellicle.signals.limits import DELTA, HIGHEST, LOWEST, PSI

WHOLE = 1_000_000
"""Values up to which a cube is checked whole."""
_BLOCKS = {1: (16,), 2: (5, 5), 3: (3, 4, 4)}
_WIDTHS = {1: (64,), 2: (8, 8), 3: (1, 8, 8)}
_SHARE = 0.95
"""Quantile of the values that must be possible: some pixels may be dead, hot or glare."""
_FEWEST = 30
"""Pixels with values that show a band to be dead; a few may be saturated there."""
_PERCENT = 200.0
"""Values with a larger quantile are counts rather than percent."""


def sample_blocks(sizes: tuple[int, ...], points: int) -> Iterator[tuple[slice, ...]]:
    """Blocks of pixels across a cube: all of a small one."""
    rank = len(sizes)
    if int(np.prod(sizes)) * points <= WHOLE:
        yield (slice(None),) * rank
        return
    axes = []
    for size, count, width in zip(sizes, _BLOCKS[rank], _WIDTHS[rank], strict=True):
        starts = np.unique(np.linspace(0, max(size - width, 0), count).astype(int))
        axes.append([slice(int(start), int(start) + width) for start in starts])
    yield from itertools.product(*axes)


def sample(arrays: Mapping[str, Any], rank: int, mask: np.ndarray | None = None) -> dict[str, np.ndarray]:
    """Sampled values (pixels, bands, ...) by name, NaN outside the mask.

    `rank` is the number of axes of pixels. Where the sample has no values, as of a small film on a large
    background, the cube is read line by line up to the first that has some.
    """
    shape = tuple(next(iter(arrays.values())).shape)
    sizes, points = shape[:rank], int(np.prod(shape[rank:]))
    seen = _read(arrays, mask, list(sample_blocks(sizes, points)), shape[rank:])
    if int(np.prod(sizes)) * points <= WHOLE:
        return seen
    lines = itertools.product(*(range(n) for n in sizes[:-1]))
    while not _measured(seen) and (line := next(lines, None)):
        where = (*(slice(i, i + 1) for i in line), slice(None))
        seen = _read(arrays, mask, [where], shape[rank:])
    return seen


def _measured(seen: Mapping[str, np.ndarray]) -> bool:
    values = next(iter(seen.values()))
    return bool(np.any(np.isfinite(values) & (values != 0)))


def _read(
    arrays: Mapping[str, Any],
    mask: np.ndarray | None,
    blocks: list[tuple[slice, ...]],
    points: tuple[int, ...],
) -> dict[str, np.ndarray]:
    """Values of some blocks."""
    values = {
        name: np.concatenate([np.asarray(array[w], dtype=float).reshape(-1, *points) for w in blocks])
        for name, array in arrays.items()
    }
    if mask is None:
        return values
    used = np.concatenate([mask[where].reshape(-1, *[1] * len(points)) for where in blocks])
    return {name: np.where(used, array, np.nan) for name, array in values.items()}


def check_type(dtype: Any, path: str) -> None:
    """Raise DataError unless values are real numbers."""
    kind = np.dtype(dtype).kind
    if kind == "c":
        raise DataError(
            f"{path}: has complex values, and a measured signal is real: store the power |r|², or psi and "
            "delta"
        )
    if kind not in "fiu":
        raise DataError(f"{path}: has values of the type {dtype}, which are no numbers: store them as floats")


def live_bands(values: np.ndarray, pixels: int, path: str) -> tuple[np.ndarray, list[str]]:
    """Return which bands have values in any sampled pixel, and a note on the others; bands are the axis 1.

    `pixels` are those of the cube: a sample in which few have values leaves all bands. Raises DataError where
    no band has any.
    """
    finite = np.isfinite(values)
    if not finite.any():
        raise DataError(f"{path}: has no values, only NaN, in all pixels looked at: check how it was written")
    if not np.any(values[finite]):
        raise DataError(f"{path}: is zero in all pixels looked at: check how it was written")
    known = finite & (values != 0)
    others = (0, *range(2, values.ndim))
    measured = known.any(others)
    seen = int(np.sum(known.reshape(len(values), -1).any(1)))
    if seen < _FEWEST and len(values) < pixels:
        measured = np.ones_like(measured)
    notes = []
    if not measured.all():
        dead = int(np.sum(~measured))
        notes.append(f"{dead} bands left out, NaN or zero in each of the {seen} pixels looked at")
    return measured, notes


def check_level(values: np.ndarray, signal: str, path: str) -> None:
    """Raise DataError for a reflectance or transmittance that is in percent or in counts, or negative."""
    known = values[np.isfinite(values)]
    high, middle = (float(q) for q in np.quantile(known, [_SHARE, 0.5]))
    word = {"R": "reflectance", "T": "transmittance"}[signal]
    if high > HIGHEST:
        reach = (
            f"{path}: its {word} reaches {known.max():.4g}, with {100 - 100 * _SHARE:.0f} % above {high:.4g}"
        )
        if high <= _PERCENT:
            raise DataError(
                f'{reach}, which looks like percent: give `signal_unit="percent"`, or for counts '
                "`white_frame` "
                "and `dark_frame`"
            )
        raise DataError(
            f"{reach}, which looks like counts of a camera: give `white_frame` and `dark_frame`, or the "
            "number that stands for 1 as `signal_unit`"
        )
    if middle < LOWEST:
        raise DataError(
            f"{path}: its {word} is below zero in half of the values looked at ({middle:.3g} in the "
            "median): check the subtraction of the dark"
        )


def check_angles(psi: np.ndarray, delta: np.ndarray, path: str) -> None:
    """Raise DataError for Ψ and Δ beyond their limits in degrees, or in radians."""
    for name, values, limits in (("psi", psi, PSI), ("delta", delta, DELTA)):
        known = values[np.isfinite(values)]
        if not known.size:
            raise DataError(f"{path}: {name} has no values, only NaN, in all pixels looked at")
        low, high = np.quantile(known, [1 - _SHARE, _SHARE])
        if low < limits[0] or high > limits[1]:
            raise DataError(
                f"{path}: {name} runs from {known.min():.4g} to {known.max():.4g}, beyond {limits[0]:g} to "
                f"{limits[1]:g} degrees: correct it, or choose another `variable`"
            )
    if np.nanmax(psi) <= np.pi / 2 and np.nanmax(np.abs(delta)) <= 2 * np.pi:
        raise DataError(
            f"{path}: psi up to {np.nanmax(psi):.3g} and delta up to {np.nanmax(np.abs(delta)):.3g} look "
            "like radians: convert them to degrees"
        )
