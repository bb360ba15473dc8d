"""BRDF samples in the text format of the ALTA library (belcour/alta, its page Data File Formats).

Lines of `#KEY value` begin the file: `#DIM N P` for N coordinates and P values in a row, `#PARAM_IN`
and `#PARAM_OUT` for their meaning, `#VS` for no interval (0), a radius (1) or both ends (2) of an interval
about each value. Angles are in radians; L is the light and V the viewer.
"""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass

import numpy as np

from pellicle.data.brdf_samples import CHANNELS, BrdfSamples, angles, from_half_difference
from pellicle.data.tabular.table import Table, TextCells
from pellicle.data.tabular.text import Line, TextFile
from pellicle.errors import DataError

Angles = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]  # θ_i, φ_i, θ_o, φ_o in radians

GRAZING = 1e-3
"""Degrees from 90 within which a cosine-weighted value does not determine the BRDF."""


def _half(theta_h: np.ndarray, phi_h: np.ndarray | float, theta_d: np.ndarray, phi_d: np.ndarray) -> Angles:
    view, light = from_half_difference(theta_h, phi_h, theta_d, phi_d)
    return *angles(light), *angles(view)


def _half_isotropic(theta_h: np.ndarray, theta_d: np.ndarray, phi_d: np.ndarray) -> Angles:
    theta_i, phi_i, theta_o, phi_o = _half(theta_h, 0.0, theta_d, phi_d)
    return theta_i, np.zeros_like(phi_i), theta_o, phi_o - phi_i


INPUTS: dict[str, tuple[tuple[str, ...], Callable[..., Angles]]] = {
    "SPHERICAL_TL_PL_TV_PV": (("theta_l", "phi_l", "theta_v", "phi_v"), lambda *directions: directions),
    "ISOTROPIC_TV_TL_DPHI": (  # ALTA counts from the viewer to the light
        ("theta_v", "theta_l", "dphi"),
        lambda theta_v, theta_l, phi: (theta_l, np.zeros_like(phi), theta_v, -phi),
    ),
    "ISOTROPIC_TL_TV_PROJ_DPHI": (
        ("theta_l", "x", "y"),
        lambda theta_l, x, y: (theta_l, np.zeros_like(x), np.hypot(x, y), np.arctan2(y, x)),
    ),
    "RUSIN_TH_PH_TD_PD": (("theta_h", "phi_h", "theta_d", "phi_d"), _half),
    "RUSIN_TH_TD_PD": (("theta_h", "theta_d", "phi_d"), _half_isotropic),
    "CARTESIAN": (
        ("v_x", "v_y", "v_z", "l_x", "l_y", "l_z"),
        lambda *vl: (*angles(np.stack(vl[3:])), *angles(np.stack(vl[:3]))),  # view, then light
    ),
}
"""Coordinates of a row for each `#PARAM_IN`, and their directions. ALTA's other parametrisations leave part
of the directions open, or are hardly in use."""
COSINE = "INV_STERADIAN_COSINE_FACTOR"
OUTPUTS = ("INV_STERADIAN", COSINE, "RGB_COLOR")
_KEYS = ("DIM", "PARAM_IN", "PARAM_OUT", "VS")


