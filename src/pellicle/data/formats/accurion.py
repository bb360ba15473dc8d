"""Data files (`.ds.dat`) of Accurion's imaging ellipsometers EP3 and EP4.

Two headings that begin with `#`, names and units, then rows separated by tabs. Where there is a
column `Zone`, each point is measured in up to four zones of the polariser and analyser; zone 0 is
their mean, and zone 5 their largest difference, which is no standard deviation.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from math import dist

from pellicle.data.tabular.layout import Layout, plain_columns
from pellicle.data.tabular.text import Line, is_number
from pellicle.errors import DataError, UsageError

MEAN_ZONE = "0"
SPREAD_ZONE = "5"
_UNITS = {"Lambda": "nm", "AOI": "deg", "Psi": "deg", "Delta": "deg"}
_UNMEASURED = {"NaN", "nan"}  # what these instruments write where they found no balance
_NAMES = ("wavelength (nm)", "angle_deg", "psi_deg", "delta_deg")
_POSITION = ("X_pos", "Y_pos")
DRIFT_MM = 1.0
"""How far a stage may drift while it measures one spot; 0.1 mm has been seen."""
_MOST_LISTED = 40

Rows = list[tuple[Line, list[str]]]


def layout(
    lines: Sequence[Line], comments: Sequence[Line], path: str, spot: int | None = None
) -> Layout | None:
    """Ψ and Δ of a spot in such a file, or None.

    Raises UsageError where several spots, numbered from 1, leave open which, DataError for several zones.
    """
    headings = [comment.text.split("\t") for comment in comments]
    at = next((i for i, names in enumerate(headings) if set(_UNITS) <= set(names)), None)
    if at is None or not lines:
        return None
    names = headings[at]
    place = {name: names.index(name) for name in (*_UNITS, "Zone", "ROIidx", *_POSITION) if name in names}
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
    rows, told = _chosen(rows, place, spot, path)
    notes += told
    measured = [row for row in rows if not {row[1][place["Psi"]], row[1][place["Delta"]]} & _UNMEASURED]
    if len(measured) < len(rows):
        notes.append(f"{len(rows) - len(measured)} of {len(rows)} points, written NaN, left out")
    if not measured:
        raise DataError(f"{path}: holds no point with psi and delta; check the measurement")
    kept = [(line, [cells[place[name]] for name in _UNITS]) for line, cells in measured]
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


def _spots(rows: Rows, place: dict[str, int], path: str) -> list[Rows]:
    """The rows of each spot or time: a point that comes again begins another, in whatever order rows come.

    Positions do not tell: stages drift by a tenth of a millimetre while angles change. Raises DataError
    where they contradict, as where a point of a spot is missing.
    """
    found: dict[tuple[str, int], Rows] = {}
    seen: Counter[tuple[str, ...]] = Counter()
    for line, cells in rows:
        region = _region(cells, place)
        point = (region, cells[place["Lambda"]], cells[place["AOI"]])
        seen[point] += 1
        found.setdefault((region, seen[point]), []).append((line, cells))
    spots = list(found.values())
    if len(spots) > 1:
        for spot in spots:
            _check_places(spot, place, path)
    return spots


def _check_places(spot: Rows, place: dict[str, int], path: str) -> None:
    (before, first), *_ = spot
    for line, cells in spot:
        apart = _apart(_position(first, place), _position(cells, place))
        if apart > DRIFT_MM:
            raise DataError(
                f"{path}: line {line.number} lies {apart:.3g} mm from line {before.number}, which should be "
                "of the same spot: some of its points are missing; keep the rows of one spot in a file"
            )


def _region(cells: list[str], place: dict[str, int]) -> str:
    return cells[place["ROIidx"]] if "ROIidx" in place else ""


def _position(cells: list[str], place: dict[str, int]) -> tuple[float, ...]:
    """In mm, empty where the file gives none."""
    position = [cells[place[name]] for name in _POSITION if name in place]
    return tuple(float(x) for x in position) if all(map(is_number, position)) else ()


def _apart(one: tuple[float, ...], other: tuple[float, ...]) -> float:
    """Distance in mm, 0 where it is not known."""
    return dist(one, other) if len(one) == len(other) else 0.0


def _named(spots: list[Rows], place: dict[str, int]) -> list[str]:
    """What tells each spot from the others: ` in region 2`, ` at -18.183, -30.305 mm`, ` from line 9`."""
    heads = [(line, _region(cells, place), _position(cells, place)) for (line, cells), *_ in spots]
    regions = len({region for _, region, _ in heads}) > 1
    places = any(_apart(heads[0][2], position) > DRIFT_MM for *_, position in heads)
    names = []
    for line, region, position in heads:
        at = f" at {', '.join(f'{x:g}' for x in position)} mm" if places else ""
        names.append((f" in region {region}" if regions else "") + at or f" from line {line.number}")
    return names


def _chosen(rows: Rows, place: dict[str, int], spot: int | None, path: str) -> tuple[Rows, list[str]]:
    """The rows of one spot, and what to say of it. Raises UsageError where it is open which."""
    spots = _spots(rows, place, path)
    if spot is None and len(spots) == 1:
        return spots[0], []
    names = _named(spots, place)
    if spot is not None and 1 <= spot <= len(spots):
        return spots[spot - 1], [f"spot {spot} of {len(spots)}{names[spot - 1] if len(spots) > 1 else ''}"]
    if len(spots) == 1:
        raise UsageError(f"{path}: holds one spot only; choose it with --spot 1, or leave that out")
    listed = "; ".join(f"{i}{name}" for i, name in enumerate(names[:_MOST_LISTED], start=1))
    more = "; ..." if len(names) > _MOST_LISTED else ""
    raise UsageError(
        f"{path}: holds {len(spots)} spots or times of one sample, which need not be alike: {listed}{more}; "
        f"choose one with --spot 1 to {len(spots)}"
    )
