"""Checks of a cube: the wavelengths of its bands, the bands to use, and a sample of its values.

The sample has some blocks of pixels in a grid, so that memory and time do not grow with the cube. It shows
dead bands, counts, percent, radians and zeros.
"""

import itertools
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pellicle.data.spectrum_rows import LONGEST_ASSUMED, SHORTEST_ASSUMED
from pellicle.data.tabular.columns import recognise
from pellicle.data.tabular.units import WAVELENGTH_UNITS, to_nm, wavelength_unit
from pellicle.errors import DataError, UsageError
from pellicle.signals.limits import DELTA, HIGHEST, LOWEST, PSI

_SHORTEST, _LONGEST = 10.0, 1e6
"""Bands in nm outside these limits (soft X-rays, 1 mm) come from a mistaken unit."""
_METRES = ("m", "meter", "meters", "metre", "metres")
_NO_UNIT = ("", "unknown", "index", "none", "-")
_LIKELY = {"µm": (0.1, 30.0), "nm": (100.0, 30000.0), "Å": (1500.0, 20000.0), "cm-1": (300.0, 60000.0)}
"""Limits of visible or near infrared light in each unit."""
_MOST = 100_000
_EXAMPLE = "as in 400:900:5, 450,550,650 or a file with one number a line"
WHOLE = 1_000_000
"""Values up to which a cube is checked whole."""
MOST_SOUGHT = 200_000_000
"""Values that are read in search of one that is not missing: some seconds of a disk."""
_BLOCKS = {1: (16,), 2: (5, 5), 3: (3, 4, 4)}
_WIDTHS = {1: (64,), 2: (8, 8), 3: (1, 8, 8)}
_SHARE = 0.95
"""Quantile of the values that must be possible: some pixels may be dead, hot or glare."""
_FEWEST = 30
"""Pixels with values that show a band to be dead; a few may be saturated there."""
_PERCENT = 200.0
"""Values with a larger quantile are counts rather than percent."""


def parse_wavelengths(value: str | os.PathLike[str] | Sequence[float] | np.ndarray) -> tuple[np.ndarray, str]:
    """Return the wavelengths of `400:900:5`, of `450,550,650`, of a file or of an array, and their unit.

    The unit is empty unless the first line of the file names it. Raises UsageError.
    """
    if not isinstance(value, str | os.PathLike):
        given = np.asarray(value, dtype=float)
        if given.ndim != 1 or not given.size:
            raise UsageError(f"`wavelengths` must be one list of numbers, {_EXAMPLE}")
        return given, ""
    text, unit, words = os.fspath(value), "", []
    if Path(text).is_file():
        if text.endswith(".npy"):
            return np.load(text).astype(float).reshape(-1), ""
        words, unit = _words_of_file(Path(text))
    elif ":" in text:
        try:
            start, stop, step = (float(part) for part in text.split(":"))
            count = round((stop - start) / step)
            if not 1 <= count <= _MOST or abs(start + count * step - stop) > 1e-6 * abs(step):
                raise ValueError
        except (ValueError, ZeroDivisionError):
            raise UsageError(
                f"`wavelengths` {text!r} is not START:STOP:STEP with a whole number of steps: give them "
                f"{_EXAMPLE}"
            ) from None
        return start + step * np.arange(count + 1), ""
    else:
        words = [word for word in text.split(",") if word.strip()]
    try:
        numbers = np.array([float(word) for word in words])
    except ValueError:
        numbers = np.array([])
    if not numbers.size:
        raise UsageError(
            f"`wavelengths` {text!r} is no list of numbers and no file of them: give them {_EXAMPLE}"
        )
    return numbers, unit


