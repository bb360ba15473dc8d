"""Plain tables of optical constants: a wavelength or energy, then n and k, or ε₁ and ε₂.

Whatever `pellicle.data` reads: commas, semicolons, tabs or blanks, decimal commas, `#` comments. With a
header, columns are found by name (`wavelength_nm`, `Wavelength, µm`, `Energy (eV)`; `n`, `k`; `eps1`,
`eps2`); without one they are wavelength in nm, n, k.
"""

import re
from collections.abc import Sequence
from dataclasses import replace

from pellicle.data.tabular.columns import Column, is_unit_row, recognise_all
from pellicle.data.tabular.layout import header_cells, read_table
from pellicle.data.tabular.table import Table
from pellicle.data.tabular.text import split
from pellicle.data.tabular.units import wavelength_unit
from pellicle.errors import DataError
from pellicle.materials.formats.optical_constants import (
    MaterialFile,
    MaterialText,
    OpticalConstants,
    material_file,
)

SHORTEST_ASSUMED = 30.0
"""Wavelengths that all lie below this (nm), in a file that gives no unit, are more likely µm or eV."""

_REMEDY = "write the table as wavelength_nm,n,k with that header"
_CHOICES = "`wavelength_um,n,k`, `wavelength_nm,n,k`, `energy_eV,n,k` or `energy_eV,eps1,eps2`"


def _names_of_permittivity(number: str, short: str, long: str, letter: str) -> tuple[str, ...]:
    symbols = ("eps", "e", "ε", "ϵ", "epsilon")
    parts = f"{short}(eps)", f"{long}(eps)", f"{short}(epsilon)", f"{short}(ε)"
    return (*(f"{symbol}{number}" for symbol in symbols), *parts, f"ε{letter}", f"eps{letter}")


_NAMES = {
    "wavelength": ("e(ev)", "hv(ev)", "hν(ev)"),
    "n": ("n", "re(n)", "real(n)", "refractiveindex", "indexofrefraction", "index"),
    "k": ("k", "κ", "kappa", "im(n)", "imag(n)", "extinctioncoefficient", "extinction"),
    "eps1": _names_of_permittivity("1", "re", "real", "r"),
    "eps2": _names_of_permittivity("2", "im", "imag", "i"),
}
"""Names of columns, in lower case without blanks and underscores."""


def read(text: MaterialText) -> MaterialFile:
    """Read a plain table.

    Raises DataError, one sentence with file, line, column and remedy.
    """
    table = read_table(text.path)
    rows = set(map(int, table.text.lines))
    begin = min(rows, default=0)
    strange = next((line for line in text.lines if line.number >= begin and line.number not in rows), None)
    if strange is not None:
        raise DataError(f"line {strange.number} is no row of numbers: delete it, or put # before it")
    names = _header(text, table)
    columns = _by_position(text, table) if names is None else _by_name(text, table, names)
    order = list(columns)
    values = dict(zip(order, table.numbers([columns[name].position for name in order]), strict=True))
    axis = columns["wavelength"]

    def label(what: str) -> str:
        column = columns[what]
        return f"column {column.name!r}" if column.name else f"column {column.position + 1}"

    if axis.unknown_unit:
        raise DataError(
            f"{label('wavelength')} is in an unknown unit {axis.unknown_unit!r}; "
            f"convert it to nm and {_REMEDY}"
        )
    assumed = ""
    if axis.unit is None:
        low, high = values["wavelength"].min(), values["wavelength"].max()
        if high < SHORTEST_ASSUMED:
            raise DataError(
                f"{label('wavelength')} runs from {low:g} to {high:g} without a "
                f"{'unit' if names else 'header'}, which is no wavelength in nm; make the header {_CHOICES}"
            )
        assumed = f"{text.path} states no unit of its wavelengths: they were read as nm"
        assumed += "." if names else ", and its columns, without a header, as n and k."
    dielectric = "eps1" in columns
    first, second = ("eps1", "eps2") if dielectric else ("n", "k")
    constants = OpticalConstants(
        values["wavelength"],
        axis.unit or "nm",
        values[first],
        values.get(second),
        dielectric,
        ("wavelength", first, second),
        lambda row, what: f"line {table.text.lines[row]}, {label(what)}",
    )
    return material_file(constants, "table", assumed=assumed)


