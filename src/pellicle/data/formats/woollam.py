"""Text files of Woollam's WVASE and CompleteEASE.

Lines of heading (a title, `VASEmethod[...]`, `Original[...]`, `Dynamic`), a line with the unit of the axis
(`nm`, `Angstroms`, `eV`, `1/cm`), then rows of wavelength, angle of incidence, values and usually their
errors. A label before a row names its quantity: `E` or none is Ψ and Δ, `dpolE` the depolarisation in
percent, `AnE`, `Aps` and `Asp` generalised Ψ and Δ (`signals.generalised`), `mm12` an element of a normalised
Mueller matrix, `pR`, `sR`, `uR`, `pT`, `sT`, `uT` a reflectance
or transmittance of p, s or unpolarised light. Rows of dynamic data end with their time in minutes. The layout
is that of files of both programs.
"""

import math
import re
from collections import Counter, defaultdict
from collections.abc import Sequence
from typing import NamedTuple

from pellicle.data.formats.exports import Rows, measured
from pellicle.data.tabular.table import Table, plain_columns
from pellicle.data.tabular.text import Line, TextFile, is_number
from pellicle.data.tabular.units import wavelength_unit
from pellicle.errors import DataError

METHOD = "VASEmethod["
LABEL = "E"  # rows of Ψ and Δ
DEPOLARISATION = "dpole"  # in lower case; programs write dpolE and dPolE
TRIGONOMETRIC = "TRIG"  # behind the unit: tan Ψ and cos Δ in place of Ψ and Δ
NOTE = "read as a Woollam (WVASE, CompleteEASE) text file"
NAMES = ["PSI", "DELTA"]
"""Behind the unit in files that programs for other instruments write for WVASE; the angle has no name."""
_BEHIND_UNIT = ([], [TRIGONOMETRIC], NAMES)
_POWERS = {f"{p}{q}": q if p == "u" else f"{q}{p}" for p in "psu" for q in "RT"}
"""Labels of reflectances and transmittances, and the column names of these."""
_KNOWN = re.compile(r"(?i:dpole|AnE|Aps|Asp|mm[1-4][1-4])|E|[psu][RT][rb]?|R[ps][ps]|T[ps][ps]")
_OTHERS = {
    **dict.fromkeys(_POWERS, "intensities, with errors of 1"),
    r"(?i:AnE|Aps|Asp)": "generalised ellipsometry in transmission",
    r"[psu][RT][rb]": "measurements from the back",
}
"""Labels of rows that are not read, and what they are."""
_FACTS = {
    "software": r"\b((?:WVASE|CompleteEASE)=[\d.]+)",
    "date": r"\b((?:Mon|Tue|Wed|Thu|Fri|Sat|Sun) [A-Z][a-z]{2} +\d+ [\d:]+ \d{4})",
}
_MOST_HEADING = 50  # lines that are searched for the unit
_MOST_LISTED = 8


class Selected(NamedTuple):
    """Names of the columns behind the wavelength, rows, sentences on them; the quantity, "" for Ψ and Δ."""

    names: Sequence[str]
    rows: Rows
    notes: list[str]
    quantity: str = ""


