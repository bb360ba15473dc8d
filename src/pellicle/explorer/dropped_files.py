"""Data files that are dropped on the explorer, or lie in its folder."""

import tempfile
from base64 import b64decode
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from pellicle.data.read_spectrum import read_spectra
from pellicle.data.spectrum import Spectrum
from pellicle.errors import DataError, UsageError

LARGEST_FILE = 20_000_000
"""Bytes of the largest data file."""
_LONGEST_NAME = 120


def measured_spectra(body: Mapping[str, Any], folder: Path | None, signal: str) -> list[Spectrum]:
    """Read the spectra of a request: `name` with `text` or `base64`, or `file`, one in the folder.

    A file that does not state its signal has that of the scene. **Raises:** DataError or UsageError in one
    sentence.
    """
    if "file" in body:
        path = _inside(folder, body["file"])
        return _read(path, path.name, signal)
    name, content = _content(body)
    with tempfile.TemporaryDirectory(prefix="pellicle-") as place:
        path = Path(place) / name
        path.write_bytes(content)
        return _read(path, name, signal)


def _content(body: Mapping[str, Any]) -> tuple[str, bytes]:
    name = body.get("name")
    if not isinstance(name, str):
        raise UsageError("a file needs a name")
    name = "".join(x for x in name.replace("\\", "/").rpartition("/")[2] if x.isprintable()).strip(". ")
    name = name[-_LONGEST_NAME:] or "data.csv"
    encoded = body.get("base64")
    given = body.get("text") if encoded is None else encoded
    if not isinstance(given, str):
        raise UsageError(f"{name}: a file needs its text, or its bytes in base64")
    try:
        content = given.encode() if encoded is None else b64decode(given, validate=True)
    except ValueError:
        form = "Unicode text" if encoded is None else "base64"
        raise UsageError(f"{name}: is not {form}") from None
    if len(content) > LARGEST_FILE:
        raise DataError(f"{name}: has more than {LARGEST_FILE // 1_000_000} MB: fit it with pellicle fit")
    return name, content


def _inside(folder: Path | None, name: Any) -> Path:
    """The path of a file in the folder. Raises UsageError for one outside, whether it exists or not."""
    path = None if folder is None or not isinstance(name, str) or "\0" in name else (folder / name).resolve()
    if path is None or folder is None or not path.is_relative_to(folder):
        raise UsageError(f"{name}: only files in the folder of the recipe can be read")
    if not path.is_file():
        raise DataError(f"{name}: no such file in the folder of the recipe")
    if path.stat().st_size > LARGEST_FILE:
        raise DataError(f"{name}: has more than {LARGEST_FILE // 1_000_000} MB: fit it with pellicle fit")
    return path


def _read(path: Path, name: str, signal: str) -> list[Spectrum]:
    """Read a file whose errors and spectra bear its name without the folder."""
    try:
        try:
            spectra = read_spectra(path)
        except UsageError as error:
            try:
                spectra = read_spectra(path, signal=signal)
            except UsageError:
                raise error from None
            note = f"the file does not say what it is: taken as {signal}, the signal of the scene"
            spectra = [replace(each, notes=(*each.notes, note)) for each in spectra]
    except (UsageError, DataError) as error:
        kind = type(error)
        raise kind(str(error).replace(str(path), name)) from None
    notes = [tuple(note.replace(str(path), name) for note in each.notes) for each in spectra]
    return [replace(each, path=name, notes=own) for each, own in zip(spectra, notes, strict=True)]
