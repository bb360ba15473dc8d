"""A dispersion with its name, its source and the wavelengths where that source says anything."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from pellicle.dispersion.base import AbstractDispersion, known_index
from pellicle.errors import DataError
from pellicle.materials.contents import covering
from pellicle.optics.pair import Pair, imag, is_real, namespace, real

CLEAR = 1e-5
"""Largest k of an ambient that is taken as transparent. In the coefficients of the sample's faces k changes
R, T and N, C, S by about k itself; what the path through the ambient absorbs is the same with a reference
in the sample's place, or in both polarisations, so calibration or the ratio has removed it."""


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
        value = self.dispersion.index(wavelength)
        if self.clear:
            value = xp.where(imag(value) <= CLEAR, real(value), np.nan)
        low, high = self.wavelength_range
        if low <= 0 and high == np.inf:
            return value
        inside = (wavelength >= low) & (wavelength <= high)
        if is_real(value):
            return xp.where(inside, value, np.nan)
        return Pair(xp.where(inside, real(value), np.nan), xp.where(inside, imag(value), np.nan))

    def check_range(self, wavelengths: Any) -> None:
        """Raise DataError (a ValueError) if any of the concrete `wavelengths` (nm) is outside the range."""
        nm = np.atleast_1d(np.asarray(wavelengths, dtype=float))
        low, high = self.wavelength_range
        outside = nm[~((nm >= low) & (nm <= high))]
        if not outside.size:
            self._check_clear(nm)
            return
        first, last = float(outside.min()), float(outside.max())
        which = f"{first:g} nm" if not last > first else f"{first:g} to {last:g} nm"
        source = "" if self.page == self.name else f" ({self.page})"
        remedies = []
        if nm.min() < high and nm.max() > low:
            remedies.append(f"cut the data with `range=({max(low, nm.min()):g}, {min(high, nm.max()):g})`")
        others = covering(self.page, float(nm.min()), float(nm.max()))
        remedies.append(
            f"use a page that covers them all ({', '.join(others)})"
            if others
            else "use a file of n and k that covers them all, or a model such as cauchy"
        )
        raise DataError(
            f"{self.name}{source} is known from {low:g} to {high:g} nm, not at {which}: "
            f"{' or '.join(remedies)}"
        )

    def _check_clear(self, nm: np.ndarray) -> None:
        k = self._extinction(nm) if self.clear else np.zeros(1)
        if k.max() > CLEAR:
            raise DataError(
                f"the ambient must not absorb: {self.name} has k = {k.max():.2g} at {nm[k.argmax()]:g} nm, "
                f"and up to {CLEAR:g} is left out: cut the data with `range`, or give it a real index"
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
