"""Data files (`.ds.dat`) of Accurion's imaging ellipsometers EP3 and EP4.

Two headings that begin with `#`, names and units, then rows separated by tabs. With a column `Zone`,
each point is measured in up to four zones of the polariser and analyser; zone 0 is their mean, and zone 5
their largest difference, which is not a standard deviation.
"""

from collections import Counter
from collections.abc import Sequence
from math import dist

from pellicle.data.formats.exports import Rows, measured
from pellicle.data.tabular.table import Table, plain_columns
from pellicle.data.tabular.text import TextFile, is_number
from pellicle.errors import DataError, UsageError

MEAN_ZONE = "0"
SPREAD_ZONE = "5"
_UNITS = {"Lambda": "nm", "AOI": "deg", "Psi": "deg", "Delta": "deg"}
_UNMEASURED = {"NaN", "nan"}  # written where the instrument found no balance
_NAMES = ("wavelength (nm)", "angle_deg", "psi_deg", "delta_deg")
_POSITION = ("X_pos", "Y_pos")
DRIFT_MM = 1.0
"""Drift of the stage that is accepted within one spot; files show 0.1 mm."""
_MOST_LISTED = 40


def read(file: TextFile, spot: int | None = None) -> Table | None:
    """Return Ψ and Δ of one spot, or None for another format.

    Raises UsageError where `spot`, from 1, is missing or wrong, DataError for several zones.
    """
    lines = file.lines
    headings = [comment.text.split("\t") for comment in file.comments]
    heading = next((i for i, names in enumerate(headings) if set(_UNITS) <= set(names)), None)
    if heading is None or not lines:
        return None
    names = headings[heading]
    columns = {name: names.index(name) for name in (*_UNITS, "Zone", "ROIidx", *_POSITION) if name in names}
    units = headings[heading + 1] if heading + 1 < len(headings) else []
    for name, expected in _UNITS.items():
        unit = units[columns[name]] if columns[name] < len(units) else ""
        if unit != expected:
            raise DataError(
                f"the heading of an Accurion file gives {name} in {unit!r}, not in {expected!r}; "
                "export it in that unit"
            )
    rows = [(line, [cell.strip() for cell in line.text.split("\t")]) for line in lines]
    short = next((line for line, cells in rows if len(cells) < len(names)), None)
    if short is not None:
        raise DataError(
            f"line {short.number} has fewer values than the {len(names)} columns of the heading; "
            "correct that line"
        )
    notes = ["read as an Accurion data file"]
    if "Zone" in columns:
        zones, note = _zones(rows, columns["Zone"])
        of_zones = [_select_spot(zone, columns, spot) for zone in zones]
        notes += [note, *of_zones[0][1]]
        rows = _mean([spot_rows for spot_rows, _ in of_zones], columns)
    else:
        rows, spot_notes = _select_spot(rows, columns, spot)
        notes += spot_notes
    points, missing = measured(rows, (columns["Psi"], columns["Delta"]))
    if not points:
        raise DataError("has no point with psi and delta; check the measurement")
    kept = [(line, [cells[columns[name]] for name in _UNITS]) for line, cells in points]
    return plain_columns(_NAMES, kept, [*notes, *missing])


def _zones(rows: Rows, zone: int) -> tuple[list[Rows], str]:
    """The rows of each zone to use, and a note: the mean if the file has it, else every zone measured."""
    zones: dict[str, Rows] = {}
    for row in rows:
        zones.setdefault(row[1][zone], []).append(row)
    if MEAN_ZONE in zones:
        return [zones[MEAN_ZONE]], "zone 0, the mean of the zones, taken"
    names = sorted(zones.keys() - {SPREAD_ZONE}) or [*zones]
    note = f"the mean of zones {', '.join(names)} taken" if len(names) > 1 else ""
    return [zones[name] for name in names], note or f"measured in zone {names[0]} only"


