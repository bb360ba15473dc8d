"""Text files of ellipsometers: Horiba, Sentech, Film Sense, and those of Regress Pro and ADAP."""

import re
from collections.abc import Sequence

from pellicle.data.formats.exports import Facts, Rows, all_cells, export
from pellicle.data.tabular.columns import MUELLER, recognise_all
from pellicle.data.tabular.table import Table
from pellicle.data.tabular.text import Line, TextFile, is_number
from pellicle.data.tabular.units import wavelength_unit
from pellicle.errors import DataError

_HORIBA_DATA, _HORIBA_ANGLE = "DATA", "INCIDENCE ANGLE"
_HORIBA_FACTS = {"DATE": "date", "SAMPLE": "sample"}
_PSI_DELTA = ("psi", "delta")

_SENTECH_AXES = {"WAVELENGTH": "wavelength", "ENERGY": "energy", "WAVENUMBER": "wavenumber"}
"""Column of each word in the heading."""

_ROW = "SE"
_ALPHA_BETA, _TAN_COS = [_ROW, "ALPHA", "BETA"], [_ROW, "PSI", "DELTA"]

_ONE_WAVELENGTH = re.compile(
    r"^[\s\"'#;]*(?:wave ?length|lambda|λ)\s*[:=\t;, ]\s*(?P<value>\d+(?:[.,]\d+)?)\s*(?P<unit>[^\s\"';,]+)",
    re.IGNORECASE,
)
_MOST_HEADING = 40

_FILM_SENSE = "Film_Sense_"
_STATIC, _DYNAMIC = "Film_Sense_Data", "Film_Sense_Dyn_Data"
_LED_NAMES = ("wavelength (nm)", "angle_deg", "N", "C", "S", "depolarisation")
_LED_VALUES = ("N", "C", "S", "P")
_DATE = re.compile(r"Date: *([\d-]+ [\d:]+)")


def _points(line: Line) -> str:
    """The text of a row with decimal points."""
    return line.bare.replace(",", ".")


def horiba(file: TextFile) -> list[Table] | None:
    """Return Ψ and Δ of a `.spe` file of DeltaPsi2, or None for another format.

    Blocks of a line `# NAME:` and lines of content; below `# INCIDENCE ANGLE:` the angle in degrees, below
    `# DATA:` a line of names (`nm` or `eV`, `Psi`, `Delta`, ...) and the rows. The blocks are those that
    refellips reads.

    Raises DataError where the file has none, but Is and Ic.
    """
    # the lines below each # NAME:
    heads = {comment.number: comment.text.strip().rstrip(":").strip().upper() for comment in file.comments}
    blocks: dict[str, list[Line]] = {}
    name = None
    for line in file.all_lines if heads else []:
        if line.number in heads:
            name = heads[line.number]
            blocks.setdefault(name, [])
        elif name is not None:
            blocks[name].append(line)
    if not {_HORIBA_DATA, _HORIBA_ANGLE} <= set(blocks):
        return None
    header, rows = blocks[_HORIBA_DATA][:1], blocks[_HORIBA_DATA][1:]
    table = [(line, _points(line).split()) for line in rows]
    names = header[0].text.split() if header else []
    stated = blocks[_HORIBA_ANGLE]
    angle = stated[0].text.replace(",", ".").split()[0].rstrip("°") if stated else ""
    unit = wavelength_unit(names[0]) if names else None
    if unit is None or not is_number(angle):
        raise DataError(
            f"a Horiba file should give its angle below {_HORIBA_ANGLE} and the names of its "
            f"columns, nm or eV first, below {_HORIBA_DATA}; export it again"
        )
    columns = [name.lower() for name in names]
    if not set(_PSI_DELTA) <= set(columns):
        raise DataError(
            f"line {header[0].number} names {', '.join(names)}, not Psi and Delta; export these, "
            "since the meaning of Is and Ic depends on the setting of the modulator"
        )
    odd = next((line for line, cells in table if len(cells) != len(names)), None)
    if odd is not None or not table:
        place = f"line {odd.number} has other values than the" if odd else "there are no rows below the"
        raise DataError(f"{place} {len(names)} columns of the heading; correct that, or export it again")
    psi, delta = (columns.index(name) for name in _PSI_DELTA)
    points: Rows = [(line, [cells[0], angle, cells[psi], cells[delta]]) for line, cells in table]
    ignored = [name for name, column in zip(names[1:], columns[1:], strict=True) if column not in _PSI_DELTA]
    notes = [f"columns ignored: {', '.join(ignored)}"] if ignored else []
    facts = [(fact, blocks[name][0].text.strip()) for name, fact in _HORIBA_FACTS.items() if blocks.get(name)]
    read = (f"wavelength ({unit})", "angle_deg", "psi_deg", "delta_deg")
    return [export("Horiba DeltaPsi2 text", read, points, facts=facts, notes=notes, decimal=".")]


