"""Contents of the catalogue: vendored pages and short names, without opening a page.

`data/pages.csv` is written by scripts/index_materials.py; `data/catalogue.toml` by hand.
"""

import csv
import functools
import re
import tomllib
from dataclasses import dataclass
from importlib.resources import files
from typing import Any

DATA = files("pellicle.materials") / "data"


@dataclass(frozen=True)
class Page:
    """One source: where it is, its range (nm), and what it says of itself."""

    shelf: str
    book: str
    page: str
    file: str
    low: float
    high: float
    has_extinction: bool
    short: str
    citation: str
    comments: str

    @property
    def path(self) -> str:
        return f"{self.shelf}/{self.book}/{self.page}"


@dataclass(frozen=True)
class Name:
    """A short name, the page it stands for (None for vacuum), why that page, and families of the material."""

    name: str
    page: Page | None
    reason: str
    aliases: tuple[str, ...] = ()
    caution: str = ""
    families: tuple[str, ...] = ()


def key(name: str) -> str:
    """Names differ neither by case nor by how their words are joined."""
    return re.sub(r"[\s_-]+", "-", name.strip()).lower()


@functools.cache
def pages() -> tuple[Page, ...]:
    """Every page that ships with the package, by shelf, book and page."""
    rows = csv.DictReader((DATA / "pages.csv").read_text(encoding="utf-8").splitlines())
    read: dict[str, Any] = {"low": float, "high": float, "has_extinction": lambda text: text == "yes"}
    return tuple(Page(**{key: read.get(key, str)(text) for key, text in row.items()}) for row in rows)


@functools.cache
def names() -> tuple[Name, ...]:
    """Every short name with its default page and the reason for it."""
    catalogue = tomllib.loads((DATA / "catalogue.toml").read_text(encoding="utf-8"))
    by_path = {page.path: page for page in pages()}
    return tuple(
        Name(
            name,
            by_path[entry["page"]] if "page" in entry else None,
            entry["reason"],
            tuple(entry.get("aliases", ())),
            entry.get("caution", ""),
            tuple(entry["families"]),
        )
        for name, entry in catalogue.items()
    )


@functools.cache
def _by_key() -> dict[str, Name]:
    return {key(word): entry for entry in names() for word in (entry.name, *entry.aliases)}


def find_name(name: str) -> Name | None:
    """The short name or alias that `name` is, whatever its case."""
    return _by_key().get(key(name))


def find_pages(path: str) -> list[Page]:
    """The vendored pages that shelf/book/page or book/page means; a book may be called by any short name."""
    parts = [key(part) for part in path.split("/")]
    if len(parts) not in (2, 3):
        return []
    entry = find_name(path.split("/")[-2])
    books = {parts[-2], key(entry.page.book) if entry and entry.page else parts[-2]}
    return [
        page
        for page in pages()
        if key(page.page) == parts[-1]
        and key(page.book) in books
        and (len(parts) == 2 or key(page.shelf) == parts[0])
    ]


def pages_of_book(book: str) -> list[Page]:
    """The vendored pages of a book, on any shelf."""
    return [page for page in pages() if page.book == book]


def covering(path: str, low: float, high: float) -> list[str]:
    """The pages of the same form of the same material that cover `low` to `high` nm, as book/page."""
    return [
        f"{page.book}/{page.page}"
        for page in pages()
        if page.low <= low and page.high >= high and _form(page.path) == _form(path)
    ]


def _form(path: str) -> tuple[str, str, bool]:
    """Book and form of the material that a page describes, and True for the extraordinary ray.

    A form has a name of its own beside that of the book, as amorphous silicon in the book of silicon.
    """
    book, page = path.split("/")[-2:] if path.count("/") == 2 else ("", path)
    form = next((entry.name for entry in names() if entry.page and entry.page.path == path), book)
    return book, form, page.endswith("-e")


def known_words() -> list[str]:
    """Everything that can be asked for by name, for suggestions."""
    words = [word for entry in names() for word in (entry.name, *entry.aliases)]
    return words + [f"{page.book}/{page.page}" for page in pages()] + [page.path for page in pages()]