def _header(text: MaterialText, table: Table) -> Sequence[str] | None:
    """Names of the columns, with their units where a row of units follows; None without a header.

    Separated by commas, a header may name more columns than the rows have.
    """
    if table.names and _is_header(table.names):
        return table.names
    delimiter = table.text.delimiter
    above = [line.text for line in text.lines if line.number < table.text.lines[0]]
    names = split(above[-1], delimiter) if above else []
    if is_unit_row(names) and len(above) > 1:
        units = names
        names = split(above[-2], delimiter)
        units += [""] * (len(names) - len(units))
        names = [f"{n} ({u})" if wavelength_unit(u) else n for n, u in zip(names, units, strict=False)]
    width = _cells_per_row(text, table)
    if (len(names) == width or delimiter != " ") and _is_header(names):
        return names
    if table.names:
        return table.names
    above = text.text.splitlines()[: int(table.text.lines[0]) - 1]
    comments = [line.strip().lstrip("#% ") for line in above if line.strip()[:1] in ("#", "%")]
    commented = [header_cells(comment, delimiter, width) for comment in comments]
    return next((names for names in commented[::-1] if len(names) == width and _is_header(names)), None)


def _is_header(names: Sequence[str]) -> bool:
    roles = {_recognised(column)[0] for column in recognise_all(names)}
    return "wavelength" in roles and bool(roles & {"n", "eps1"})


def _by_name(text: MaterialText, table: Table, names: Sequence[str]) -> dict[str, Column]:
    """The columns for wavelength and n, k or eps1, eps2; k may be absent."""
    columns: dict[str, Column] = {}
    for plain in recognise_all(names):
        what, column = _recognised(plain)
        if what in columns and what in _NAMES:
            raise DataError(f"two columns are named {what}; rename one, or {_REMEDY}")
        columns[what] = column
    if "n" in columns and "eps1" in columns:
        columns = {what: column for what, column in columns.items() if not what.startswith("eps")}
    expected = ("wavelength", "eps1", "eps2") if columns.keys() & {"eps1", "eps2"} else ("wavelength", "n")
    for what in expected:
        if what not in columns:
            raise DataError(f"expected a column named {what}, found {', '.join(names)}; {_REMEDY}")
    if "k" in columns and columns["k"].position >= _cells_per_row(text, table):
        del columns["k"]  # named in the header, absent from every row, as refellips writes
    return {what: columns[what] for what in _NAMES if what in columns}


def _recognised(column: Column) -> tuple[str, Column]:
    """The role of a column in a table of optical constants, and the column."""
    plain = re.sub(r"[\s_]+|[(\[](?:-|1)?[)\]]$", "", column.name.strip().strip('"').lower())
    what = next((role for role, names in _NAMES.items() if plain in names), column.role)
    if what == "wavelength" and column.role != "wavelength":
        return what, replace(column, role=what, unit="eV")
    return what, column


def _cells_per_row(text: MaterialText, table: Table) -> int:
    """The largest number of cells in any row."""
    rows = (line.text for line in text.lines if line.number >= table.text.lines[0])
    return max(len(split(row, table.text.delimiter)) for row in rows)


def _by_position(text: MaterialText, table: Table) -> dict[str, Column]:
    if text.lines[0].number < table.text.lines[0]:
        raise DataError(
            f"expected a header right above the rows, found none above line "
            f"{table.text.lines[0]}; {_REMEDY}, other lines marked with #"
        )
    width = _cells_per_row(text, table)
    if width not in (2, 3):
        raise DataError(f"expected 2 or 3 columns where there is no header, found {width}; {_REMEDY}")
    return {what: Column(i, "", what) for i, what in enumerate(("wavelength", "n", "k")[:width])}
