"""Movies of a film: frames of a camera in colour, or grey behind a filter, as the light of places in time.

Frames are a folder of PNG, TIFF or JPEG files, a list of them, or the pages of one TIFF. Pixels are averaged
in linear light, along a line or in squares. Compressed movies are refused: their colours are those of a
codec."""

from __future__ import annotations

import os
import shlex
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from pellicle.colour.spaces import Encoding
from pellicle.data.cubes.frames import DEPTHS
from pellicle.data.cubes.time_series import file_times, numbers_of
from pellicle.data.photographs import (
    Photograph,
    Region,
    image_format,
    parse_regions,
    read_frame,
    strip,
    tiff_page,
)
from pellicle.errors import DataError, UsageError, decoding, needs

FRAMES = (".png", ".tif", ".tiff", ".jpg", ".jpeg")
"""Suffixes of frames."""
MOVIES = (".mp4", ".m4v", ".mov", ".avi", ".mkv", ".webm", ".gif", ".wmv", ".mpg", ".mpeg")
"""Suffixes of compressed movies."""
_ALONG, _SQUARES = 128, 256
"""Most places along a line, and in an image: each has a path of its own, which takes 0.1 s."""
_LIMITED = 0.05
"""Share of saturated pixels at which a place has no light: the mean of the others is no measure of it."""
_SAMPLE = 16
"""Frames in which the largest value is sought."""


