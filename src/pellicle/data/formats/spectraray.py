"""ASCII files of Sentech's SpectraRay: Ψ and Δ, or a Mueller matrix, for each angle of incidence.

The first line is `; WAVELENGTH 50.2 50.2 60.2 60.2`, with or without `;`: each angle in degrees, twice. The
rows below hold the wavelength in nm and Ψ, Δ at each angle. With each angle 16 times the columns are the
elements of a Mueller matrix, m11, m12, ..., m44. The layout is that of the test files of pyElli.
"""

from __future__ import annotations

from pellicle.data.tabular.column_names import MUELLER
from pellicle.data.tabular.layout import Layout, plain_columns
from pellicle.data.tabular.text import TextFile, is_number
from pellicle.errors import DataError

AXES = {"WAVELENGTH": "wavelength", "ENERGY": "energy", "WAVENUMBER": "wavenumber"}
"""Column of each word in the heading."""
_PAIR = ("psi_deg", "delta_deg")


def layouts(file: TextFile) -> list[Layout] | None:
    """Return one row per wavelength and angle, or None for another format.

    Raises DataError where the pairs of columns do not match.
    """
    lines, path = file.lines, file.path
    words = lines[0].text.lstrip(";").replace(",", ".").split()
    numbers = words[1:]
    if not words or words[0].upper() not in AXES:
        return None
    if not numbers or not all(is_number(number) for number in numbers):
        return None
    angles, rows = list(dict.fromkeys(numbers)), []
    quantities = MUELLER if len(numbers) == len(MUELLER) * len(angles) else _PAIR
    count = len(quantities)
    if numbers != [angle for angle in angles for _ in quantities]:
        raise DataError(
            f"{path}: line {lines[0].number} should name each angle of incidence twice, for psi and for "
            f"delta, or {len(MUELLER)} times, for a Mueller matrix, but says {' '.join(numbers)}; export it"
            " again"
        )
    for line in lines[1:]:
        cells = line.bare.replace(",", ".").split()
        if len(cells) != 1 + len(numbers):
            raise DataError(
                f"{path}: line {line.number} has {len(cells)} values where a wavelength and {count} values "
                f"at {len(angles)} angles make {1 + len(numbers)}; correct that line"
            )
        for i, angle in enumerate(angles):
            rows.append((line, [cells[0], angle, *cells[1 + count * i : 1 + count * (i + 1)]]))
    if not rows:
        raise DataError(f"{path}: has a heading of SpectraRay but no rows; export it again")
    names = (AXES[words[0].upper()], "angle_deg", *quantities)
    notes = [f"read as a SpectraRay file of {', '.join(angles)} degrees"]
    return [plain_columns(names, rows, notes, facts=[("format", "Sentech SpectraRay text")])]
