"""Text files of Woollam's WVASE and CompleteEASE.

Lines of heading (a title, `VASEmethod[...]`, `Original[...]`, `Dynamic`), a line with the unit of the axis
(`nm`, `Angstroms`, `eV`, `1/cm`), then rows of wavelength, angle of incidence, values and usually their
errors. A label before a row names its quantity: `E` or none is Ψ and Δ, `dpolE` the depolarisation in
percent, `AnE`, `Aps` and `Asp` generalised Ψ and Δ (`signals.generalised`), `mm12` an element of a normalised
Mueller matrix, `pR`, `sR`, `uR`, `pT`, `sT`, `uT` a reflectance
or transmittance of p, s or unpolarised light. Rows of dynamic data end with their time in minutes. The layout
is that of files of both programs.
"""

import re
from collections import defaultdict
from collections.abc import Iterable, Sequence

from pellicle.data.formats import woollam_rows
from pellicle.data.formats.exports import Rows
from pellicle.data.formats.woollam_rows import Selected
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
_ELEMENT = re.compile(r"(?i:mm[1-4][1-4])")
_RATIO = re.compile(r"(?i:AnE|Aps|Asp)")
_OTHERS = {
    r"(?i:AnE|Aps|Asp)": "generalised ellipsometry in transmission",
    r"[psu][RT][rb]": "measurements from the back",
}
_FACTS = {
    "software": r"\b((?:WVASE|CompleteEASE)=[\d.]+)",
    "date": r"\b((?:Mon|Tue|Wed|Thu|Fri|Sat|Sun) [A-Z][a-z]{2} +\d+ [\d:]+ \d{4})",
}
_MOST_HEADING = 50  # lines that are searched for the unit
_MOST_LISTED = 8


def layouts(file: TextFile) -> list[Table] | None:
    """Return a layout for each quantity (and time) that can be fitted, or None for another format.

    Raises DataError where the file has none.
    """
    lines, path = file.lines, file.path
    at = _unit_line(lines)
    if at is None:
        return None
    heading, unit = lines[:at], lines[at].text.upper().split()
    method = next((line.text for line in heading if line.text.startswith(METHOD)), "")
    rows = [(line, _cells(line)) for line in lines[at + 1 :] if line.bare.strip()]
    trigonometric = TRIGONOMETRIC in unit
    if not (method or unit[1:] or any(_KNOWN.fullmatch(cells[0]) for _, cells in rows)):
        return None
    dynamic = any(line.text.strip().lower() == "dynamic" for line in heading)
    transmitted = "TransmissionMeas=1" in method.replace(" ", "")
    facts = _facts(heading, method) + ([("light", "transmitted")] if transmitted else [])
    axis = f"wavelength ({wavelength_unit(unit[0])})"
    kept, left_out = [], {}
    for time, groups in _by_time(rows, dynamic, path).items():
        name = f"{time} min" if dynamic else ""
        tables = _tables(groups, trigonometric, transmitted, path)
        left_out |= dict.fromkeys(groups)
        for quantity, (names, own, notes) in tables:
            alone = f"{name} {quantity}" if quantity and dynamic else name
            kept.append((alone, (axis, *names), own, [NOTE, *notes]))
    ignored = _described(left_out, transmitted)
    if not kept:
        raise DataError(
            f"{path}: looks like a Woollam file, but has no psi and delta, reflectance or transmittance, "
            f"only {ignored or 'a heading'}; export psi and delta as text"
        )
    said = [f"rows of other quantities ignored: {ignored}"] if ignored else []
    return [
        plain_columns(names, own, [*notes, *said], name=name, facts=facts) for name, names, own, notes in kept
    ]