def spectraray(file: TextFile) -> list[Table] | None:
    """Return one row per wavelength and angle of Sentech's SpectraRay, or None for another format.

    The first line is `; WAVELENGTH 50.2 50.2 60.2 60.2`, with or without `;`: each angle in degrees, twice.
    The rows below hold the wavelength in nm and Ψ, Δ at each angle. With each angle 16 times the columns are
    the elements of a Mueller matrix, m11, m12, ..., m44. The layout is that of the test files of pyElli.

    Raises DataError where the pairs of columns do not match.
    """
    heading = file.lines[0]
    word, *numbers = heading.text.lstrip(";").replace(",", ".").split() or [""]
    if word.upper() not in _SENTECH_AXES or not numbers or not all(map(is_number, numbers)):
        return None
    angles = list(dict.fromkeys(numbers))
    quantities = MUELLER if len(numbers) == len(MUELLER) * len(angles) else ("psi_deg", "delta_deg")
    count = len(quantities)
    if numbers != [angle for angle in angles for _ in quantities]:
        raise DataError(
            f"line {heading.number} should name each angle of incidence twice, for psi and for delta, or "
            f"{len(MUELLER)} times, for a Mueller matrix, but says {' '.join(numbers)}; export it again"
        )
    rows: Rows = []
    for line in file.lines[1:]:
        cells = _points(line).split()
        if len(cells) != 1 + len(numbers):
            raise DataError(
                f"line {line.number} has {len(cells)} values where a wavelength and {count} values "
                f"at {len(angles)} angles make {1 + len(numbers)}; correct that line"
            )
        for i, angle in enumerate(angles):
            rows.append((line, [cells[0], angle, *cells[1 + count * i : 1 + count * (i + 1)]]))
    if not rows:
        raise DataError("has a heading of SpectraRay but no rows; export it again")
    names = (_SENTECH_AXES[word.upper()], "angle_deg", *quantities)
    notes = [f"measured at {', '.join(angles)} degrees"]
    return [export("Sentech SpectraRay text", names, rows, notes=notes, decimal=".")]


def against_angle(file: TextFile) -> list[Table] | None:
    """Return Ψ and Δ against the angle of incidence at one wavelength, or None for another format.

    A line or comment above the names gives the wavelength: `Wavelength: 632.8 nm`.
    """
    lines = file.lines
    for header, line in enumerate(lines[:_MOST_HEADING]):
        names = all_cells(line.text)
        roles = [column.role for column in recognise_all(names)]
        if "wavelength" in roles or not {"angle", "psi", "delta"} <= set(roles):
            continue
        above = [comment for comment in file.comments if comment.number < line.number]
        stated = [match for each in (*above, *lines[:header]) if (match := _ONE_WAVELENGTH.search(each.text))]
        rows = [(below, all_cells(below.bare)) for below in lines[header + 1 :]]
        if len(stated) != 1 or not rows or not (unit := wavelength_unit(stated[0]["unit"])):
            return None
        number = stated[0]["value"].replace(",", ".")
        points = [(below, [number, *(cell.replace(",", ".") for cell in cells)]) for below, cells in rows]
        note = f"against the angle of incidence, at {number} {unit}"
        return [export("angle scan", [f"wavelength ({unit})", *names], points, notes=[note], decimal=".")]
    return None


def regress_pro(file: TextFile) -> list[Table] | None:
    """Return the rows `SE wavelength alpha beta` of Regress Pro and ADAP, or None for another format.

    The first line is `SE ALPHA BETA` or `SE PSI DELTA`; under the second the columns are tan Ψ and cos Δ.
    Lines `AOI 71.5` and `A -25` may follow, the angles of incidence and of the fixed polariser in degrees; a
    negative A turns the sign of β. Wavelengths are in nm. Reflectances of these programs are rows `uR`, as in
    Woollam's files. The layout and the signs are those of Regress Pro's test files and of its source,
    `elliss.c`.

    Raises DataError for a row of another length, or none.
    """
    lines = file.lines
    heading = lines[0].text.split()
    if heading not in (_ALPHA_BETA, _TAN_COS):
        return None
    angles: dict[str, str] = {}
    rows: Rows = []
    for line in lines[1:]:
        label, *cells = line.bare.split() or [""]
        if label in ("AOI", "A") and len(cells) == 1 and is_number(cells[0]) and not rows:
            angles[label] = cells[0]
        elif label == _ROW and len(cells) == 3:
            rows.append((line, cells))
        else:
            raise DataError(
                f"line {line.number} is not {_ROW}, a wavelength and two values, as the rows of a "
                f"file of {' '.join(heading)} are; correct that line"
            )
    if not rows:
        raise DataError(f"has the heading {' '.join(heading)} but no rows; export it again")
    names, notes = ["wavelength (nm)", "alpha", "beta"], []
    if heading == _TAN_COS:
        names = ["wavelength (nm)", "tan_psi", "cos_delta"]
        notes = ["columns PSI and DELTA read as tan(psi) and cos(delta), which the program writes there"]
    elif "A" in angles:
        analyser = float(angles["A"])
        names.append("analyser_deg")
        rows = [(line, [*cells, f"{abs(analyser):g}"]) for line, cells in rows]
        if analyser <= 0:
            for _, cells in rows:
                beta = cells[2]
                cells[2] = beta[1:] if beta.startswith("-") else f"-{beta.removeprefix('+')}"
    if "AOI" in angles:
        names.append("angle_deg")
        rows = [(line, [*cells, angles["AOI"]]) for line, cells in rows]
    return [export("Regress Pro (ADAP) text", names, rows, notes=notes, decimal=".")]