def _words_of_file(path: Path) -> tuple[list[str], str]:
    """Numbers of a file, or of the column of wavelengths that its header names, and their unit.

    Raises UsageError for a header of several columns without wavelengths.
    """
    lines = [line.strip() for line in path.read_text("utf-8-sig").splitlines() if line.strip()]
    names, columns, place, delimiter, unit = [], [], 0, None, ""
    if lines and not re.match(r"[\d.]", lines[0]):
        header = lines.pop(0).strip("# ")
        delimiter = next((mark for mark in "\t;," if mark in header), None)
        names = [name.strip().strip('"') for name in header.split(delimiter)] if delimiter else [header]
        if delimiter != ",":  # a comma is a decimal point
            lines = [re.sub(r"(\d),(\d)", r"\1.\2", line) for line in lines]
        columns = [recognise(name) for name in names]
        place = next((i for i, column in enumerate(columns) if column.role == "wavelength"), 0)
        unit = columns[place].unit or ""
    if len(names) < 2:
        return [word for line in lines for word in re.split(r"[\s,;]+", line) if word], unit
    rows = [line.split(delimiter) for line in lines]
    if columns[place].role != "wavelength" or any(len(row) != len(columns) for row in rows):
        raise UsageError(
            f"`wavelengths` {str(path)!r} has several columns, {', '.join(names)}: keep that of the "
            "wavelengths only"
        )
    return [row[place] for row in rows], unit


def in_nm(
    values: np.ndarray, written: str | None, requested: str | None, path: str
) -> tuple[np.ndarray, list[str]]:
    """Convert the wavelengths of bands to nm; returns them in their order, and notes.

    `written` is the unit that the file states, `requested` that of the caller, which is taken first. Raises
    DataError for impossible wavelengths, UsageError for an unknown unit.
    """
    values = np.asarray(values, dtype=float)
    if not values.size:
        raise DataError(f"{path}: has no bands")
    wrong = ~np.isfinite(values) | (values <= 0)
    if np.any(wrong):
        band = int(np.argmax(wrong))
        raise DataError(
            f"{path}: the wavelength of band {band + 1} is {values[band]:g}, not above zero: correct the "
            "file, or give `wavelengths`"
        )
    unit, shown = wavelength_unit(requested) if requested else None, None
    stated = (written or "").strip().lower()
    if requested and unit is None:
        raise UsageError(f"`wavelength_unit` must be one of {', '.join(WAVELENGTH_UNITS)}, not {requested!r}")
    if unit is None and stated in _METRES:
        values, unit, shown = values * 1e9, "nm", "m"
    elif unit is None and stated not in _NO_UNIT:
        unit = wavelength_unit(written or "")
        if unit is None:
            raise DataError(
                f"{path}: its wavelengths are in an unknown unit {written!r}; state one of "
                f"{', '.join(WAVELENGTH_UNITS)} with `wavelength_unit`"
            )
    shortest, longest = (SHORTEST_ASSUMED, LONGEST_ASSUMED) if unit is None else (_SHORTEST, _LONGEST)
    nm = to_nm(values, unit or "nm")
    if nm.min() < shortest or nm.max() > longest:
        low, high = values.min(), values.max()
        likely = [name for name, (least, most) in _LIKELY.items() if least <= low and high <= most]
        raise DataError(
            f"{path}: its wavelengths run from {low:g} to {high:g}"
            + (", which is unlike nm" if unit is None else f" {unit}, which is no wavelength of light")
            + (f" and looks like {' or '.join(likely)}" if likely else "")
            + "; state their unit with `wavelength_unit`"
        )
    _refuse_repeated(nm, path)
    shown = shown or unit or "nm, assumed"
    notes = [f"wavelength unit: {shown}" + ("" if shown.startswith("nm") else ", converted to nm")]
    return nm, notes + ["bands sorted by wavelength"] * bool(np.any(np.diff(nm) < 0))


def _refuse_repeated(nm: np.ndarray, path: str) -> None:
    order = np.argsort(nm, kind="stable")
    same = np.flatnonzero(np.diff(nm[order]) <= 1e-9 * nm.max())
    if same.size:
        first, second = sorted(order[same[0] : same[0] + 2])
        raise DataError(
            f"{path}: bands {first + 1} and {second + 1} have the same wavelength, {nm[first]:.6g} nm: "
            "correct it, or give `wavelengths`"
        )


