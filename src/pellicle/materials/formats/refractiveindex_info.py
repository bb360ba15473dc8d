"""Downloads of refractiveindex.info: the page as YAML, and its table as CSV or text, in µm.

The CSV holds a block `wl,n` and, where the page has k, a second block `wl,k` below it, at other wavelengths
if n and k come from different sources.
"""

import re
from typing import Any

import numpy as np

from pellicle.errors import DataError
from pellicle.materials.formats.optical_constants import (
    MaterialFile,
    MaterialText,
    constants_of,
    material_file,
    read_rows,
)
from pellicle.materials.page import combine, contents, extinction, plain_text, table, to_nm

_CSV = "refractiveindex.info table"
LONGEST_UM = 30.0
"""A `wl` that lies above this throughout is more likely one's own table in nm: such a file states no unit."""


def read_yaml(text: MaterialText) -> MaterialFile | None:
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
        raise DataError(
            f"{text.path}: {line}is not YAML ({error.problem}); download the page again"
        ) from None
    except DataError as error:
        raise DataError(f"{text.path}: {error}") from None
    except (yaml.YAMLError, KeyError, TypeError, ValueError, IndexError, AttributeError, RecursionError):
        raise DataError(
            f"{text.path}: is not a complete page of refractiveindex.info, which has DATA with a table or a "
            "formula, and numbers in it; download the full database record again"
        ) from None
    low, high = source.wavelength_range
    nm = np.linspace(low, high, 64)
    if not (0 < low < high < np.inf) or not np.isfinite(source.dispersion(nm)).all():
        raise DataError(
            f"{text.path}: gives no finite index over its range of {low:g} to {high:g} nm; download it again"
        )
    kinds = ", ".join(str(block["type"]) for block in page["DATA"])
    understood = ("refractiveindex.info page", f"wavelength in um; {kinds}")
    return MaterialFile(*source, *understood, citation=citation, comments=comments)


def read_table(text: MaterialText) -> MaterialFile | None:
    """Read the blocks of a CSV or text download; None for another file.

    Raises DataError for faulty rows, and where the unit is in doubt.
    """
    headers = [(i, kind) for i, line in enumerate(text.lines) if (kind := _header(line.text))]
    if [kind for _, kind in headers] not in (["n"], ["n", "k"]) or headers[0][0] != 0:
        return None
    ends = [*(i for i, _ in headers[1:]), len(text.lines)]
    blocks = [(text.lines[i + 1 : end], kind) for (i, kind), end in zip(headers, ends, strict=True)]
    n, *others = (constants_of(read_rows(text.path, lines, ("wl", kind)), "um") for lines, kind in blocks)
    if n.axis.min() >= LONGEST_UM:
        if not others:
            return None
        raise DataError(
            f"{text.path}: has the layout of refractiveindex.info, which is in µm, but begins at "
            f"{n.axis.min():g}; write the unit into both headers, as wavelength_nm,n,k in one table"
        )
    without_k = material_file(n, _CSV)
    if not others:
        return without_k
    k = others[0]
    both = np.array_equal(n.axis, k.axis)
    index = n.first if both else np.ones_like(k.first)
    with_k = material_file(k._replace(first=index, second=k.first, names=("wl", "n", "k")), _CSV)
    if both:
        return with_k
    try:
        made = combine(table(to_nm(n.axis), n.first), extinction(to_nm(k.axis), np.maximum(k.first, 0.0)))
    except DataError as error:
        raise DataError(f"{text.path}: {error}") from None
    columns = f"wl in um, n; {len(n.axis)} rows, then wl in um, k; {len(k.axis)} rows"
    return MaterialFile(*made, _CSV, columns)


def _header(text: str) -> str | None:
    """Return n or k for a line `wl,n` or `wl,k`, separated in any way."""
    words = re.split(r"[\s,;]+", text.lower().replace('"', "").strip())
    return words[1] if len(words) == 2 and words[0] == "wl" and words[1] in ("n", "k") else None