def film_sense(file: TextFile) -> list[Table] | None:
    """Return the measurement of an FS-1, or one for each time, or None for another format.

    `Film_Sense_Data` or `Film_Sense_Dyn_Data`, then the numbers of LEDs and of measurements and the angle of
    incidence (with a sign), one line per LED that begins with its wavelength in nm, then the measurements: of
    static data one line per LED of N, C, S, the degree of polarisation P and the intensity, of dynamic data a
    line of names (`Time`, `UV_N`, `UV_C`, ...) and a row per time in seconds with these of every LED. N, C
    and S are divided by P. The layout is that of files of both kinds in the tests of refellips.

    Raises DataError for a file that is not complete.
    """
    lines = file.lines
    kind = lines[0].text.strip()
    if not kind.startswith(_FILM_SENSE):
        return None
    if kind not in (_STATIC, _DYNAMIC):
        raise DataError(
            f"is a Film Sense file of the kind {kind}, which is not read; export each measurement as "
            f"{_STATIC}, or those of one spot as {_DYNAMIC}"
        )
    counts = lines[1].text.split() if len(lines) > 1 else []
    if len(counts) < 3 or not counts[0].isdigit() or not counts[1].isdigit() or not is_number(counts[2]):
        raise DataError(
            "line 2 of a Film Sense file should give the numbers of LEDs and of measurements and "
            "the angle of incidence; export it again"
        )
    leds, angle = int(counts[0]), f"{abs(float(counts[2])):g}"
    settings = [[line.text.split()[0], angle] for line in lines[2 : 2 + leds]]
    rows = lines[2 + leds :]
    facts = [("date", date[1]) for line in rows[-1:] if (date := _DATE.search(line.text))]
    if kind == _DYNAMIC:
        return _film_sense_times(rows, settings, facts)
    if int(counts[1]) != 1:
        raise DataError(
            f"has {counts[1]} measurements by its line 2, where a static Film Sense file has one; "
            "export each as a file of its own"
        )
    if len(rows) < leds:
        raise DataError(f"has {len(rows)} lines of N, C, S for {leds} LEDs; it is cut short, export it again")
    points: Rows = [
        (line, [*setting, *_film_sense_values(line.text.split(), line)])
        for line, setting in zip(rows[:leds], settings, strict=True)
    ]
    return [export("Film Sense text", _LED_NAMES, points, facts=facts, decimal=".")]


def _film_sense_times(lines: Sequence[Line], settings: Sequence[list[str]], facts: Facts) -> list[Table]:
    """The measurement of each time; `settings` has the wavelength and the angle of each LED."""
    names = lines[0].text.split() if lines else []
    ends = [name.rpartition("_")[2] for name in names]
    columns = {value: [i for i, end in enumerate(ends) if end == value and i] for value in _LED_VALUES}
    if not names or names[0] != "Time" or any(len(of) != len(settings) for of in columns.values()):
        raise DataError(
            f"the heading of a dynamic Film Sense file should name Time and N, C, S and P of each of "
            f"its {len(settings)} LEDs; export it again"
        )
    rows = [(line, cells) for line in lines[1:] if is_number((cells := line.text.split())[0])]
    if not rows:
        raise DataError("has a Film Sense heading but no measurement; export it again")
    layouts = []
    for line, cells in rows:
        if len(cells) < len(names):
            raise DataError(
                f"line {line.number} has {len(cells)} values where the heading names {len(names)}; "
                "correct that line"
            )
        points: Rows = []
        for setting, places in zip(settings, zip(*columns.values(), strict=True), strict=True):
            values = _film_sense_values([cells[place] for place in places], line)
            points.append((line, [*setting, *values]))
        time = f"{cells[0]} s"
        notes = [f"measured at {time}"]
        kind = "Film Sense text, dynamic"
        layouts.append(export(kind, _LED_NAMES, points, facts=facts, notes=notes, name=time, decimal="."))
    return layouts


def _film_sense_values(cells: Sequence[str], line: Line) -> list[str]:
    """N, C, S and the depolarisation 1 − P². Raises DataError where P is missing."""
    if len(cells) < len(_LED_VALUES) or not is_number(cells[3]):
        raise DataError(
            f"line {line.number} is not N, C, S and the degree of polarisation; correct that line"
        )
    return [*cells[:3], repr(1 - float(cells[3]) ** 2)]