class Movie(NamedTuple):
    """Light of places in time.

    `light` (times, places, channels) is linear, 1 for a coded white, NaN where it is saturated; `time`
    (times,) in `unit`. Places are flat over the axes of `coords`, in pixels. `step` is that of the coding.
    """

    light: np.ndarray
    time: np.ndarray
    unit: str
    coords: dict[str, np.ndarray]
    step: float
    path: str
    notes: tuple[str, ...]

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of places along each axis."""
        return tuple(map(len, self.coords.values()))


@dataclass(frozen=True)
class Frames:
    """Frames by increasing time: files, or pages (numbers from 0) of the one file."""

    files: tuple[Path, ...]
    pages: tuple[int, ...]
    time: np.ndarray
    unit: str
    path: str
    note: str

    def frame(self, i: int) -> Photograph:
        """Read the i-th frame. Raises DataError."""
        if not self.pages:
            return read_frame(self.files[i])
        with _tiff(self.files[0]) as file:
            values, full = tiff_page(file.pages[self.pages[i]])
        values = (values if values.ndim == 3 else values[..., None])[..., :3] / np.float32(full)
        return Photograph(values, 1 / full, self.path, "", ())


def refuse_movie(path: str | os.PathLike[str]) -> None:
    """Raise DataError for a compressed movie, with the command that makes frames of it."""
    name = Path(path)
    if name.suffix.lower() in MOVIES and not name.is_dir():
        folder = shlex.quote(str(name.with_name(f"{name.stem}_frames")))
        command = f"mkdir {folder} && ffmpeg -i {shlex.quote(str(name))} {folder}/%06d.png"
        raise DataError(
            f"{name}: is a compressed movie, which is not read: make frames of it with {command} and fit that"
            " folder with `frame_rate`"
        )


def is_movie(source: Any) -> bool:
    """True for frames: a folder that has images and no table of spectra, a list of images, or one TIFF.

    Raises DataError for a compressed movie, and for a path at which there is nothing.
    """
    if isinstance(source, str | os.PathLike):
        refuse_movie(source)
        path = Path(source)
        if not path.exists():
            raise DataError(f"{path}: no such file or folder; check its name")
        if path.is_dir():
            files = [file for file in path.iterdir() if not file.name.startswith(".")]
            return 2 * sum(_is_frame(file) for file in files) > len(files)
        return path.is_file() and image_format(path) is not None
    return isinstance(source, list | tuple) and bool(source) and all(_is_frame(Path(x)) for x in source)


def _is_frame(file: Path) -> bool:
    return file.suffix.lower() in FRAMES


@contextmanager
def _tiff(path: Path) -> Iterator[Any]:
    with needs("images", f"{path}: frames need"), decoding(f"{path}: cannot be decoded", "save it again"):
        import tifffile

        with tifffile.TiffFile(path) as file:
            yield file


def frames_of(source: Any, time_from: str | None = None, frame_rate: float | None = None) -> Frames:
    """Find the frames of a movie and their times.

    **Arguments:** a folder, a list of files, or a TIFF of several pages; `time_from` as of `read_cube`; or
    `frame_rate`, frames per second, by the number in the names, so that a missing frame leaves a gap.

    **Raises:** DataError or UsageError, one sentence with the remedy.
    """
    if time_from is not None and frame_rate is not None:
        raise UsageError("`time_from` and `frame_rate` exclude each other: give one of them")
    if frame_rate is not None and not 0 < frame_rate < np.inf:
        raise UsageError(f"`frame_rate` must be above zero, in frames per second, got {frame_rate:g}")
    listed = [Path(x) for x in source] if isinstance(source, list | tuple) else [Path(source)]
    folder = listed[0].is_dir()
    files = sorted(filter(_is_frame, listed[0].iterdir())) if folder else listed
    path = str(listed[0] if len(listed) == 1 else listed[0].parent)
    pages: tuple[int, ...] = ()
    if len(files) == 1:
        [file] = files
        pages, interval = _pages(file)
        if time_from is not None:
            raise UsageError(f"{file}: has its times by `frame_rate`, not by `time_from`")
        if frame_rate is None and not interval:
            raise UsageError(f"{file}: states no times of its pages: give `frame_rate`, in frames per second")
        time, unit = np.arange(len(pages)) * (1 / frame_rate if frame_rate else interval), "s"
        note = "the frame rate" if frame_rate else "its interval of frames"
    elif frame_rate is not None:
        number, _ = numbers_of([file.stem for file in files], path, "frames", "frame")
        time, unit = (number - number.min()) / frame_rate, "s"
        note = f"the numbers in the names, {frame_rate:g} in a second"
    else:
        try:
            time, unit, note = file_times(files, time_from or "name")
        except DataError as error:
            raise DataError(f"{error}, or the frames per second as `frame_rate`") from None
    time = np.asarray(time, float)
    order = np.argsort(time, kind="stable")
    order = order[np.isfinite(time[order])]
    twice = np.flatnonzero(np.diff(time[order]) == 0)
    if twice.size:
        a, b = (files[order[twice[0] + i]].name for i in (0, 1))
        raise DataError(f"{path}: {b} has the time of {a}: leave one of them out")
    if pages:
        return Frames(tuple(files), pages, time, unit, path, note)
    return Frames(tuple(files[i] for i in order), (), time[order], unit, path, note)


def _pages(file: Path) -> tuple[tuple[int, ...], float]:
    """Numbers of the pages of a TIFF, and their interval in seconds by ImageJ, 0 where it is not stated."""
    if image_format(file) != "TIFF":
        raise DataError(f"{file}: is one image, and a movie has many: give their folder, or a TIFF of pages")
    with _tiff(file) as opened:
        count, about = len(opened.pages), opened.imagej_metadata or {}
    if count == 1:
        raise DataError(f"{file}: has one page, and a movie has many: give the folder of its frames")
    return tuple(range(count)), float(about.get("finterval", 0.0))


def read_movie(
    frames: Frames,
    coding: Encoding,
    *,
    strip_ends: str | Sequence[int] | None = None,
    region: str | Sequence[int] | None = None,
    flat_field: str | os.PathLike[str] | None = None,
) -> Movie:
    """Read the light of places from all frames.

    **Arguments:** `strip_ends` "x0,y0,x1,y1" of a line, 5 pixels wide, along which places are, or `region`
    "x,y,width,height", by default the whole frame, which is divided into squares; `flat_field`, a photograph
    of an evenly white surface, by which the light is divided.

    **Raises:** DataError or UsageError for a frame of another size, and for pixels outside.
    """
    if strip_ends is not None and region is not None:
        raise UsageError("`strip` and `region` exclude each other: leave one out")
    first = frames.frame(0)
    if region is not None and len(parse_regions(region)) > 1:
        raise UsageError("`region` of a movie must be one rectangle")
    box = Region(0, 0, *first.size) if region is None else parse_regions(region)[0]
    places = _line(first, strip_ends) if strip_ends is not None else _squares(first, box)
    full = _saturation(frames)
    even = 1.0
    if flat_field is not None:
        field = read_frame(flat_field)
        _check_form(field, first)
        even, _ = places.light(field, coding, 2.0)
        even = even / np.nanmax(even, axis=0)
    light, lost = [], 0
    for i in range(len(frames.time)):
        frame = frames.frame(i)
        _check_form(frame, first)
        linear, share = places.light(frame, coding, full)
        light.append(np.where(share[:, None] > _LIMITED, np.nan, linear / even))
        lost += int(np.sum(share > _LIMITED))
    notes = [f"{len(frames.time)} frames, times from {frames.note}", places.note, *first.notes]
    notes += [f"divided by the flat field {flat_field}"] if flat_field is not None else []
    if lost:
        notes.append(f"{100 * lost / (len(light) * len(light[0])):.2g} % of the light is saturated: left out")
    step = first.step / np.sqrt(places.size)
    return Movie(np.stack(light), frames.time, frames.unit, places.coords, step, frames.path, tuple(notes))


def _saturation(frames: Frames) -> float:
    """The coded value from which a pixel is saturated: that of the camera's bits where it is reached."""
    some = np.unique(np.linspace(0, len(frames.time) - 1, _SAMPLE).astype(int))
    shown = [frames.frame(int(i)) for i in some]
    largest, white = max(float(x.pixels.max()) for x in shown), 1 / shown[0].step
    return largest if round(largest * white) in (2**bits - 1 for bits in DEPTHS) else 1.0


