"""Detection of a file's format by its content, and the tables in it.

A text reader takes a `TextFile` and returns the tables of plain columns of its spectra, whose rows keep
their line numbers, or None for another format. A binary reader takes the content. Their errors name the line;
the file is put in front here. Cells, units and axes are then checked as in any other file.
"""

import os
import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from pellicle.data.formats import (
    accurion,
    jcamp,
    nexus,
    plug_ins,
    spectrometers,
    spreadsheet,
    vendor_binary,
    woollam,
)
from pellicle.data.formats.ellipsometers import against_angle, film_sense, horiba, regress_pro, spectraray
from pellicle.data.formats.several_tables import numbered_columns, scans_side_by_side, stacked_tables
from pellicle.data.tabular.layout import bulk_layout, layout_of
from pellicle.data.tabular.table import Table
from pellicle.data.tabular.text import TextFile, in_file, read_bytes, text_file
from pellicle.errors import DataError, UsageError

TextReader = Callable[[TextFile], Sequence[Table] | None]
BinaryReader = Callable[[bytes], Sequence[Table] | None]

TEXT_READERS: tuple[TextReader, ...] = (
    jcamp.read,
    woollam.read,
    spectraray,
    film_sense,
    regress_pro,
    horiba,
    spectrometers.ocean_optics,
    spectrometers.avantes,
    spectrometers.perkin_elmer,
    spectrometers.jasco,
    spectrometers.stellarnet,
    spectrometers.bruker_dpt,
    against_angle,
    numbered_columns,
    scans_side_by_side,
    stacked_tables,
)
BINARY_READERS: tuple[BinaryReader, ...] = (
    plug_ins.read,
    vendor_binary.procspec,
    nexus.read,
    vendor_binary.by_openreadout,
)

_COMPLETE_EASE = (".se", ".sesnap", ".ise")
_CONTROL = re.compile(rb"[\x00-\x08\x0e-\x19]")


def read_tables(path: str | os.PathLike[str], spot: int | None = None) -> list[Table]:
    """Read the tables of a file: one for each spectrum of an instrument's format, one of any other text.

    `spot`, from 1, selects one of several spots of an Accurion file. Raises DataError for an unreadable or
    ambiguous file, UsageError for a missing or wrong spot.
    """
    content, digest = read_bytes(path)
    with in_file(path):
        binary = next((tables for reader in BINARY_READERS if (tables := reader(content))), ())
        if not binary and spreadsheet.is_workbook(content):
            binary = _workbook(content, str(path), digest)
        if not binary and Path(path).suffix.lower() in _COMPLETE_EASE and _CONTROL.search(content):
            raise DataError(
                "is a binary file of CompleteEASE; open it there, and save its measured data as a text file "
                "(.dat)"
            )
    if binary:
        return [replace(table, path=str(path), sha256=digest) for table in binary]
    if spot is None:
        plain = bulk_layout(
            content,
            lambda head: text_file(head, digest, path),
            lambda head: None if _export_tables(head, None) else layout_of(head),
        )
        if plain is not None:
            return [replace(plain, path=str(path), sha256=digest)]
    file = text_file(content, digest, path)
    with in_file(path):
        tables = _export_tables(file, spot) or [layout_of(file)]
    return [replace(table, path=file.path, sha256=digest) for table in tables]


def _workbook(content: bytes, path: str, sha256: str) -> list[Table]:
    """The tables of all sheets that have one. Raises DataError as the first sheet, where none has."""
    tables, refusals = [], []
    for title, file in spreadsheet.sheets(content, path, sha256):
        try:
            found = _export_tables(file, None) or [layout_of(file)]
        except DataError as refusal:
            refusals.append(refusal)
            continue
        note = f"read from the sheet {title!r}"
        tables += [
            replace(one, name=" ".join(filter(None, (title, one.name))), remarks=(note, *one.remarks))
            for one in found
        ]
    if not tables:
        empty = DataError("is a workbook without cells that can be read; save its sheet as CSV")
        raise next(iter(refusals), empty)
    return tables if len(tables) > 1 else [replace(tables[0], name="")]


def _export_tables(file: TextFile, spot: int | None) -> Sequence[Table] | None:
    """The tables of an instrument's export, None for another file."""
    table = accurion.read(file, spot)
    if table is not None:
        return [table]
    if spot is not None:
        raise UsageError("`spot` selects a spot of an Accurion file, which this is not")
    return next((tables for reader in TEXT_READERS if (tables := reader(file))), None)
