"""Photographs, PNG, TIFF and JPEG, as coded values of R, G and B, and their regions and strips of pixels."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from io import BytesIO
from logging import CRITICAL, getLogger
from typing import Any, NamedTuple

import numpy as np

from pellicle.data.tabular.text import foreign_format, in_file, open_binary, read_bytes
from pellicle.errors import DataError, UsageError, decoding, needs

_SIGNATURES = {
    "PNG": (b"\x89PNG",),
    "TIFF": (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"),
    "JPEG": (b"\xff\xd8\xff",),
}
LARGEST = 2**28
"""Values of the largest TIFF, as many as Pillow reads of other photographs without a warning."""
_COLOUR_MODES = ("RGB", "RGBA", "RGBX")
_FLOAT_LEVELS = 65535.0
"""Levels of a photograph in floats: cameras have 16 bits at most."""


@dataclass(frozen=True, eq=False)
class Photograph:
    """Pixels of a photograph: coded values from 0 to 1, float32, (height, width, 3), row 0 at the top; one
    channel of a grey frame of a movie.

    `step` is the step of the coding, 1/255 for 8 bits, that of 16 bits for floats; `profile` the name of an
    embedded colour profile that is not sRGB, or ""; `floats` is true of floating-point
    values.
    """

    pixels: np.ndarray
    step: float
    path: str
    sha256: str
    notes: tuple[str, ...]
    profile: str = ""
    floats: bool = False

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels."""
        return self.pixels.shape[1], self.pixels.shape[0]


def image_format(path: str | os.PathLike[str]) -> str | None:
    """Return "PNG", "TIFF" or "JPEG" by a file's first bytes, else None. Raises DataError if unreadable."""
    with open_binary(path) as file:
        head = file.read(8)
    return next((name for name, marks in _SIGNATURES.items() if head.startswith(marks)), None)


def refuse_foreign_image(path: str | os.PathLike[str]) -> None:
    """Raise DataError for a file of another kind than tables and photographs, such as HEIC, with advice."""
    with open_binary(path) as file:
        advice = foreign_format(file.read(1024))
    if advice:
        raise DataError(f"{path}: is {advice}")


def read_photograph(path: str | os.PathLike[str]) -> Photograph:
    """Read a photograph in colour.

    A photograph that a camera has turned is turned upright. Palettes become R, G, B.

    **Raises:** DataError, one sentence, for a file that is no such photograph, damaged, grey,
    with transparent pixels, or in another colour model; UsageError without the extra `images`.
    """
    read = read_frame(path)
    if read.pixels.shape[2] == 1:
        raise DataError(f"{path}: is grey: a photograph in R, G, B is needed")
    return read


def read_frame(path: str | os.PathLike[str]) -> Photograph:
    """Read a photograph in colour, or a grey one with a single channel; the rest as `read_photograph`."""
    kind = image_format(path)
    if kind is None:
        refuse_foreign_image(path)
        raise DataError(f"{path}: is no PNG, TIFF or JPEG photograph; save it as one of these")
    content, sha256 = read_bytes(path)
    log = getLogger("tifffile")  # without its messages on damaged files, which one error reports
    level = log.level
    log.setLevel(CRITICAL + 1)
    damaged = decoding(f"{path}: the {kind} cannot be decoded", "save it again")
    try:
        with in_file(path), needs("images", f"{path}: photographs need"), damaged:
            values, full, profile, notes = _tiff(content) if kind == "TIFF" else _by_pillow(content)
    finally:
        log.setLevel(level)
    if values.ndim == 2:
        values = values[..., None]
    if values.ndim != 3 or values.shape[2] not in (1, 3, 4):
        raise DataError(f"{path}: has the shape {values.shape} and not three channels; save it in R, G, B")
    if values.shape[2] == 4 and np.any(values[..., 3] < full):
        clear = max(round(float(100 * np.mean(values[..., 3] < full))), 1)
        raise DataError(
            f"{path}: {clear} % of its pixels are transparent, whose colours are unknown; save it without"
            " alpha"
        )
    coded = values[..., :3].astype(np.float32) / np.float32(full)
    name = _profile_name(profile) if profile else "sRGB"
    foreign = "" if "srgb" in name.lower() or "61966-2" in name or values.shape[2] == 1 else name
    if kind == "JPEG":
        notes = [*notes, "JPEG: its compression shifts colours by a few of 255; PNG and TIFF do not"]
    floats = values.dtype.kind == "f"
    step = 1 / (_FLOAT_LEVELS if floats else full)
    return Photograph(coded, step, str(path), sha256, tuple(notes), foreign, floats)