def chosen_bands(
    nm: np.ndarray,
    range: tuple[float, float] | None,
    without: str | Sequence[tuple[float, float]] | None,
    good: np.ndarray | None,
    path: str,
) -> tuple[np.ndarray, list[str]]:
    """Return the numbers of the bands to use, by increasing wavelength, and notes on those left out."""
    used, notes = np.ones(nm.size, bool), []
    if range is not None:
        used &= (nm >= range[0]) & (nm <= range[1])
    if good is not None and not np.all(good):
        used &= good
        notes.append(f"{_bands(~good)} left out, which the file marks as bad")
    if without is not None:
        dead = np.zeros(nm.size, bool)
        step = np.median(np.abs(np.diff(nm))) if nm.size > 1 else 1.0
        intervals = without
        if isinstance(without, str):
            try:
                edges = [[float(x) for x in word.rstrip(":").split(":", 1)] for word in without.split(",")]
            except ValueError:
                raise UsageError(
                    "`without_bands` must be wavelengths in nm, LO:HI or single ones, as in 755:775,820, not "
                    f"{without!r}"
                ) from None
            intervals = [(edge[0], edge[-1]) for edge in edges]
        for low, high in intervals:
            inside = (nm >= low) & (nm <= high)
            if low == high:
                nearest = np.abs(nm - low)
                inside = (nearest == nearest.min()) & (nearest <= max(step, 1e-6))
            if not inside.any():
                raise UsageError(
                    f"{path}: `without_bands` has no band at {low:g}:{high:g} nm; leave that out"
                )
            dead |= inside
        used &= ~dead
        notes.append(f"{_bands(dead)} left out, as asked")
    if not used.any():
        raise UsageError(
            f"{path}: no band is left of {nm.size} from {nm.min():g} to {nm.max():g} nm: widen `range`, or "
            "leave out fewer bands"
        )
    order = np.argsort(nm, kind="stable")
    return order[used[order]], notes


def _bands(which: np.ndarray) -> str:
    """`1 band`, or `2 bands`."""
    count = int(np.sum(which))
    return f"{count} band" + "s" * (count != 1)


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
    background, lines that lie evenly over the cube are read, up to the first that has some, and at most
    `MOST_SOUGHT` values.
    """
    shape = tuple(next(iter(arrays.values())).shape)
    sizes, points = shape[:rank], int(np.prod(shape[rank:]))
    seen = _read(arrays, mask, list(sample_blocks(sizes, points)), shape[rank:])
    if int(np.prod(sizes)) * points <= WHOLE:
        return seen
    lines = np.arange(int(np.prod(sizes[:-1])))
    if mask is not None:
        lines = lines[mask.reshape(lines.size, -1).any(1)]
    most = max(1, MOST_SOUGHT // (sizes[-1] * points))
    for line in lines[:: -(-lines.size // most) or 1]:
        values = next(iter(seen.values()))
        if np.any(np.isfinite(values) & (values != 0)):
            break
        where = (*(slice(i, i + 1) for i in np.unravel_index(line, sizes[:-1])), slice(None))
        seen = _read(arrays, mask, [where], shape[rank:])
    return seen


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
        none = "has no values, only NaN,"
    elif not np.any(values[finite]):
        none = "is zero"
    else:
        none = ""
    if none:
        small = ", or name the film's pixels with `mask`" if pixels > len(values) else ""
        raise DataError(f"{path}: {none} in all pixels looked at: check how it was written{small}")
    known = finite & (values != 0)
    others = (0, *range(2, values.ndim))
    measured = known.any(others)
    seen = int(np.sum(known.reshape(len(values), -1).any(1)))
    if seen < _FEWEST and len(values) < pixels:
        measured = np.ones_like(measured)
    notes = []
    if not measured.all():
        notes.append(f"{_bands(~measured)} left out, NaN or zero in each of the {seen} pixels looked at")
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
