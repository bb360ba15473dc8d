"""Files that a page sends, and those in the folder of the recipe: data, and n and k of materials."""

import os
import tempfile
from base64 import b64decode
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

import jax

from pellicle.data.brdf_samples import BrdfSamples
from pellicle.data.read_spectrum import read_spectra
from pellicle.data.spectrum import Spectrum
from pellicle.dispersion.base import AbstractDispersion
from pellicle.errors import DataError, UsageError
from pellicle.materials import Material, materials_in
from pellicle.materials.formats.detect import file_of, names_file
from pellicle.recipes.media import medium
from pellicle.recipes.write import recipe_text
from pellicle.scene.film import Scene
from pellicle.scene.surface import Surface

LARGEST_FILE = 20_000_000
"""Bytes of the largest data file."""
_LONGEST_NAME = 120


Data = TypeVar("Data", Spectrum, BrdfSamples)


def measured(
    source: Mapping[str, Any] | Path, folder: Path | None, read: Callable[[Path], list[Data]]
) -> list[Data]:
    """Data of a request, read from a path by a function: `name` with `text` or `base64`, or `file`, one in
    the folder. A path is that of a recipe. Data and errors bear the file's name without its folder.

    **Raises:** DataError or UsageError in one sentence.
    """
    if isinstance(source, Path):
        return _named(source, os.path.relpath(source, folder or Path.cwd()), read)
    if "file" in source:
        path = inside(folder, source["file"])
        return _named(path, path.name, read)
    name, content = _content(source)
    with tempfile.TemporaryDirectory(prefix="pellicle-") as place:
        path = Path(place) / name
        path.write_bytes(content)
        return _named(path, name, read)


def _content(body: Mapping[str, Any]) -> tuple[str, bytes]:
    """Name and bytes of a file that was sent. Raises DataError or UsageError."""
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
    _check_size(name, len(content))
    return name, content


def _check_size(name: str, size: int) -> None:
    if size > LARGEST_FILE:
        raise DataError(f"{name}: has more than {LARGEST_FILE // 1_000_000} MB: fit it with pellicle fit")


def inside(folder: Path | None, name: Any) -> Path:
    """The path of a file in the folder. Raises UsageError for one outside, whether it exists or not."""
    path = None if folder is None or not isinstance(name, str) or "\0" in name else (folder / name).resolve()
    if path is None or folder is None or not path.is_relative_to(folder):
        raise UsageError(f"{name}: only files in the folder of the recipe can be read")
    if not path.is_file():
        raise DataError(f"{name}: no such file in the folder of the recipe")
    _check_size(name, path.stat().st_size)
    return path


def spectra_of(path: Path, signal: str, options: Mapping[str, Any]) -> list[Spectrum]:
    """Read spectra; a file that does not state its signal has that of the scene. Raises as `measured`."""
    try:
        return read_spectra(path, **options)
    except UsageError as error:
        try:
            spectra = read_spectra(path, **{"signal": signal, **options})
        except UsageError:
            raise error from None
        note = f"the file does not say what it is: taken as {signal}, the signal of the scene"
        return [replace(each, notes=(*each.notes, note)) for each in spectra]


def _named(path: Path, name: str, read: Callable[[Path], list[Data]]) -> list[Data]:
    try:
        data = read(path)
    except (UsageError, DataError) as error:
        raise type(error)(str(error).replace(str(path), name)) from None
    notes = [tuple(note.replace(str(path), name) for note in each.notes) for each in data]
    return [replace(each, path=name, notes=own) for each, own in zip(data, notes, strict=True)]


class MaterialFiles:
    """Files of n and k that were sent to a session: their bytes, by name, while it runs."""

    def __init__(self, folder: Path | None) -> None:
        self.folder, self._contents = folder, {}

    def take(self, body: Mapping[str, Any]) -> str:
        """Keep a file under its name, which then is a medium. Raises DataError for one without n and k."""
        name, content = _content(body)
        if not names_file(name):
            name += ".csv"  # a word with this ending is a file
        before, self._contents = self._contents, self._contents | {name: content}
        try:
            self.medium(name)
        except ValueError:
            self._contents = before
            raise
        return name

    def medium(self, word: str) -> AbstractDispersion:
        """The medium of a word; files are those that were sent or are in the folder. Raises ValueError."""
        name = word.strip()
        if name in self._contents:
            with self._written() as place:
                path = str(place / name)
                try:
                    return replace(medium(path), page=name)  # pyright: ignore[reportCallIssue]
                except (UsageError, DataError) as error:
                    raise type(error)(str(error).replace(path, name)) from None
        if names_file(name) or Path(name).exists():
            inside(self.folder, file_of(name))
            return medium(name, folder=self.folder)
        return medium(name, name="an index")

    def used(self, scene: Scene | Surface) -> list[str]:
        """Names of the files that were sent and that are media of a scene."""
        return [material.page for material in materials_in(scene) if material.page in self._contents]

    def recipe(self, scene: Scene | Surface, folder: Path, **about: Any) -> str:
        """The recipe of a scene, with the names of the files that were sent. Raises as `recipe_text`."""
        with self._written() as place:

            def located(node: Any) -> Any:
                sent = isinstance(node, Material) and node.page in self._contents
                return replace(node, page=str(place / node.page)) if sent else node

            tree = jax.tree_util.tree_map(located, scene, is_leaf=lambda node: isinstance(node, Material))
            text = recipe_text(tree, folder, **about)
            return text.replace(f"{Path(os.path.relpath(place, folder)).as_posix()}/", "")

    @contextmanager
    def _written(self) -> Iterator[Path]:
        """A folder that has the files for a moment."""
        with tempfile.TemporaryDirectory(prefix="pellicle-") as place:
            for name, content in self._contents.items():
                (Path(place) / name).write_bytes(content)
            yield Path(place)