def _by_pillow(content: bytes) -> tuple[np.ndarray, float, bytes | None, list[str]]:
    from PIL import Image, ImageOps

    opened = Image.open(BytesIO(content))
    notes, profile = [], opened.info.get("icc_profile")
    deep = content.startswith(b"\x89PNG") and content[24:25] == b"\x10"
    if deep and opened.mode.startswith("I"):
        return np.asarray(opened), _FLOAT_LEVELS, profile, notes
    if deep:
        notes.append("PNG of 16 bits, read to 8: save a TIFF to keep all")
    image: Any = ImageOps.exif_transpose(opened)
    if image.mode == "P":
        notes.append("palette converted to R, G, B")
        image = image.convert("RGBA" if "transparency" in image.info else "RGB")
    if image.mode not in (*_COLOUR_MODES, "L"):
        known = {"1": "black and white", "CMYK": "in CMYK", "LA": "grey, with alpha"}
        shown = known.get(image.mode, f"in the mode {image.mode}")
        raise DataError(f"is {shown}: a photograph in R, G, B is needed")
    return np.asarray(image), 255.0, profile, notes


def _tiff(content: bytes) -> tuple[np.ndarray, float, bytes | None, list[str]]:
    import tifffile

    with tifffile.TiffFile(BytesIO(content)) as file:
        page: Any = file.pages[0]
        notes = [f"page 1 of {len(file.pages)}"] if len(file.pages) > 1 else []
        reduced = page.subfiletype is not None and page.subfiletype & 1
        if reduced or _DNG_VERSION in page.tags or content[8:10] == b"CR":
            raise DataError("is a camera's raw file, whose first image is a preview; develop it to a TIFF")
        values, full = tiff_page(page)
        values = _upright(values, page.tags.get(_ORIENTATION))
        notes += ["palette converted to R, G, B"] if page.photometric.name == "PALETTE" else []
        tag = page.tags.get(34675)  # ICC profile
        return values, full, None if tag is None else tag.value, notes


_DNG_VERSION, _ORIENTATION = 50706, 274
"""Tags of a TIFF."""


def _upright(values: np.ndarray, orientation: Any) -> np.ndarray:
    """Rows from the top and columns from the left, by the tag of a TIFF; 5 to 8 exchange rows and columns."""
    code = 1 if orientation is None else int(orientation.value)
    if code >= 5:
        values, code = np.swapaxes(values, 0, 1), {5: 1, 6: 2, 7: 3, 8: 4}.get(code, 1)
    return values[:: -1 if code in (3, 4) else 1, :: -1 if code in (2, 3) else 1]


def tiff_page(page: Any) -> tuple[np.ndarray, float]:
    """Values (height, width), or (height, width, channels), of a page, and the value of white.

    Raises DataError for other colours than R, G, B and grey, and for types that a camera does not have.
    """
    name = page.photometric.name if page.photometric is not None else "unknown"
    if name not in ("RGB", "PALETTE", "MINISBLACK"):
        shown = "grey with black as its largest value" if name == "MINISWHITE" else f"in the model {name}"
        raise DataError(f"is {shown}: a photograph in R, G, B is needed")
    if page.size > LARGEST:
        raise DataError(f"has {page.size:,} values, more than {LARGEST:,}; cut it to the film")
    values = page.asarray()
    if name == "PALETTE":
        values = np.moveaxis(page.colormap[:, values], 0, -1)
    elif values.ndim == 3 and page.planarconfig == 2:  # separate planes
        values = np.moveaxis(values, 0, -1)
    if values.dtype.kind == "f":
        if not (np.isfinite(values).all() and values.min() >= 0 and values.max() <= 1):
            raise DataError("has values beyond 0 to 1: divide them by that of white")
        return values, 1.0
    if values.dtype not in (np.uint8, np.uint16):
        raise DataError(f"has values of the type {values.dtype}: save it with 8 or 16 bits")
    return values, float(np.iinfo(values.dtype).max)


def _profile_name(profile: bytes) -> str:
    """Name of an ICC profile."""
    from PIL import ImageCms

    try:
        described = ImageCms.getProfileDescription(ImageCms.ImageCmsProfile(BytesIO(profile))).strip()
    except (OSError, ImageCms.PyCMSError):
        return "unknown"
    return described or "unknown"


POINT = 2
"""Pixels around a point on each side, which are measured with it: 5 by 5, as colour pickers do."""
STRIP = 5
"""Pixels across a strip."""
_LONGEST = 4000
"""Most positions along a strip."""