def _tables(
    groups: dict[str, Rows], trigonometric: bool, transmitted: bool, path: str
) -> list[tuple[str, Selected]]:
    """The tables of one time and their quantities, "" for Ψ and Δ. Labels that are read leave `groups`."""
    tables = []
    if LABEL in groups and trigonometric:
        tables.append(("", woollam_rows.tan_cos(groups.pop(LABEL), path)))
    elif LABEL in groups:
        selected = woollam_rows.psi_delta(groups.pop(LABEL), path)
        shares = next((label for label in groups if label.lower() == DEPOLARISATION), None)
        if shares is not None:
            selected = woollam_rows.with_depolarisation(selected, shares, groups.pop(shares))
        tables.append(("", selected))
    ratios = {label: groups[label] for label in groups if _RATIO.fullmatch(label)}
    if ratios and not (transmitted or trigonometric):
        if tables:
            tables[0] = _beside(tables[0], "generalised psi and delta", "generalised-psi-delta", ratios)
        tables.append(("generalised-psi-delta", woollam_rows.generalised(ratios, path)))
        for label in ratios:
            del groups[label]
    elements = {label: groups[label] for label in groups if _ELEMENT.fullmatch(label)}
    if any(label.lower() != "mm11" for label in elements) and not transmitted:
        selected = woollam_rows.mueller(elements, path)
        if tables and not tables[0][0]:
            tables[0] = _beside(tables[0], "Mueller elements", "mueller", elements)
        tables.append(("mueller", selected))
        for label in elements:
            del groups[label]
    for label, quantity in _POWERS.items():
        if label in groups and (own := woollam_rows.power(label, quantity, groups[label], path)):
            del groups[label]
            tables.append((quantity, own))
    return tables


def _beside(
    table: tuple[str, Selected], what: str, signal: str, labels: Iterable[str]
) -> tuple[str, Selected]:
    """The table of Ψ and Δ with a sentence on another signal of the file."""
    quantity, (names, rows, notes) = table
    said = f'{what} beside psi and delta: `signal="{signal}"` reads {", ".join(labels)}'
    return quantity, Selected(names, rows, [*notes, said])


def _unit_line(lines: Sequence[Line]) -> int | None:
    """Index of the line with nothing but the axis's unit, above rows of numbers."""
    for i, line in enumerate(lines[: min(_MOST_HEADING, len(lines) - 1)]):
        words, below = line.text.upper().split(), _cells(lines[i + 1])
        if (
            words[1:] in _BEHIND_UNIT
            and wavelength_unit(words[0])
            and len(below) >= 4
            and is_number(below[1])
        ):
            return i
    return None


def _cells(line: Line) -> list[str]:
    """The cells of a row; a comma can only be a decimal mark between tabs or blanks."""
    return line.bare.replace(",", ".").split()


def _by_time(rows: Sequence[tuple[Line, list[str]]], dynamic: bool, path: str) -> dict[str, dict[str, Rows]]:
    """The rows of each time and label, without both, in the order of the file.

    The time of static data is "".
    """
    times: dict[str, dict[str, Rows]] = defaultdict(lambda: defaultdict(list))
    firsts = {cells[0] for _, cells in rows}
    labels = {first for first in firsts if first[0].isalpha() and not is_number(first)}
    for line, cells in rows:
        label = LABEL
        if cells[0] in labels:
            label, *cells = cells
        time = ""
        if dynamic:
            if len(cells) not in (5, 7) or not is_number(cells[-1]):
                raise DataError(
                    f"{path}: line {line.number} of dynamic data does not end with its time behind "
                    f"wavelength, angle, values and errors: {len(cells)} values; correct that line"
                )
            *cells, time = cells
        times[time][label].append((line, cells))
    return times


def _facts(heading: Sequence[Line], method: str) -> list[tuple[str, str]]:
    """Program, date and sample of the heading."""
    facts = [("format", "Woollam text")]
    for key, pattern in _FACTS.items():
        if match := re.search(pattern, method):
            facts.append((key, match[1]))
    if heading and not heading[0].text.startswith((METHOD, "Original[")):
        facts.append(("sample", heading[0].text.strip()))
    return facts


def _described(labels: dict[str, None], transmitted: bool) -> str:
    """Labels of rows that are not read, and what they are, for a message."""
    kinds: dict[str, list[str]] = defaultdict(list)
    for label in labels:
        kind = next((text for pattern, text in _OTHERS.items() if re.fullmatch(pattern, label)), "")
        if label in _POWERS:
            kind = "intensities, with errors of 1"
        kinds[kind].append(label)
    parts = []
    for kind, own in kinds.items():
        listed = ", ".join(own[:_MOST_LISTED]) + (", ..." if len(own) > _MOST_LISTED else "")
        parts.append(f"{kind} ({listed})" if kind else listed)
    return "; ".join(parts)