def read(file: TextFile) -> list[Table] | None:
    """Return a table for each quantity (and time) that can be fitted, or None for another format.

    Raises DataError where the file has none.
    """
    lines = file.lines
    place = _unit_line(lines)
    if place is None:
        return None
    heading, unit = lines[:place], lines[place].text.upper().split()
    method = next((line.text for line in heading if line.text.startswith(METHOD)), "")
    rows = [(line, _cells(line)) for line in lines[place + 1 :] if line.bare.strip()]
    if not (method or unit[1:] or any(_KNOWN.fullmatch(cells[0]) for _, cells in rows)):
        return None
    dynamic = any(line.text.strip().lower() == "dynamic" for line in heading)
    transmitted = "TransmissionMeas=1" in method.replace(" ", "")
    facts = [("format", "Woollam text")]
    facts += [(key, match[1]) for key, text in _FACTS.items() if (match := re.search(text, method))]
    if heading and not heading[0].text.startswith((METHOD, "Original[")):
        facts.append(("sample", heading[0].text.strip()))
    facts += [("light", "transmitted")] if transmitted else []
    axis = f"wavelength ({wavelength_unit(unit[0])})"
    kept, left_out = [], {}
    for time, groups in _by_time(rows, dynamic).items():
        name = f"{time} min" if dynamic else ""
        kept += [(name, one) for one in _spectra(groups, TRIGONOMETRIC in unit, transmitted)]
        left_out |= dict.fromkeys(groups)
    kinds, described = defaultdict(list), []
    for label in left_out:
        kind = next((text for pattern, text in _OTHERS.items() if re.fullmatch(pattern, label)), "")
        kinds[kind].append(label)
    for kind, labels in kinds.items():
        listed = ", ".join([*labels[:_MOST_LISTED], *["..."] * (len(labels) > _MOST_LISTED)])
        described.append(f"{kind} ({listed})" if kind else listed)
    ignored = "; ".join(described)
    if not kept:
        raise DataError(
            f"looks like a Woollam file, but has no psi and delta, reflectance or transmittance, "
            f"only {ignored or 'a heading'}; export psi and delta as text"
        )
    said = [f"rows of other quantities ignored: {ignored}"] if ignored else []
    tables = []
    for time, (names, points, notes, quantity) in kept:
        name = f"{time} {quantity}".strip() if dynamic else ""
        tables.append(plain_columns((axis, *names), points, [NOTE, *notes, *said], name=name, facts=facts))
    return tables


def _unit_line(lines: Sequence[Line]) -> int | None:
    """Index of the line with nothing but the axis's unit, above rows of numbers."""
    for i, line in enumerate(lines[: min(_MOST_HEADING, len(lines) - 1)]):
        words, below = line.text.upper().split(), _cells(lines[i + 1])
        is_unit = words[1:] in _BEHIND_UNIT and wavelength_unit(words[0])
        if is_unit and len(below) >= 4 and is_number(below[1]):
            return i
    return None


def _cells(line: Line) -> list[str]:
    """The cells of a row; a comma can only be a decimal mark between tabs or blanks."""
    return line.bare.replace(",", ".").split()


def _by_time(rows: Rows, dynamic: bool) -> dict[str, dict[str, Rows]]:
    """The rows of each time and label, without both, in the order of the file.

    The time of static data is "".
    """
    times: dict[str, dict[str, Rows]] = defaultdict(lambda: defaultdict(list))
    firsts = {cells[0] for _, cells in rows}
    labels = {first for first in firsts if first[0].isalpha() and not is_number(first)}
    for line, cells in rows:
        label, time = LABEL, ""
        if cells[0] in labels:
            label, *cells = cells
        if dynamic:
            if len(cells) not in (5, 7) or not is_number(cells[-1]):
                raise DataError(
                    f"line {line.number} of dynamic data does not end with its time behind "
                    f"wavelength, angle, values and errors: {len(cells)} values; correct that line"
                )
            *cells, time = cells
        times[time][label].append((line, cells))
    return times


def _spectra(groups: dict[str, Rows], trigonometric: bool, transmitted: bool) -> list[Selected]:
    """The spectra of one time. Labels that are read leave `groups`."""
    spectra: list[Selected] = []
    if LABEL in groups and trigonometric:
        spectra.append(_tan_cos(groups.pop(LABEL)))
    elif LABEL in groups:
        spectra.append(_psi_delta(groups.pop(LABEL)))
        shares = next((label for label in groups if label.lower() == DEPOLARISATION), None)
        if shares is not None:
            spectra = [_with_depolarisation(spectra[0], shares, groups.pop(shares))]

    def take(pattern: str) -> dict[str, Rows]:
        return {label: groups.pop(label) for label in tuple(groups) if re.fullmatch(pattern, label)}

    others = []
    if not (transmitted or trigonometric) and (ratios := take(r"(?i:AnE|Aps|Asp)")):
        others.append(("generalised psi and delta", ratios, _generalised(ratios)))
    if not transmitted and any(re.fullmatch(r"(?i:mm(?!11)[1-4][1-4])", label) for label in groups):
        elements = take(r"(?i:mm[1-4][1-4])")
        others.append(("Mueller elements", elements, _mueller(elements)))
    for what, labels, selected in others:
        if spectra and not spectra[0].quantity:
            said = f'{what} beside psi and delta: `signal="{selected.quantity}"` reads {", ".join(labels)}'
            spectra[0].notes.append(said)
        spectra.append(selected)
    for label in _POWERS:
        if label in groups and (selected := _power(label, groups[label])):
            del groups[label]
            spectra.append(selected)
    return spectra