class Region(NamedTuple):
    """A rectangle of pixels: column and row of its upper left corner, from 0, width and height."""

    x: int
    y: int
    width: int
    height: int

    def checked(self, name: str) -> Region:
        """Return the region. Raises UsageError for a negative corner, or without a pixel."""
        if min(self.x, self.y) < 0 or min(self.width, self.height) < 1:
            raise UsageError(f"`{name}` must be x,y,width,height in pixels, from 0, got {self}")
        return self

    def pixels(self, photograph: Photograph, name: str = "region") -> np.ndarray:
        """Coded pixels (N, 3). Raises UsageError where the rectangle leaves the photograph."""
        self.checked(name)
        width, height = photograph.size
        if self.x + self.width > width or self.y + self.height > height:
            raise UsageError(
                f"{photograph.path}: `{name}` {self} leaves the photograph of {width} by {height} pixels;"
                " shift or shrink it"
            )
        rows, columns = slice(self.y, self.y + self.height), slice(self.x, self.x + self.width)
        return photograph.pixels[rows, columns].reshape(-1, photograph.pixels.shape[2])

    def __str__(self) -> str:
        return f"{self.x},{self.y},{self.width},{self.height}"


def parse_regions(value: str | Sequence[int] | Sequence[Sequence[int]], name: str = "region") -> list[Region]:
    """Return the rectangles of `x,y,w,h;x,y,w,h`, of four numbers or of a list of them. Raises UsageError."""
    return [Region(*four).checked(name) for four in whole_numbers(value, 4, name, "x,y,width,height")]


def parse_points(
    value: str | Sequence[int] | Sequence[Sequence[int]], photograph: Photograph
) -> list[Region]:
    """Return the squares of 5 by 5 pixels around points `x,y;x,y`, cut at the edges. Raises UsageError."""
    width, height = photograph.size
    squares = []
    for x, y in whole_numbers(value, 2, "points", "x,y"):
        if not (0 <= x < width and 0 <= y < height):
            raise UsageError(
                f"{photograph.path}: the point {x},{y} is not in the photograph of {width} by {height} pixels"
            )
        left, top = max(x - POINT, 0), max(y - POINT, 0)
        squares.append(Region(left, top, min(x + POINT + 1, width) - left, min(y + POINT + 1, height) - top))
    return squares


class Strip(NamedTuple):
    """Positions along a line in pixels from its start, (N,), and the coded pixels across it, (N, 5, 3)."""

    position: np.ndarray
    pixels: np.ndarray


def strip(photograph: Photograph, value: str | Sequence[int]) -> Strip:
    """Return the pixels along the line `x0,y0,x1,y1`, one position per pixel, 5 pixels wide.

    Pixels beyond the edges of the photograph are those at the edge.

    **Raises:** UsageError for ends outside the photograph or on the same pixel.
    """
    x0, y0, x1, y1 = whole_numbers(value, 4, "strip", "x0,y0,x1,y1")[0]
    width, height = photograph.size
    for x, y in ((x0, y0), (x1, y1)):
        if not (0 <= x < width and 0 <= y < height):
            raise UsageError(
                f"{photograph.path}: the end {x},{y} of `strip` is not in its {width} by {height} pixels"
            )
    length = float(np.hypot(x1 - x0, y1 - y0))
    if length < 1:
        raise UsageError('`strip` must join two different pixels, as in `strip="10,40,300,40"`')
    along = np.linspace(0.0, 1.0, min(round(length) + 1, _LONGEST), dtype=float)
    across = np.arange(STRIP) - STRIP // 2
    x = x0 + along[:, None] * (x1 - x0) - across * (y1 - y0) / length
    y = y0 + along[:, None] * (y1 - y0) + across * (x1 - x0) / length
    column, row = (np.clip(np.rint(a), 0, size - 1).astype(int) for a, size in ((x, width), (y, height)))
    return Strip(along * length, photograph.pixels[row, column])


def whole_numbers(value: str | Sequence, count: int, name: str, form: str) -> list[tuple[int, ...]]:
    """Return whole numbers in groups of `count`, from text or from lists. Raises UsageError."""
    if isinstance(value, str):
        groups: list = [re.split(r"\s*,\s*", part.strip()) for part in value.split(";") if part.strip()]
    else:
        groups = [list(part) for part in value] if value and np.ndim(value[0]) else [list(value)]
    try:
        numbers = [tuple(int(x) for x in group) for group in groups]
    except (TypeError, ValueError):
        numbers = []
    if not numbers or any(len(group) != count for group in numbers):
        raise UsageError(f"`{name}` must be {form} in whole pixels, got {value!r}")
    return numbers
