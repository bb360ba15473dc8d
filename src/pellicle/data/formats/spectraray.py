"""ASCII files of Sentech's SpectraRay: a pair of columns, Ψ and Δ, for each angle of incidence.

The first line is `; WAVELENGTH 50.2 50.2 60.2 60.2`, with or without `;`: each angle in degrees, twice. The
rows below hold the wavelength in nm and Ψ, Δ at each angle. With each angle 16 times the columns are the
elements of a Mueller matrix. The layout is that of the test files of pyElli.
"""

from __future__ import annotations

from pellicle.data.tabular.layout import Layout, plain_columns
from pellicle.data.tabular.text import TextFile, is_number
from pellicle.errors import DataError

AXES = {"WAVELENGTH": "wavelength", "ENERGY": "energy", "WAVENUMBER": "wavenumber"}
"""Column of each word in the heading."""
ELEMENTS = 16
"""Elements of a Mueller matrix."""


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
    if len(numbers) == ELEMENTS * len(set(numbers)):
        raise DataError(
            f"{path}: line {lines[0].number} names each angle {ELEMENTS} times, as a Mueller matrix is "
            "written; export psi and delta"
        )
    if numbers[::2] != numbers[1::2] or len(set(numbers)) != len(numbers) // 2:
        raise DataError(
            f"{path}: line {lines[0].number} should name each angle of incidence twice, for psi and for "
            f"delta, but says {' '.join(numbers)}; export it again"
        )
    angles, rows = numbers[::2], []
    for line in lines[1:]:
        cells = line.bare.replace(",", ".").split()
        if len(cells) != 1 + len(numbers):
            raise DataError(
                f"{path}: line {line.number} has {len(cells)} values where a wavelength and psi, delta at "
                f"{len(angles)} angles make {1 + len(numbers)}; correct that line"
            )
        rows += [(line, [cells[0], angle, *cells[1 + 2 * i : 3 + 2 * i]]) for i, angle in enumerate(angles)]
    if not rows:
        raise DataError(f"{path}: has a heading of SpectraRay but no rows; export it again")
    names = (AXES[words[0].upper()], "angle_deg", "psi_deg", "delta_deg")
    notes = [f"read as a SpectraRay file of {', '.join(angles)} degrees"]
    return [plain_columns(names, rows, notes, facts=[("format", "Sentech SpectraRay text")])]
