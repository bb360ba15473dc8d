"""Detection of the format of a material file by its content."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from pellicle.materials.files import imd, plain_table, refractiveindex_info, sopra, spectraray, woollam
from pellicle.materials.files.optical_constants import MaterialFile
from pellicle.materials.files.text import MaterialText, read_lines

SUFFIXES = {".csv", ".txt", ".tsv", ".dat", ".nk", ".mat", ".yml", ".yaml"}
"""Suffixes of files of optical constants: a name with one of them is a path."""

_READERS: tuple[Callable[[MaterialText], MaterialFile | None], ...] = (
    refractiveindex_info.read_yaml,
    refractiveindex_info.read_table,
    spectraray.read,
    sopra.read_records,
    sopra.read_grid,
    imd.read,
    woollam.read,
)


def read_material_file(path: str | Path) -> MaterialFile:
    """Read n and k, or a dielectric function, from a file.

    **Arguments**: `path`, a file of WVASE, CompleteEASE, SpectraRay, SOPRA or IMD, a download of
    refractiveindex.info, or a plain table; see `docs/reference/materials.md`.

    **Returns** the dispersion with its range (nm), and what was understood of the file.

    **Raises** DataError, one sentence with file, line, column and remedy.
    """
    text = read_lines(path)
    found = (reader(text) for reader in _READERS)
    return next((file for file in found if file is not None), None) or plain_table.read(text)
