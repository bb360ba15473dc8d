"""The catalogue of materials as text, and figures of n and k."""

import os
import textwrap
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from pellicle.materials import Material, contents, material
from pellicle.materials.formats.detect import read_material_file
from pellicle.reporting.json_record import strict, versions
from pellicle.reporting.matplotlib_figure import figure_path, new_figure, save_figure
from pellicle.reporting.plain_text import aligned

HEADINGS = ("name", "page", "range (nm)", "k data", "source")
SHOWN_NM = (190.0, 2500.0)
SODIUM_NM = 589.3
POINTS = 1200


def _range(low: float, high: float) -> str:
    return f"{low:.5g}-{high:.6g}"


def _row(name: str, page: contents.Page | None) -> tuple[str, ...]:
    if page is None:
        return name, "n = 1 exactly", "all", "yes", ""
    return name, page.path, _range(page.low, page.high), "yes" if page.has_extinction else "no", page.short


class Listed(NamedTuple):
    """A line of the catalogue: a short name, or a page that has none; with its families and aliases."""

    name: str
    page: contents.Page | None
    families: tuple[str, ...]
    aliases: tuple[str, ...] = ()
    caution: str = ""


def listed(family: str | None = None) -> list[Listed]:
    """Return short names and other pages of the catalogue by name, or those of a family.

    A page has the families of the first short name of its book.
    """
    entries = [Listed(e.name, e.page, e.families, e.aliases, e.caution) for e in contents.names()]
    of_page, of_book = {e.page for e in entries}, {}
    for entry in reversed(entries):
        of_book[entry.page.book if entry.page else ""] = entry.families
    others = (page for page in contents.pages() if page not in of_page)
    entries += [Listed(f"{page.book}/{page.page}", page, of_book[page.book]) for page in others]
    entries.sort(key=lambda entry: entry.name.lower())
    return [entry for entry in entries if family is None or family in entry.families]


def table(family: str | None = None) -> str:
    """List the catalogue, or a family of it, as aligned text: one line for each name."""
    return "\n".join([*aligned([HEADINGS, *(_row(e.name, e.page) for e in listed(family))]), ""])


def to_json(family: str | None = None) -> dict[str, Any]:
    """List the catalogue, or a family of it, as a JSON object; null for a range without ends."""
    rows = [
        {
            "name": entry.name,
            "families": entry.families,
            "aliases": entry.aliases,
            "page": entry.page.path if entry.page else None,
            "range_nm": [entry.page.low, entry.page.high] if entry.page else None,
            "has_k": entry.page is None or entry.page.has_extinction,
            "citation": entry.page.citation if entry.page else "",
            "caution": entry.caution,
        }
        for entry in listed(family)
    ]
    return strict({"schema": "pellicle.materials/1", "materials": rows, "versions": versions()})


def describe(name: str) -> str:
    """Describe a material: the page of its name, why that one, its reference, other pages of its book.

    Of a file it gives format, columns and unit, as they were understood. Raises what `material` raises.
    """
    source, entry = material(name), contents.find_name(name)
    if not isinstance(source, Material):
        return f"{name}\n"
    low, high = source.wavelength_range
    is_file = entry is None and source.page == name.strip() and Path(source.page).is_file()
    of_file = read_material_file(source.page) if is_file else None
    names = ("format", "columns", "title", "comments")
    # n, and k where it is known, at the sodium line, or in the middle of a range without it
    at = SODIUM_NM if low <= SODIUM_NM <= high else round((low + high) / 2)
    value = complex(source(at))
    k = f", k = {value.imag:.4g}" if source.has_extinction else ""
    index = f"n = {value.real:.5g}{k} at {at:g} nm"
    facts = [
        ("file" if is_file else "page", source.page),
        *((name, getattr(of_file, name)) for name in (names if is_file else ())),
        ("range", "all wavelengths" if high == np.inf else f"{_range(low, high)} nm"),
        ("k data", "yes" if source.has_extinction else "no: taken as transparent"),
        ("index", index),
        ("family", ", ".join(entry.families) if entry else ""),
        ("caution", source.caution),
        ("why" if entry else "sample", "" if is_file else source.note),
        ("reference", source.citation),
        ("aliases", ", ".join(entry.aliases) if entry else ""),
    ]
    text, how = [source.name], {"width": 100, "subsequent_indent": " " * 13, "break_on_hyphens": False}
    for label, value in ((label, value) for label, value in facts if value):
        text.append(textwrap.fill(value, initial_indent=f"  {label:<11}", **how))
    parts = source.page.split("/")
    others = contents.pages_of_book(parts[1]) if len(parts) == 3 and not is_file else []
    if others:
        rows = (_row(f"{p.book}/{p.page}", p)[:1] + _row("", p)[2:] + (p.comments[:60],) for p in others)
        text += ["", f"pages of {parts[1]} in this installation:", *(f"  {line}" for line in aligned(rows))]
    return "\n".join(text) + "\n"


def shown_range(material: Material) -> tuple[float, float]:
    """Wavelengths (nm) of a figure: the material's own, cut to 190-2500 nm if it has any there."""
    low, high = material.wavelength_range
    if low < SHOWN_NM[1] and high > SHOWN_NM[0]:
        return max(low, SHOWN_NM[0]), min(high, SHOWN_NM[1])
    return low, high


def figure(name: str, path: str | os.PathLike[str]) -> Path:
    """Draw n and k of a material against wavelength into `path` (.png, .pdf or .svg), which is returned.

    The file appears complete or not at all; an existing one is not overwritten. Raises what `material`
    raises, and UsageError for another file type or a path that cannot be written.
    """
    target, source = figure_path(path), material(name)
    low, high = shown_range(source) if isinstance(source, Material) else SHOWN_NM
    nm = np.clip(np.linspace(low, high, POINTS), low, high)
    values = np.asarray(source(nm))
    n, k = np.real(values), np.imag(values)
    sheet = new_figure(7, 4)
    axes = sheet.add_subplot()
    lines = axes.plot(nm, n, color="C0", label="n")
    axes.set(xlabel="wavelength (nm)", ylabel="n", xlim=(low, high))
    if k.any():
        beside = axes.twinx()
        lines += beside.plot(nm, k, color="C3", linestyle="--", label="k")
        beside.set(ylabel="k", ylim=(0, None))
    axes.legend(handles=lines, frameon=False)
    if isinstance(source, Material):
        axes.set_title(f"{source.name}   {source.page}", loc="left")
        if source.caution:
            sheet.supxlabel("\n".join(textwrap.wrap(source.caution, 90)), fontsize="small", color="C3")
    return save_figure(sheet, target)