def _check_form(frame: Photograph, first: Photograph) -> None:
    """Raise DataError for a frame that is not like the first."""
    if frame.pixels.shape != first.pixels.shape:
        one, other = (" x ".join(map(str, x.pixels.shape)) for x in (frame, first))
        raise DataError(
            f"{frame.path}: has {one} values (height, width, channels) and {first.path} has {other}: leave"
            " out what is no frame of the movie"
        )


class _Places(NamedTuple):
    """Places of a frame: rows and columns of their pixels (places, pixels), and their coordinates."""

    row: np.ndarray
    column: np.ndarray
    coords: dict[str, np.ndarray]
    note: str

    @property
    def size(self) -> int:
        """Pixels of a place."""
        return self.row.shape[1]

    def light(self, frame: Photograph, coding: Encoding, full: float) -> tuple[np.ndarray, np.ndarray]:
        """Linear channels (places, channels), and the share of pixels that are saturated (places,)."""
        coded = frame.pixels[self.row, self.column]
        return _linear(coded, coding).mean(axis=1), np.mean(np.any(coded >= full, axis=2), axis=1)


def _linear(coded: np.ndarray, coding: Encoding) -> np.ndarray:
    """Linear light of coded channels; a single one has the curve of each of three."""
    if coded.shape[-1] == 3:
        return coding.decoded(coded)
    return coding.decoded(np.repeat(coded, 3, axis=-1))[..., :1]


def _line(first: Photograph, ends: str | Sequence[int]) -> _Places:
    """Places along a line, of 5 pixels across it and so many along it that there are not too many."""
    index = np.indices(first.pixels.shape[:2]).transpose(1, 2, 0)
    taken = strip(replace(first, pixels=index), ends)
    along = -(-len(taken.position) // _ALONG)
    count = len(taken.position) // along
    pixels = taken.pixels[: count * along].reshape(count, -1, 2)
    where = taken.position[: count * along].reshape(count, along).mean(axis=1)
    note = f"line of {count} places, means of {pixels.shape[1]} pixels"
    return _Places(pixels[..., 0], pixels[..., 1], {"x": where}, note)


def _squares(first: Photograph, box: Region) -> _Places:
    """Places in a rectangle: squares of pixels, not too many."""
    index = np.indices(first.pixels.shape[:2]).transpose(1, 2, 0)
    corners = box.pixels(replace(first, pixels=index)).reshape(box.height, box.width, 2)
    side = int(np.ceil(np.sqrt(box.height * box.width / _SQUARES)))
    rows, columns = max(box.height // side, 1), max(box.width // side, 1)
    high, wide = min(side, box.height), min(side, box.width)
    cut = corners[: rows * high, : columns * wide].reshape(rows, high, columns, wide, 2)
    pixels = cut.transpose(0, 2, 1, 3, 4).reshape(rows * columns, -1, 2)
    middle = pixels.mean(axis=1).reshape(rows, columns, 2)
    coords = {"y": middle[:, 0, 0], "x": middle[0, :, 1]}
    note = f"region {box}: {rows} x {columns} places, means of {high} by {wide} pixels"
    return _Places(pixels[..., 0], pixels[..., 1], coords, note)