@dataclass(frozen=True)
class Header:
    """Values of the lines `#KEY value`; `intervals` has 0, 1 or 2 for each channel.

    `param_out` is empty where the file does not have it: the number of values then tells a BRDF in 1/sr from
    one in R, G and B.
    """

    param_in: str
    param_out: str
    channels: tuple[str, ...]
    intervals: tuple[int, ...]
    line: int

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns of a row."""
        ends = {0: (), 1: ("radius_{}",), 2: ("low_{}", "high_{}")}
        kinds = zip(self.channels, self.intervals, strict=True)
        bounds = [end.format(channel) for channel, kind in kinds for end in ends[kind]]
        return (*INPUTS[self.param_in][0], *self.channels, *bounds)


def find_header(comments: Sequence[Line], path: str) -> Header | None:
    """Find the header of an ALTA file among its comments, or None. Raises DataError for a wrong header."""
    keys: dict[str, tuple[Line, str]] = {}
    for comment in comments:
        key, _, value = comment.text.partition(" ")
        if key in _KEYS:
            keys[key] = comment, value.strip()
    if "PARAM_IN" not in keys:
        return None
    if "DIM" not in keys:
        raise DataError(f"{path}: has an ALTA header without #DIM; add that line")

    param_in = _known(keys["PARAM_IN"], INPUTS, path, "convert the file to SPHERICAL_TL_PL_TV_PV with ALTA")
    param_out = ""
    if "PARAM_OUT" in keys:
        param_out = _known(keys["PARAM_OUT"], OUTPUTS, path, "write INV_STERADIAN if it is a BRDF in 1/sr")
    line, dim = keys["DIM"]
    coordinates = len(INPUTS[param_in][0])
    channels = next((names for names in CHANNELS if dim.split() == [f"{coordinates}", f"{len(names)}"]), None)
    if channels is None:
        raise DataError(
            f"{path}: line {line.number}: #DIM {dim} should be {coordinates} 1 or {coordinates} 3, the "
            f"coordinates of {param_in} and one value or three (R, G, B); correct that line"
        )
    intervals = _intervals(keys.get("VS"), len(channels), path)
    return Header(param_in, param_out, channels, intervals, line.number)


def _known(entry: tuple[Line, str], known: Collection[str], path: str, remedy: str) -> str:
    line, name = entry
    if name not in known:
        raise DataError(
            f"{path}: line {line.number}: {line.text!r} is not among {', '.join(known)}, which pellicle "
            f"reads; {remedy}"
        )
    return name


def _intervals(entry: tuple[Line, str] | None, count: int, path: str) -> tuple[int, ...]:
    """One number for each channel; a single one applies to all."""
    if entry is None:
        return (0,) * count
    line, text = entry
    kinds = [int(word) for word in text.split() if word in ("0", "1", "2")]
    if len(kinds) != len(text.split()) or len(kinds) not in (1, count):
        raise DataError(
            f"{path}: line {line.number}: #VS {text} should be {count} times 0, 1 or 2, for no interval, a "
            "radius or both ends; correct that line"
        )
    return tuple(kinds * count if len(kinds) == 1 else kinds)


def table_of(file: TextFile, header: Header) -> Table:
    """Return the rows of an ALTA file below its header. Raises DataError where there is none."""
    rows = [line for line in file.lines if line.number > header.line]
    if not rows:
        raise DataError(f"{file.path}: has an ALTA header but no rows; export it again")
    meaning = header.param_out or f"{', '.join(header.channels)} in 1/sr, since it has no #PARAM_OUT"
    note = f"read as an ALTA text file of {header.param_in} (radians) and {meaning}"
    width = len(header.names)
    cells = TextCells(" ", ".", width, width, rows)
    return Table(header.names, width, cells, (note,), path=file.path, sha256=file.sha256)


def from_table(table: Table, header: Header) -> BrdfSamples:
    """Return the samples of an ALTA file. Raises DataError for impossible directions or values."""
    columns = table.numbers(range(len(header.names)))
    coordinates, directions = INPUTS[header.param_in]
    start = len(coordinates)
    end = start + len(header.channels)
    theta_i, phi_i, theta_o, phi_o = map(np.rad2deg, directions(*columns[:start]))
    values, notes = np.stack(columns[start:end], axis=1), table.notes
    bounds, sigma = iter(columns[end:]), None
    if 0 not in header.intervals:  # a radius, or both ends
        radii = [
            next(bounds) if kind == 1 else (-next(bounds) + next(bounds)) / 2 for kind in header.intervals
        ]
        sigma = np.stack(radii, axis=1)
        notes = (*notes, "the radius of the intervals (#VS) read as the standard deviation")
    elif any(header.intervals):
        notes = (*notes, "intervals (#VS) ignored, since not every channel has one")
    if header.param_out == COSINE:
        grazing = np.abs(theta_o - 90) < GRAZING
        if grazing.any():
            raise DataError(
                f"{table.path}: {table.place(int(np.argmax(grazing)))}: theta_o is 90 degrees, where a value "
                "weighted with its cosine does not determine the BRDF; delete that row"
            )
        # 1 below the horizon, which `BrdfSamples` refuses
        weight = np.where(theta_o < 90, np.cos(np.deg2rad(theta_o)), 1.0)[:, None]
        values, sigma = values / weight, None if sigma is None else sigma / weight
        notes = (*notes, "values divided by cos(theta_o), their weight according to the header")
    return BrdfSamples(
        theta_i, phi_i, theta_o, phi_o, values, header.channels, sigma, table.path, table.sha256, notes,
        table.lines,
    )  # fmt: skip
