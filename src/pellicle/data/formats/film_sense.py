"""Text files of Film Sense's ellipsometers FS-1, with one point for each LED.

`Film_Sense_Data` or `Film_Sense_Dyn_Data`, then the numbers of LEDs and of measurements and the angle of
incidence (with a sign), one line per LED that begins with its wavelength in nm, then the measurements: of
static data one line per LED of N, C, S, the degree of polarisation P and the intensity, of dynamic data a
line of names (`Time`, `UV_N`, `UV_C`, ...) and a row per time in seconds with these of every LED. N, C and
S are divided by P. The layout is that of files of both kinds in the tests of refellips.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from pellicle.data.tabular.layout import Layout, plain_columns
from pellicle.data.tabular.text import Line, TextFile, is_number
from pellicle.errors import DataError

PREFIX = "Film_Sense_"
STATIC, DYNAMIC = "Film_Sense_Data", "Film_Sense_Dyn_Data"
NOTE = "read as a Film Sense text file"
_NAMES = ("wavelength (nm)", "angle_deg", "N", "C", "S", "depolarisation")
_VALUES = ("N", "C", "S", "P")
_DATE = re.compile(r"Date: *([\d-]+ [\d:]+)")


def layouts(file: TextFile) -> list[Layout] | None:
    """Return the measurement, or one for each time, or None for another format.

    Raises DataError for a file that is not complete.
    """
    lines, path = file.lines, file.path
    kind = lines[0].text.strip()
    if not kind.startswith(PREFIX):
        return None
    if kind not in (STATIC, DYNAMIC):
        raise DataError(
            f"{path}: is a Film Sense file of the kind {kind}, which is not read; export each measurement as "
            f"{STATIC}, or those of one spot as {DYNAMIC}"
        )
    counts = lines[1].text.split() if len(lines) > 1 else []
    if len(counts) < 3 or not counts[0].isdigit() or not counts[1].isdigit() or not is_number(counts[2]):
        raise DataError(
            f"{path}: line 2 of a Film Sense file should give the numbers of LEDs and of measurements and "
            "the angle of incidence; export it again"
        )
    leds, angle = int(counts[0]), f"{abs(float(counts[2])):g}"
    wavelengths = [line.text.split()[0] for line in lines[2 : 2 + leds]]
    rows = lines[2 + leds :]
    facts = [("format", f"Film Sense text{', dynamic' if kind == DYNAMIC else ''}")]
    facts += [("date", found[1]) for line in rows[-1:] if (found := _DATE.search(line.text))]
    if kind == DYNAMIC:
        return _dynamic(rows, wavelengths, angle, facts, path)
    if int(counts[1]) != 1:
        raise DataError(
            f"{path}: has {counts[1]} measurements by its line 2, where a static Film Sense file has one; "
            "export each as a file of its own"
        )
    if len(rows) < leds:
        raise DataError(
            f"{path}: has {len(rows)} lines of N, C, S for {leds} LEDs; it is cut short, export it again"
        )
    found = [
        (line, [wavelength, angle, *_values(line.text.split(), line, path)])
        for line, wavelength in zip(rows[:leds], wavelengths, strict=True)
    ]
    return [plain_columns(_NAMES, found, [NOTE], facts=facts)]


def _dynamic(
    lines: Sequence[Line],
    wavelengths: Sequence[str],
    angle: str,
    facts: Sequence[tuple[str, str]],
    path: str,
) -> list[Layout]:
    names = lines[0].text.split() if lines else []
    ends = [name.rpartition("_")[2] for name in names]
    columns = {end: [i for i, own in enumerate(ends) if own == end and i] for end in _VALUES}
    if not names or names[0] != "Time" or any(len(own) != len(wavelengths) for own in columns.values()):
        raise DataError(
            f"{path}: the heading of a dynamic Film Sense file should name Time and N, C, S and P of each of "
            f"its {len(wavelengths)} LEDs; export it again"
        )
    rows = [(line, line.text.split()) for line in lines[1:]]
    rows = [(line, cells) for line, cells in rows if is_number(cells[0])]
    if not rows:
        raise DataError(f"{path}: has a Film Sense heading but no measurement; export it again")
    found = []
    for line, cells in rows:
        if len(cells) < len(names):
            raise DataError(
                f"{path}: line {line.number} has {len(cells)} values where the heading names {len(names)}; "
                "correct that line"
            )
        points = []
        for i, wavelength in enumerate(wavelengths):
            own = [cells[columns[name][i]] for name in _VALUES]
            points.append((line, [wavelength, angle, *_values(own, line, path)]))
        name = f"{cells[0]} s"
        found.append(plain_columns(_NAMES, points, [NOTE, f"measured at {name}"], name=name, facts=facts))
    return found


def _values(cells: Sequence[str], line: Line, path: str) -> list[str]:
    """N, C, S and the depolarisation 1 − P². Raises DataError where P is missing."""
    if len(cells) < len(_VALUES) or not is_number(cells[3]):
        raise DataError(
            f"{path}: line {line.number} is not N, C, S and the degree of polarisation; correct that line"
        )
    return [*cells[:3], repr(1 - float(cells[3]) ** 2)]
