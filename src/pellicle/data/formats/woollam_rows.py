"""Columns of the rows of Woollam's text files: Ψ and Δ, also generalised, tan Ψ and cos Δ, depolarisation,
reflectance.

Each function takes rows of wavelength, angle, values and errors, and returns the names of the columns behind
the wavelength, the rows and sentences on what was done.
"""

import math
from collections import Counter
from typing import NamedTuple

from pellicle.data.formats.exports import Rows, measured
from pellicle.data.tabular.text import Line, is_number
from pellicle.errors import DataError


class Selected(NamedTuple):
    """Names of the columns behind the wavelength, rows, and sentences on them."""

    names: tuple[str, ...]
    rows: Rows
    notes: list[str]


def psi_delta(rows: Rows, path: str, label: str = "") -> Selected:
    """Ψ, Δ and, where they are not all zero, their errors. Raises DataError for rows of other lengths."""
    notes: list[str] = []
    of = f"{label} " if label else ""
    width, odd = len(rows[0][1]), _odd(rows, (4, 6, 8))
    if odd is not None:
        raise DataError(
            f"{path}: looks like a Woollam file, but line {odd} is not wavelength, angle, {of}psi, delta and "
            "their errors, as the other rows; export psi and delta as text, or correct that line"
        )
    if width == 8:  # CompleteEASE and programs of other makers write 1 and 1 there
        rows = [(line, cells[:6]) for line, cells in rows]
        notes.append("2 columns behind the errors ignored")
    rows, missing = measured(rows, (2, 3))
    if not rows:
        raise DataError(f"{path}: has no point with {of}psi and delta; check the measurement")
    names = ("angle_deg", "psi_deg", "delta_deg", "sigma_psi", "sigma_delta")[: len(rows[0][1]) - 1]
    if len(names) == 5 and all(_is(x, 0.0) for _, cells in rows for x in cells[4:]):
        names, rows = names[:3], [(line, cells[:4]) for line, cells in rows]  # as simulations are written
        notes.append("errors that are all zero ignored")
    return Selected(names, rows, [*notes, *missing])


def tan_cos(rows: Rows, path: str) -> Selected:
    """tan Ψ and cos Δ; their errors are left out. Raises DataError for shorter rows."""
    notes = ["errors of tan(psi) and cos(delta) ignored"] if len(rows[0][1]) > 4 else []
    for line, cells in rows:
        if len(cells) < 4:
            raise DataError(
                f"{path}: line {line.number} has {len(cells)} values where wavelength, angle, tan(psi) and "
                "cos(delta) are expected; correct that line"
            )
    rows, missing = measured([(line, cells[:4]) for line, cells in rows], (2, 3))
    if not rows:
        raise DataError(f"{path}: has no point with tan(psi) and cos(delta); check the measurement")
    return Selected(("angle_deg", "tan_psi", "cos_delta"), rows, [*notes, *missing])


def with_depolarisation(selected: Selected, label: str, shares: Rows) -> Selected:
    """Ψ and Δ with the depolarisation of the same points, in percent; without it where points are missing.

    CompleteEASE writes an angle of 0 beside the depolarisation of all points of one angle.
    """
    names, rows, notes = selected

    def without(reason: str) -> Selected:
        return Selected(names, rows, [*notes, f"{label} ignored: {reason}"])

    if any(len(cells) not in (3, 4) for _, cells in shares):
        return without("its rows are not wavelength, angle, a value and its error")
    one_angle = len({cells[1] for _, cells in rows}) == 1 and all(_is(cells[1], 0.0) for _, cells in shares)
    values = [cells[2:] for _, cells in shares]
    by_point = dict(zip(_points(shares, one_angle), values, strict=True))
    beside = [by_point.get(point, []) for point in _points(rows, one_angle)]
    lacking = sum(not cells or not all(map(_finite, cells)) for cells in beside)
    if lacking:
        return without(f"{lacking} of {len(rows)} points have none")
    notes = [*notes]
    if len(shares) > len(rows):
        notes.append(f"{len(shares) - len(rows)} rows of {label} without psi and delta ignored")
    errors = [cells[1] for cells in beside if len(cells) == 2]
    with_error = len(errors) == len(rows)
    for placeholder in (0.0, 1.0):  # CompleteEASE writes 1 where it has no error
        if with_error and all(_is(error, placeholder) for error in errors):
            with_error = False
            notes.append(f"errors of {label} that are all {placeholder:g} ignored")
    count = 2 if with_error else 1
    own = [(line, [*cells, *more[:count]]) for (line, cells), more in zip(rows, beside, strict=True)]
    return Selected((*names, *("depolarisation (%)", "sigma_depolarisation (%)")[:count]), own, notes)