def _psi_delta(rows: Rows, label: str = "") -> Selected:
    """Ψ, Δ and, where they are not all zero, their errors. Raises DataError for rows of other lengths."""
    notes: list[str] = []
    of = f"{label} " if label else ""
    width, odd = len(rows[0][1]), _odd(rows, (4, 6, 8))
    if odd is not None:
        raise DataError(
            f"looks like a Woollam file, but line {odd} is not wavelength, angle, {of}psi, delta and "
            "their errors, as the other rows; export psi and delta as text, or correct that line"
        )
    if width == 8:  # CompleteEASE and programs of other makers write 1 and 1 there
        rows = [(line, cells[:6]) for line, cells in rows]
        notes.append("2 columns behind the errors ignored")
    rows, missing = measured(rows, (2, 3))
    if not rows:
        raise DataError(f"has no point with {of}psi and delta; check the measurement")
    names = ("angle_deg", "psi_deg", "delta_deg", "sigma_psi", "sigma_delta")[: len(rows[0][1]) - 1]
    if len(names) == 5 and all(_is(x, 0.0) for _, cells in rows for x in cells[4:]):
        names, rows = names[:3], [(line, cells[:4]) for line, cells in rows]  # as simulations are written
        notes.append("errors that are all zero ignored")
    return Selected(names, rows, [*notes, *missing])


def _tan_cos(rows: Rows) -> Selected:
    """tan Ψ and cos Δ; their errors are left out. Raises DataError for shorter rows."""
    notes = ["errors of tan(psi) and cos(delta) ignored"] if len(rows[0][1]) > 4 else []
    for line, cells in rows:
        if len(cells) < 4:
            raise DataError(
                f"line {line.number} has {len(cells)} values where wavelength, angle, tan(psi) and "
                "cos(delta) are expected; correct that line"
            )
    rows, missing = measured([(line, cells[:4]) for line, cells in rows], (2, 3))
    if not rows:
        raise DataError("has no point with tan(psi) and cos(delta); check the measurement")
    return Selected(("angle_deg", "tan_psi", "cos_delta"), rows, [*notes, *missing])


def _with_depolarisation(selected: Selected, label: str, shares: Rows) -> Selected:
    """Ψ and Δ with the depolarisation of the same points, in percent; without it where points are missing.

    CompleteEASE writes an angle of 0 beside the depolarisation of all points of one angle.
    """
    names, rows, notes, _ = selected
    beside: list[list[str]] = []
    reason = "its rows are not wavelength, angle, a value and its error"
    if all(len(cells) in (3, 4) for _, cells in shares):
        one_angle = len({cells[1] for _, cells in rows}) == 1
        one_angle = one_angle and all(_is(cells[1], 0.0) for _, cells in shares)
        values = [cells[2:] for _, cells in shares]
        by_point = dict(zip(_points(shares, one_angle), values, strict=True))
        beside = [by_point.get(point, []) for point in _points(rows, one_angle)]
        lacking = sum(not x or not all(is_number(y) and math.isfinite(float(y)) for y in x) for x in beside)
        reason = f"{lacking} of {len(rows)} points have none" if lacking else ""
    if reason:
        return Selected(names, rows, [*notes, f"{label} ignored: {reason}"])
    if len(shares) > len(rows):
        notes.append(f"{len(shares) - len(rows)} rows of {label} without psi and delta ignored")
    errors = [cells[1] for cells in beside if len(cells) == 2]
    with_error = len(errors) == len(rows)
    for placeholder in (0.0, 1.0):  # CompleteEASE writes 1 where it has no error
        if with_error and all(_is(error, placeholder) for error in errors):
            with_error = False
            notes.append(f"errors of {label} that are all {placeholder:g} ignored")
    count = 2 if with_error else 1
    rows = [(line, [*cells, *more[:count]]) for (line, cells), more in zip(rows, beside, strict=True)]
    return Selected((*names, *("depolarisation (%)", "sigma_depolarisation (%)")[:count]), rows, notes)


