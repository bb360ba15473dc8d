"""Text files (`.spe`) of Horiba's DeltaPsi2.

Blocks of a line `# NAME:` and lines of content; below `# INCIDENCE ANGLE:` the angle in degrees, below
`# DATA:` a line of names (`nm` or `eV`, `Psi`, `Delta`, ...) and the rows. The blocks are those that
refellips reads.
"""

from __future__ import annotations

from collections.abc import Sequence

from pellicle.data.tabular.layout import Layout, plain_columns
from pellicle.data.tabular.text import Line, TextFile, is_number
from pellicle.data.tabular.units import wavelength_unit
from pellicle.errors import DataError

DATA, ANGLE = "DATA", "INCIDENCE ANGLE"
NOTE = "read as a Horiba (DeltaPsi2) file"
_FACTS = {"DATE": "date", "SAMPLE": "sample"}
_READ = ("psi", "delta")


def layouts(file: TextFile) -> list[Layout] | None:
    """Return the rows of Ψ and Δ, or None for another format.

    Raises DataError where the file has none, but Is and Ic.
    """
    path = file.path
    blocks = _blocks(file)
    if not {DATA, ANGLE} <= set(blocks):
        return None
    header, rows = (
        blocks[DATA][:1],
        [(line, line.bare.replace(",", ".").split()) for line in blocks[DATA][1:]],
    )
    names = header[0].text.split() if header else []
    angle = blocks[ANGLE][0].text.replace(",", ".").split()[0].rstrip("°") if blocks[ANGLE] else ""
    unit = wavelength_unit(names[0]) if names else None
    if unit is None or not is_number(angle):
        raise DataError(
            f"{path}: a Horiba file should give its angle below {ANGLE} and the names of its columns, nm or "
            f"eV first, below {DATA}; export it again"
        )
    columns = [name.lower() for name in names]
    if not set(_READ) <= set(columns):
        raise DataError(
            f"{path}: line {header[0].number} names {', '.join(names)}, not Psi and Delta; export these, "
            "since the meaning of Is and Ic depends on the setting of the modulator"
        )
    odd = next((line for line, cells in rows if len(cells) != len(names)), None)
    if odd is not None or not rows:
        place = f"line {odd.number} has other values than the" if odd else "there are no rows below the"
        raise DataError(
            f"{path}: {place} {len(names)} columns of the heading; correct that, or export it again"
        )
    psi, delta = (columns.index(name) for name in _READ)
    found = [(line, [cells[0], angle, cells[psi], cells[delta]]) for line, cells in rows]
    ignored = [name for name, column in zip(names[1:], columns[1:], strict=True) if column not in _READ]
    notes = [NOTE, *([f"columns ignored: {', '.join(ignored)}"] if ignored else [])]
    facts = [("format", "Horiba DeltaPsi2 text")]
    facts += [(fact, blocks[name][0].text.strip()) for name, fact in _FACTS.items() if blocks.get(name)]
    return [
        plain_columns(
            (f"wavelength ({unit})", "angle_deg", "psi_deg", "delta_deg"), found, notes, facts=facts
        )
    ]


def _blocks(file: TextFile) -> dict[str, Sequence[Line]]:
    """The lines below each `# NAME:`."""
    blocks: dict[str, list[Line]] = {}
    if not file.comments:
        return {}
    heads = {comment.number: comment.text.strip().rstrip(":").strip().upper() for comment in file.comments}
    name = None
    for line in file.all_lines:
        if line.number in heads:
            name = heads[line.number]
            blocks.setdefault(name, [])
        elif name is not None:
            blocks[name].append(line)
    return dict(blocks)
