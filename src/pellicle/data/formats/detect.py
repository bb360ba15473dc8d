"""Detection of a file's format by its content, and the tables in it.

A text reader takes a `TextFile` and returns the tables of plain columns of its spectra, whose rows keep
their line numbers, or None for another format. A binary reader takes the content. Their errors name the line;
the file is put in front here. Cells, units and axes are then checked as in any other file.
"""

import os
from collections.abc import Callable, Sequence
from dataclasses import replace

from pellicle.data.formats import accurion, jcamp, nexus, spectrometers, vendor_binary, woollam
from pellicle.data.formats.ellipsometers import film_sense, horiba, regress_pro, spectraray
from pellicle.data.formats.several_tables import scans_side_by_side, stacked_tables
from pellicle.data.tabular.layout import bulk_layout, layout_of
from pellicle.data.tabular.table import Table
from pellicle.data.tabular.text import TextFile, in_file, read_bytes, text_file
from pellicle.errors import UsageError

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
    scans_side_by_side,
    stacked_tables,
)
BINARY_READERS: tuple[BinaryReader, ...] = (vendor_binary.procspec, nexus.read, vendor_binary.by_openreadout)


def read_tables(path: str | os.PathLike[str], spot: int | None = None) -> list[Table]:
    """Read the tables of a file: one for each spectrum of an instrument's format, one of any other text.

    `spot`, from 1, selects one of several spots of an Accurion file. Raises DataError for an unreadable or
    ambiguous file, UsageError for a missing or wrong spot.
    """
    content, digest = read_bytes(path)
    with in_file(path):
        binary = next((tables for reader in BINARY_READERS if (tables := reader(content))), ())
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


def _export_tables(file: TextFile, spot: int | None) -> Sequence[Table] | None:
    """The tables of an instrument's export, None for another file."""
    table = accurion.read(file, spot)
    if table is not None:
        return [table]
    if spot is not None:
        raise UsageError("`spot` selects a spot of an Accurion file, which this is not")
    return next((tables for reader in TEXT_READERS if (tables := reader(file))), None)
