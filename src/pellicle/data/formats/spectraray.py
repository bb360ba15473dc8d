"""ASCII files of Sentech's SpectraRay: one pair of columns, Ψ and Δ, for each angle of incidence.

The first line is `; WAVELENGTH 50.2 50.2 60.2 60.2`: each angle in degrees, twice. The rows below
hold the wavelength in nm and Ψ, Δ at each angle. Layout as in files that pyElli is tested with.
"""

from __future__ import annotations

from collections.abc import Sequence

from pellicle.data.tabular.layout import Layout, plain_columns
from pellicle.data.tabular.text import Line, is_number
from pellicle.errors import DataError

#: The word in the heading → the column that it announces.
AXES = {"WAVELENGTH": "wavelength", "ENERGY": "energy", "WAVENUMBER": "wavenumber"}


def layout(lines: Sequence[Line], comments: Sequence[Line], path: str) -> Layout | None:
    """One row per wavelength and angle of such a file, or None. Raises DataError where pairs do not match."""
    words = lines[0].text.lstrip(";").replace(",", ".").split()
    numbers = words[1:]
    if not lines[0].text.startswith(";") or not words or words[0].upper() not in AXES:
        return None
    if not numbers or not all(is_number(number) for number in numbers):
        return None
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
        raise DataError(f"{path}: holds a heading of SpectraRay but no rows; export it again")
    names = (AXES[words[0].upper()], "angle_deg", "psi_deg", "delta_deg")
    return plain_columns(names, rows, [f"read as a SpectraRay file of {', '.join(angles)} degrees"])