def power(label: str, quantity: str, rows: Rows, path: str) -> Selected | None:
    """A reflectance or transmittance and its error; None for an intensity, whose errors are written as 1.

    Raises DataError for rows of other lengths.
    """
    width, odd = len(rows[0][1]), _odd(rows, (3, 4))
    if odd is not None:
        raise DataError(
            f"{path}: line {odd} is not {label}, wavelength, angle, a value and its error, as the other "
            "rows; correct that line"
        )
    errors = [cells[3] for _, cells in rows] if width == 4 else []
    if errors and all(_is(error, 1.0) for error in errors):
        return None
    names, notes = ("angle_deg", quantity, "sigma")[: width - 1], []
    if errors and all(_is(error, 0.0) for error in errors):
        names, rows = names[:2], [(line, cells[:3]) for line, cells in rows]
        notes.append("errors that are all zero ignored")
    rows, missing = measured(rows, (2,))
    return Selected(names, rows, [*notes, *missing]) if rows else None


def generalised(groups: dict[str, Rows], path: str) -> Selected:
    """Ψ and Δ of each ratio, one label each, at the points that all have, and their errors.

    Raises DataError for rows of other lengths, and without a point that all ratios have.
    """
    selected = {label: psi_delta(rows, path, label) for label, rows in groups.items()}
    notes = [f"{label}: {note}" for label, of in selected.items() for note in of.notes]
    points, common = _in_common({label: of.rows for label, of in selected.items()}, ", ".join(groups), path)
    notes += common
    with_errors = [len(of.names) == 5 for of in selected.values()]
    if any(with_errors) and not all(with_errors):
        notes.append("errors ignored, which not all ratios have")
    width = 4 if all(with_errors) else 2
    names = ["angle_deg"]
    for label in selected:
        angles = [f"{angle}_{label.lower()}" for angle in ("psi", "delta")]
        names += [f"{name} (deg)" for name in (*angles, *(f"sigma_{name}" for name in angles))][:width]
    rows = [
        (line, [*setting, *(x for label in selected for x in values[label][:width])])
        for line, setting, values in points
    ]
    return Selected(tuple(names), rows, notes)


def mueller(groups: dict[str, Rows], path: str) -> Selected:
    """Elements of a Mueller matrix, one label each, at the points that all have, and their errors.

    Raises DataError for rows of other lengths, and without a point that all elements have.
    """
    by_label, notes = {}, []
    for label, rows in groups.items():
        odd = next((line for line, cells in rows if len(cells) not in (3, 4)), None)
        if odd is not None:
            raise DataError(
                f"{path}: line {odd.number} is not {label}, wavelength, angle, a value and its error; "
                "correct that line"
            )
        by_label[label], missing = measured(rows, (2,))
        notes += [f"{label}: {note}" for note in missing]
    points, common = _in_common(by_label, "its Mueller elements", path)
    errors = [cells[3:] for rows in by_label.values() for _, cells in rows]
    # 0 and 1 stand for unknown errors
    known = all(errors) and not any(all(_is(error, x) for [error] in errors) for x in (0.0, 1.0))
    with_error = [label for label in by_label if label.lower() != "mm11"] if known else []
    names = ("angle_deg", *by_label, *(f"sigma_{label}" for label in with_error))
    rows = [
        (line, [*setting, *(values[x][0] for x in by_label), *(values[x][1] for x in with_error)])
        for line, setting, values in points
    ]
    return Selected(names, rows, [*notes, *common])


def _in_common(
    groups: dict[str, Rows], subject: str, path: str
) -> tuple[list[tuple[Line, list[str], dict[str, list[str]]]], list[str]]:
    """The points that all labels have: line, wavelength and angle, values of each label; and a note if fewer.

    Raises DataError without such a point.
    """
    by_point = [dict(zip(_points(rows, False), rows, strict=True)) for rows in groups.values()]
    first, *others = by_point
    common = [point for point in first if all(point in other for other in others)]
    if not common:
        raise DataError(f"{path}: {subject} have no point in common; export them together")
    fewer = len(common) < max(map(len, by_point))
    notes = [f"{len(common)} points that {subject} have in common"] if fewer else []
    points = [
        (
            *(first[point][0], first[point][1][:2]),
            {label: of[point][1][2:] for label, of in zip(groups, by_point, strict=True)},
        )
        for point in common
    ]
    return points, notes


def _odd(rows: Rows, widths: tuple[int, ...]) -> int | None:
    """Line of the first row that is not as long as the first, or of the first, if its length is wrong."""
    width = len(rows[0][1])
    other = next((line for line, cells in rows if len(cells) != width), None)
    return (other or rows[0][0]).number if other is not None or width not in widths else None


def _points(rows: Rows, one_angle: bool) -> list[tuple[float | str, float | str, int]]:
    """Key of each row: wavelength, angle, and its number among repeats of both."""
    counts: Counter[tuple[float | str, float | str]] = Counter()
    points = []
    for _, cells in rows:
        wavelength, angle = (float(cell) if is_number(cell) else cell for cell in cells[:2])
        point = (wavelength, "" if one_angle else angle)
        counts[point] += 1
        points.append((*point, counts[point]))
    return points


def _is(cell: str, value: float) -> bool:
    return is_number(cell) and float(cell) == value


def _finite(cell: str) -> bool:
    return is_number(cell) and math.isfinite(float(cell))
