"""Pages that ship with the package, those of refractiveindex.info (YAML) and plain tables, in nm.

A database page holds formulas and tables against wavelength in µm; tables are interpolated linearly, as the
database does.
"""

from __future__ import annotations

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


class Quantity(NamedTuple):
    """A dispersion with the range (nm) of its source."""

    dispersion: AbstractDispersion
    low: float
    high: float


class Contents(NamedTuple):
    """Contents of a page: a dispersion, its range (nm), and whether it has k."""

    dispersion: AbstractDispersion
    wavelength_range: tuple[float, float]
    has_extinction: bool


def to_nm(micrometres: Any) -> Any:
    """µm to nm without the last-digit noise of the product (0.2652 µm is 265.2 nm)."""
    return np.round(np.asarray(micrometres, dtype=float) * 1e3, 9)


def table(nm: Any, n: Any, k: Any = None) -> Quantity:
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
    at, where, count = np.unique(nm, return_inverse=True, return_counts=True)
    columns = [np.bincount(where, column) / count for column in columns]
    if len(columns) == 2 and not columns[1].any():
        columns.pop()
    for array in (at, *columns):
        array.flags.writeable = False
    return Quantity(Table(at, *columns), float(at[0]), float(at[-1]))


def extinction(nm: Any, k: Any) -> Quantity:
    """A table of k alone, beside an n that is never used."""
    return table(nm, np.zeros(len(nm)), k)


def combine(n: Quantity, k: Quantity | None) -> Contents:
    """n from one source and k from another, where both are known."""
    if k is None:
        return Contents(n.dispersion, (n.low, n.high), False)
    low, high = max(n.low, k.low), min(n.high, k.high)
    if low >= high:
        raise DataError(
            f"n is known from {n.low:g} to {n.high:g} nm and k from {k.low:g} to {k.high:g} nm, "
            "which do not overlap: choose another page"
        )
    absorbs = isinstance(k.dispersion, Table) and k.dispersion.k is not None
    both = WithExtinction(n.dispersion, k.dispersion) if absorbs else n.dispersion
    return Contents(both, (low, high), True)


def formula(number: int, coefficients: Any, micrometres: tuple[float, float]) -> Quantity:
    """A formula of the database and its range in µm."""
    low, high = to_nm(micrometres)
    return Quantity(Formula(number, tuple(float(c) for c in coefficients)), float(low), float(high))


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
            n = table(*_numbers(block))
            return Contents(n.dispersion, (n.low, n.high), True)
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
    found = table(*np.array([line.split(",") for line in lines[1:]], dtype=float).T)
    return Contents(found.dispersion, (found.low, found.high), True)


_LINK = re.compile(r'<a\s+href\s*=\s*[\\"]*([^">]*)"?\s*>(.*?)</a>', re.DOTALL | re.IGNORECASE)


# only true tags: "<111>" is a crystal's orientation
_TAG = re.compile(r"</?(?:a|b|i|u|em|strong|sub|sup|br|p|span|div|li|ul|ol)\b[^<>]*>", re.IGNORECASE)


_INITIALS = re.compile(r"^(?:\S{1,3}\.[\s-]*)+")


_END_OF_NAMES = re.compile(r"(?<=\w{3})\.(?:\s|$)")


def _link(match: re.Match[str]) -> str:
    address, text = match.group(1).strip(), match.group(2)
    return f"{text} {address}" if "doi.org/" in address else text


def plain_text(markup: str | None) -> str:
    """Text without tags on one line; of the links, DOIs stay as addresses."""
    text = _TAG.sub("", re.sub(r"<br\s*/?>", " ", _LINK.sub(_link, markup or "")))
    text = re.sub(r"\[\s*(?:Calculation script[^\]]*|data|description)\s*\]", "", html.unescape(text))
    return re.sub(r"\s+", " ", text).strip().strip('\\"').strip()


def short_citation(markup: str | None) -> str:
    """First author and year ("Johnson et al. 1972"), parsed from the text of the reference."""
    lines = [text for text in map(plain_text, (markup or "").splitlines()) if text]
    if not lines:
        return ""
    names = _END_OF_NAMES.split(re.sub(r"^\d\)\s*|\s*\(.*|\.$", "", lines[0]))[0]
    authors = [name for name in re.split(r"\s*,\s*|\s+and\s+", names) if re.search(r"[^\W\d_]{2}", name)]
    surname = _INITIALS.sub("", authors[0]) if authors else names[:30]
    shared = " et al." if len(authors) > 1 else ""
    text = " ".join(lines)
    year = re.search(r"\((1[89]\d\d|20\d\d)\)", text) or re.search(r"\b(1[89]\d\d|20\d\d)\b", text)
    return f"{surname}{shared}{' ' + year.group(1) if year and year.group(1) not in surname else ''}"
