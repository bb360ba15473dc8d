"""Models of CompleteEASE as text (`.mod`, `_FitLog` of a `.SEsnap`): blocks, parameters and tables of media.

The layout is that of nine public `.mod` files of the versions 1, 3 and 4.6: lines `start_NAME` and `end_NAME`
around blocks, cells between tabs, texts between apostrophes, lengths in Å.
"""

import base64
import gzip
import io
import itertools
import re
import zipfile
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from pellicle.data.tabular.text import decoded
from pellicle.errors import DataError
from pellicle.materials.formats import optical_constants as optical

MARK = "ALPHA_MULTILAYER"
"""The line above the blocks of a model."""
_LARGEST = 64 << 20  # bytes of an unpacked text or table
_TABLES = ("ANGSTROMS", "EV", "NM", "MICRONS")
"""Kinds of media that are tables; the wavelengths in a model are in Å whatever the kind."""


class Parameter(NamedTuple):
    """A number of a model, whether it is fitted, and its bounds."""

    value: float
    free: bool
    lower: float
    upper: float
    name: str


@dataclass
class Block:
    """Lines between `start_NAME` and `end_NAME` as cells, and the blocks among them."""

    name: str
    rows: list[list[str]] = field(default_factory=list)
    blocks: list["Block"] = field(default_factory=list)

    def block(self, name: str) -> "Block":
        """The block of a name; an empty one where there is none."""
        return next((one for one in self.blocks if one.name == name), Block(name))

    @property
    def numbers(self) -> dict[str, Parameter]:
        """The parameters that the lines of this block state, by name."""
        return {x.name: x for row in self.rows if (x := parameter(row)) is not None}

    def above(self, name: str) -> str:
        """The cell above the line of a parameter, which turns it on (`T`) or off."""
        pairs = itertools.pairwise(self.rows)
        return next((over[0] for over, row in pairs if (x := parameter(row)) and x.name == name), "F")

    def word(self) -> str:
        """The first cell of the block, `F` where it has none."""
        return self.rows[0][0] if self.rows and self.rows[0] else "F"


class Medium(NamedTuple):
    """The medium of a layer: its `name` and `kind`, and the block of the layer, with its numbers."""

    name: str
    kind: str
    layer: Block

    def part(self, words: str) -> Block:
        """The block `NAME words`."""
        return self.layer.block(f"{self.name} {words}")


def parameter(row: list[str]) -> Parameter | None:
    """The parameter of a line: value, T or F, bounds, a flag, its name; None for another line."""
    if len(row) > 6 and row[1] not in ("T", "F"):
        row = row[1:]  # the number of oscillators stands before Einf
    if len(row) < 6 or row[1] not in ("T", "F"):
        return None
    try:
        value, lower, upper = (float(row[i]) for i in (0, 2, 3))
    except ValueError:
        return None
    return Parameter(value, row[1] == "T", lower, upper, row[5])


def model(content: bytes) -> Block | None:
    """The blocks of a model file, or of the log in a snapshot; None for another file.

    Raises DataError for several models, and for one that is cut off.
    """
    if content.startswith(b"PK"):
        try:
            with zipfile.ZipFile(io.BytesIO(content)) as packed, packed.open("_FitLog") as log:
                content = log.read(_LARGEST)
        except (zipfile.BadZipFile, KeyError):
            return None
    if MARK.encode() not in content and MARK.encode("utf-16-le") not in content:
        return None
    lines = decoded(content).splitlines()
    marks = [i for i, line in enumerate(lines) if line.strip() == MARK]
    if len(marks) != 1:
        raise DataError(f"has {len(marks)} models of CompleteEASE; save the one that is meant as a .mod file")
    open_blocks = [Block("")]
    for text in map(str.strip, lines[marks[0] + 1 :]):
        if text.startswith("start_"):
            open_blocks.append(Block(text[6:]))
            open_blocks[-2].blocks.append(open_blocks[-1])
        elif len(open_blocks) > 1 and text == f"end_{open_blocks[-1].name}":
            open_blocks.pop()
        elif text:
            open_blocks[-1].rows.append([cell.strip().strip("'") for cell in text.split("\t")])
    if len(open_blocks) > 1 or not open_blocks[0].block("Model Structure").blocks:
        raise DataError("is a model of CompleteEASE that is cut off; save it again")
    return open_blocks[0]


def layers(root: Block) -> list[Block]:
    """The layers of a model from the substrate up."""
    every = [x for x in root.block("Model Structure").blocks if re.fullmatch(r"Layer\d+", x.name)]
    return sorted(every, key=lambda x: int(x.name[5:]))


def medium(layer: Block) -> Medium:
    """The medium of a layer. Raises DataError for layers of several media."""
    row = layer.rows[1] if len(layer.rows) > 1 else [""]
    if row[0] != "Layer" or len(row) < 3:
        raise DataError(f"{layer.name} is of the kind {row[0]!r}, which is not read: write it in a recipe")
    return Medium(row[1], row[2], layer)


def is_table(one: Medium) -> bool:
    """True for a medium whose model file holds its n and k."""
    return one.kind.upper() in _TABLES


def table(content: bytes, name: str) -> optical.MaterialFile:
    """The optical constants of the medium `name` of a model. Raises DataError where it has none."""
    root = model(content)
    media = [] if root is None else [medium(x) for x in layers(root)]
    found = next((x for x in media if x.name == name and is_table(x)), None)
    if found is None:
        known = ", ".join(x.name for x in media if is_table(x)) or "none"
        raise DataError(f"has no table of a medium {name!r}; its tables: {known}")
    block = found.layer.block("Mat Table")
    columns = [_array(block.block(f"{word} Array")) for word in ("Wvl", "e1", "e2")]
    if len({len(x) for x in columns}) != 1 or not len(columns[0]):
        raise DataError(f"the table of {name} is damaged; save the model again")
    constants = optical.OpticalConstants(
        *(columns[0], "A", columns[1], columns[2], True, ("wavelength", "e1", "e2")),
        lambda row, word: f"row {row + 1} of {name}, column {word!r}",
    )
    title = next(iter(found.layer.block("File Info").rows), [name])[0]
    return optical.material_file(constants, "table of a CompleteEASE model", title)


def _array(block: Block) -> np.ndarray:
    """Numbers of four bytes, the most significant first, packed by gzip and written in base64."""
    try:
        packed = gzip.GzipFile(fileobj=io.BytesIO(base64.b64decode(block.word(), validate=True)))
        return np.frombuffer(packed.read(_LARGEST), ">f4").astype(float)
    except (ValueError, OSError, EOFError):
        return np.empty(0)
