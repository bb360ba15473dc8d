"""Detection of the format of a material file by its content."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from pellicle.materials.formats import instruments, plain_table, refractiveindex_info
from pellicle.materials.formats.optical_constants import MaterialFile, MaterialText, read_text

SUFFIXES = {".csv", ".txt", ".tsv", ".dat", ".nk", ".mat", ".yml", ".yaml"}
"""Suffixes of files of optical constants: a name with one of them is a path."""

READERS: tuple[Callable[[MaterialText], MaterialFile | None], ...] = (
    refractiveindex_info.read_yaml,
    refractiveindex_info.read_table,
    instruments.spectraray,
    instruments.sopra_records,
    instruments.sopra_grid,
    instruments.imd,
    instruments.woollam,
)


def read_material_file(path: str | Path) -> MaterialFile:
    """Read n and k, or a dielectric function, from a file.

    **Arguments**: `path`, a file of WVASE, CompleteEASE, SpectraRay, SOPRA or IMD, a download of
    refractiveindex.info, or a plain table; see `docs/reference/materials.md`.

    **Returns** the dispersion with its range (nm), and what was understood of the file.

    **Raises** DataError, one sentence with file, line, column and remedy.
    """
    text = read_text(path)
    return next((file for reader in READERS if (file := reader(text))), None) or plain_table.read(text)
