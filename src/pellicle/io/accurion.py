"""Data files (`.ds.dat`) of Accurion's imaging ellipsometers EP3 and EP4.

Two headings that begin with `#`, names and units, then rows separated by tabs. Where there is a
column `Zone`, each point is measured in up to four zones of the polariser and analyser; zone 0 is
their mean, and zone 5 their largest difference, which is no standard deviation.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from pellicle.errors import DataError
from pellicle.io.layout import Layout, plain_columns
from pellicle.io.text import Line

MEAN_ZONE = "0"
SPREAD_ZONE = "5"
_UNITS = {"Lambda": "nm", "AOI": "deg", "Psi": "deg", "Delta": "deg"}
_UNMEASURED = {"NaN", "nan"}  # what these instruments write where they found no balance
_NAMES = ("wavelength (nm)", "angle_deg", "psi_deg", "delta_deg")

Rows = list[tuple[Line, list[str]]]


def layout(lines: Sequence[Line], comments: Sequence[Line], path: str) -> Layout | None:
    """Ψ and Δ of the one spot in such a file, or None. Raises DataError for several spots or zones."""
    headings = [comment.text.split("\t") for comment in comments]
    at = next((i for i, names in enumerate(headings) if set(_UNITS) <= set(names)), None)
    if at is None or not lines:
        return None
    names = headings[at]
    place = {name: names.index(name) for name in (*_UNITS, "Zone", "ROIidx") if name in names}
    _check_units(place, headings[at + 1] if at + 1 < len(headings) else [], path)
    rows = [(line, [cell.strip() for cell in line.text.split("\t")]) for line in lines]
    short = next((line for line, cells in rows if len(cells) < len(names)), None)
    if short is not None:
        raise DataError(
            f"{path}: line {short.number} has fewer values than the {len(names)} columns of the heading; "
            "correct that line"
        )
    notes = ["read as an Accurion data file"]
    if "Zone" in place:
        rows, note = _one_zone(rows, place["Zone"], path)
        notes.append(note)
    measured = [row for row in rows if not {row[1][place["Psi"]], row[1][place["Delta"]]} & _UNMEASURED]
    if len(measured) < len(rows):
        notes.append(f"{len(rows) - len(measured)} of {len(rows)} points, written NaN, left out")
    if not measured:
        raise DataError(f"{path}: holds no point with psi and delta; check the measurement")
    rows = measured
    _refuse_several(rows, place, path)
    kept = [(line, [cells[place[name]] for name in _UNITS]) for line, cells in rows]
    return plain_columns(_NAMES, kept, notes)


def _check_units(place: dict[str, int], units: Sequence[str], path: str) -> None:
    for name, expected in _UNITS.items():
        written = units[place[name]] if place[name] < len(units) else ""
        if written != expected:
            raise DataError(
                f"{path}: the heading of an Accurion file gives {name} in {written!r}, not in {expected!r}; "
                "export it in that unit"
            )


def _one_zone(rows: Rows, zone: int, path: str) -> tuple[Rows, str]:
    """The mean of the zones, or the only zone there is."""
    zones = sorted({cells[zone] for _, cells in rows} - {SPREAD_ZONE})
    if MEAN_ZONE in zones:
        return [row for row in rows if row[1][zone] == MEAN_ZONE], "zone 0, the mean of the zones, taken"
    if len(zones) != 1:
        raise DataError(
            f"{path}: measured in zones {', '.join(zones)} without their mean, zone 0; "
            "keep the rows of one zone"
        )
    return [row for row in rows if row[1][zone] == zones[0]], f"measured in zone {zones[0]} only"


def _refuse_several(rows: Rows, place: dict[str, int], path: str) -> None:
    """Stages drift by micrometres while angles change, so spots are told by points that come again."""
    regions = {cells[place["ROIidx"]] for _, cells in rows} if "ROIidx" in place else set()
    if len(regions) > 1:
        raise DataError(
            f"{path}: holds {len(regions)} regions of interest (ROIidx); keep the rows of one in a file"
        )
    points = Counter((cells[place["Lambda"]], cells[place["AOI"]]) for _, cells in rows)
    spots = max(points.values(), default=1)
    if spots > 1:
        raise DataError(
            f"{path}: holds {spots} spots or times of one sample, which need not be alike; "
            "keep the rows of one of them in a file"
        )