def _power(label: str, rows: Rows) -> Selected | None:
    """A reflectance or transmittance and its error; None for an intensity, whose errors are written as 1.

    Raises DataError for rows of other lengths.
    """
    width, odd = len(rows[0][1]), _odd(rows, (3, 4))
    if odd is not None:
        raise DataError(
            f"line {odd} is not {label}, wavelength, angle, a value and its error, as the other "
            "rows; correct that line"
        )
    errors = [cells[3] for _, cells in rows] if width == 4 else []
    if errors and all(_is(error, 1.0) for error in errors):
        return None
    names, notes = ("angle_deg", _POWERS[label], "sigma")[: width - 1], []
    if errors and all(_is(error, 0.0) for error in errors):
        names, rows = names[:2], [(line, cells[:3]) for line, cells in rows]
        notes.append("errors that are all zero ignored")
    rows, missing = measured(rows, (2,))
    return Selected(names, rows, [*notes, *missing], _POWERS[label]) if rows else None


def _generalised(groups: dict[str, Rows]) -> Selected:
    """Ψ and Δ of each ratio, one label each, at the points that all have, and their errors.

    Raises DataError for rows of other lengths, and without a point that all ratios have.
    """
    selected = {label: _psi_delta(rows, label) for label, rows in groups.items()}
    notes = [f"{label}: {note}" for label, of in selected.items() for note in of.notes]
    points, common = _in_common({label: of.rows for label, of in selected.items()}, ", ".join(groups))
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
    return Selected(names, rows, notes, "generalised-psi-delta")


def _mueller(groups: dict[str, Rows]) -> Selected:
    """Elements of a Mueller matrix, one label each, at the points that all have, and their errors.

    Raises DataError for rows of other lengths, and without a point that all elements have.
    """
    by_label, notes = {}, []
    for label, rows in groups.items():
        odd = next((line for line, cells in rows if len(cells) not in (3, 4)), None)
        if odd is not None:
            raise DataError(
                f"line {odd.number} is not {label}, wavelength, angle, a value and its error; "
                "correct that line"
            )
        by_label[label], missing = measured(rows, (2,))
        notes += [f"{label}: {note}" for note in missing]
    points, common = _in_common(by_label, "its Mueller elements")
    errors = [cells[3:] for rows in by_label.values() for _, cells in rows]
    # 0 and 1 stand for unknown errors
    known = all(errors) and not any(all(_is(error, x) for [error] in errors) for x in (0.0, 1.0))
    with_error = [label for label in by_label if label.lower() != "mm11"] if known else []
    names = ("angle_deg", *by_label, *(f"sigma_{label}" for label in with_error))
    rows = [
        (line, [*setting, *(values[x][0] for x in by_label), *(values[x][1] for x in with_error)])
        for line, setting, values in points
    ]
    return Selected(names, rows, [*notes, *common], "mueller")


def _in_common(
    groups: dict[str, Rows], subject: str
) -> tuple[list[tuple[Line, list[str], dict[str, list[str]]]], list[str]]:
    """The points that all labels have: line, wavelength and angle, values of each label; and a note if fewer.

    Raises DataError without such a point.
    """
    by_point = [dict(zip(_points(rows, False), rows, strict=True)) for rows in groups.values()]
    common = [point for point in by_point[0] if all(point in other for other in by_point)]
    if not common:
        raise DataError(f"{subject} have no point in common; export them together")
    notes = []
    if len(common) < max(map(len, by_point)):
        notes.append(f"{len(common)} points that {subject} have in common")
    points = []
    for point in common:
        line, cells = by_point[0][point]
        values = {label: of[point][1][2:] for label, of in zip(groups, by_point, strict=True)}
        points.append((line, cells[:2], values))
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
