"""Ordinates of JCAMP-DX tables in their ASCII forms: AFFN, PAC, SQZ, DIF and DUP.

**Source**: McDonald and Wilks, JCAMP-DX: a standard form for exchange of infrared spectra in computer
readable form, Appl. Spectrosc. 42, 151 (1988), tables VI and VII. The first number of a line is the
abscissa. SQZ digits (`@A-Ia-i`) begin a value with its sign and first digit, DIF digits (`%J-Rj-r`) a
difference from the value before, DUP digits (`S-Zs`) the number of times that the value or difference before
is meant. After a line that ends in a difference, the next line repeats the last value as a check.

Public readers are not used: jcamp 1.3 and openreadout 0.4 read decimal commas as separators without a word,
and neither refuses a table whose checks fail.
"""

import re
from collections.abc import Sequence
from math import isclose

from pellicle.data.tabular.text import Line
from pellicle.errors import DataError

_SQZ = {c: str(i) for i, c in enumerate("@ABCDEFGHI")} | {c: f"-{i}" for i, c in enumerate("abcdefghi", 1)}
_DIF = {c: str(i) for i, c in enumerate("%JKLMNOPQR")} | {c: f"-{i}" for i, c in enumerate("jklmnopqr", 1)}
_DUP = {c: str(i) for i, c in enumerate("STUVWXYZs", 1)}
_PSEUDO = re.compile(r"[@A-DF-Za-df-s%]")  # letters other than the E of an exponent
_PACKED = re.compile(r"\s*(?P<digit>[@A-Za-s%+\-]?)(?P<number>\d*(?:[.,]\d*)?)(?P<unknown>\?*)\s*")
_PLAIN = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?|\?")
_COMMA = re.compile(r"[+-]?\d+(?:,\d+)?(?:[eE][+-]?\d+)?|\?")
_BETWEEN = re.compile(r"[\s,;]*")

Point = tuple[float, Line]
"""A value and the line it is from; NaN for an ordinate that the file marks as unknown (`?`)."""


def plain_numbers(line: Line, text: str, decimal: str) -> list[float]:
    """Return the numbers of a line in plain form (AFFN or PAC). Raises DataError for other text."""
    pattern = _COMMA if decimal == "," else _PLAIN
    rest = _BETWEEN.fullmatch(pattern.sub("", text))
    if not rest:
        raise DataError(f"line {line.number}: {text.strip()[:40]!r} is no row of numbers; correct that line")
    return [float("nan") if x == "?" else float(x.replace(",", ".")) for x in pattern.findall(text)]


def ordinates(
    lines: Sequence[tuple[Line, str]], most: int, decimal: str
) -> tuple[list[Point], list[tuple[float, int]]]:
    """Return the ordinates of a table (X++(Y..Y)), and the abscissa of each line with its first ordinate.

    Raises DataError for text that is no number, for more than `most` ordinates, and for a check that fails.
    """
    packed = any(_PSEUDO.search(text) for _, text in lines)
    values: list[Point] = []
    starts: list[tuple[float, int]] = []
    differences = False
    for line, text in lines:
        if packed:
            abscissa, read, ends_in_difference = _packed(line, text, most)
        else:
            numbers = plain_numbers(line, text, decimal)
            if not numbers:
                raise _unreadable(line, text)
            (abscissa, *read), ends_in_difference = numbers, False
        if differences and read:
            if not isclose(read[0], values[-1][0], rel_tol=1e-9, abs_tol=1e-9):
                raise DataError(
                    f"line {line.number} begins with {read[0]:g}, not with {values[-1][0]:g}, the "
                    "last value of the line before; the file is damaged, so export it again"
                )
            read = read[1:]
            starts.append((abscissa, len(values) - 1))
        else:
            starts.append((abscissa, len(values)))
        if len(values) + len(read) > most:
            raise DataError(
                f"line {line.number} goes beyond the {most} points that NPOINTS states; export it again"
            )
        values += [(value, line) for value in read]
        differences = ends_in_difference
    return values, starts


def _packed(line: Line, text: str, most: int) -> tuple[float, list[float], bool]:
    """The abscissa and ordinates of a line with pseudo-digits, and whether it ends in a difference."""
    abscissa: float | None = None
    values: list[float] = []
    step: float | None = None
    position = 0
    text = text.rstrip()
    while position < len(text):
        match = _PACKED.match(text, position)
        if match is None or match.end() == position:
            raise _unreadable(line, text[position:])
        position, digit = match.end(), match["digit"]
        number = match["number"].replace(",", ".")
        if match["unknown"]:
            values.append(float("nan"))
            step = None
        elif digit in _DUP:
            count = int(float(_DUP[digit] + number))
            if not values or count > most + 1:
                raise _unreadable(line, match.group())
            for _ in range(count - 1):
                values.append(values[-1] + (step or 0))
        elif digit in _DIF:
            if not values:
                raise _unreadable(line, match.group())
            step = _float(_DIF[digit] + number, line)
            values.append(values[-1] + step)
        else:
            value = _float(_SQZ.get(digit, digit) + number, line)
            step = None
            if abscissa is None:
                abscissa = value
            else:
                values.append(value)
        if len(values) > most + 1:
            raise _unreadable(line, match.group())
    if abscissa is None:
        raise _unreadable(line, text)
    return abscissa, values, step is not None


def _float(text: str, line: Line) -> float:
    try:
        return float(text)
    except ValueError:
        raise _unreadable(line, text) from None


def _unreadable(line: Line, text: str) -> DataError:
    return DataError(
        f"line {line.number}: {text.strip()[:40]!r} is no JCAMP-DX ordinate here; the file is "
        "damaged, so export it again"
    )