def _mean(zones: Sequence[Rows], columns: dict[str, int]) -> Rows:
    """Rows of the first zone with the mean Ψ and Δ of all, NaN where a zone found no balance or has no row.

    Zone 0 of files that have it is this mean.
    """
    if len(zones) == 1:
        return zones[0]

    def point(cells: Sequence[str]) -> tuple[str, str]:
        return cells[columns["Lambda"]], cells[columns["AOI"]]

    others = [{point(cells): cells for _, cells in rows} for rows in zones[1:]]
    means: Rows = []
    for line, cells in zones[0]:
        same = [cells, *(zone[point(cells)] for zone in others if point(cells) in zone)]
        mean = list(cells)
        for name in ("Psi", "Delta"):
            texts = [one[columns[name]] for one in same]
            mean[columns[name]] = "NaN"
            if len(texts) == len(zones) and not set(texts) & _UNMEASURED and all(map(is_number, texts)):
                # degrees may lie on both sides of 0 and 360
                first, *further = map(float, texts)
                apart = [0.0, *((value - first + 180.0) % 360.0 - 180.0 for value in further)]
                mean[columns[name]] = f"{(first + sum(apart) / len(apart)) % 360.0:.6g}"
        means.append((line, mean))
    return means


def _region(cells: list[str], columns: dict[str, int]) -> str:
    return cells[columns["ROIidx"]] if "ROIidx" in columns else ""


def _position(cells: list[str], columns: dict[str, int]) -> tuple[float, ...]:
    """Position in mm, empty where the file has none."""
    position = [cells[columns[name]] for name in _POSITION if name in columns]
    return tuple(float(x) for x in position) if all(map(is_number, position)) else ()


def _distance(one: tuple[float, ...], other: tuple[float, ...]) -> float:
    """Distance in mm, 0 where a position is missing."""
    return dist(one, other) if len(one) == len(other) else 0.0


def _select_spot(rows: Rows, columns: dict[str, int], spot: int | None) -> tuple[Rows, list[str]]:
    """The rows of one spot, and notes. Raises UsageError where `spot` is missing or wrong."""
    # the rows of each spot or time: a repeated point begins another spot, in any order of rows
    by_spot: dict[tuple[str, int], Rows] = {}
    counts: Counter[tuple[str, ...]] = Counter()
    for line, cells in rows:
        region = _region(cells, columns)
        point = (region, cells[columns["Lambda"]], cells[columns["AOI"]])
        counts[point] += 1
        by_spot.setdefault((region, counts[point]), []).append((line, cells))
    spots = list(by_spot.values())
    for (before, first), *others in spots if len(spots) > 1 else ():
        for line, cells in others:
            apart = _distance(_position(first, columns), _position(cells, columns))
            if apart > DRIFT_MM:
                raise DataError(
                    f"line {line.number} lies {apart:.3g} mm from line {before.number}, which should be of "
                    "the same spot: some of its points are missing; keep the rows of one spot in the file"
                )
    if spot is None and len(spots) == 1:
        return spots[0], []
    heads = [(line, _region(cells, columns), _position(cells, columns)) for (line, cells), *_ in spots]
    regions = len({region for _, region, _ in heads}) > 1
    places = any(_distance(heads[0][2], position) > DRIFT_MM for *_, position in heads)
    labels = []  # ` in region 2`, ` at -18.183, -30.305 mm` or ` from line 9`
    for line, region, position in heads:
        place = f" at {', '.join(f'{x:g}' for x in position)} mm" if places else ""
        labels.append((f" in region {region}" if regions else "") + place or f" from line {line.number}")
    if spot is not None and 1 <= spot <= len(spots):
        return spots[spot - 1], [f"spot {spot} of {len(spots)}{labels[spot - 1] if len(spots) > 1 else ''}"]
    if len(spots) == 1:
        raise UsageError("has one spot only; leave `spot` out")
    listed = "; ".join(f"{i}{label}" for i, label in enumerate(labels[:_MOST_LISTED], start=1))
    more = "; ..." if len(labels) > _MOST_LISTED else ""
    raise UsageError(
        f"has {len(spots)} spots or times of one sample, which may differ: {listed}{more}; choose "
        f"one, from `spot=1` to `spot={len(spots)}`"
    )
