"""A dispersion with its name, its source and the wavelengths where that source says anything."""

from __future__ import annotations

from typing import Any, final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from pellicle.errors import DataError
from pellicle.materials.index import covering
from pellicle.optics.dispersion import AbstractDispersion
from pellicle.optics.number import Pair, imag, is_real, real


@final
class Material(AbstractDispersion):
    """What a named source says about n + ik.

    `name` is what was asked for, `page` the source (shelf/book/page, or a file), `citation` its
    reference in plain text, `wavelength_range` (nm) where both n and k are known, `has_extinction`
    whether the source says anything about k (a k that is zero throughout counts), `note` why this
    page or what the sample was, `caution` a sentence that must accompany every use.
    """

    dispersion: AbstractDispersion
    name: str = eqx.field(static=True)
    page: str = eqx.field(static=True)
    citation: str = eqx.field(static=True)
    wavelength_range: tuple[float, float] = eqx.field(static=True)
    has_extinction: bool = eqx.field(static=True)
    note: str = eqx.field(static=True, default="")
    caution: str = eqx.field(static=True, default="")

    def index(self, wavelength):
        """Index at `wavelength` (nm): real where the source has no absorption; NaN outside the range."""
        # a Python number or whole ones would let a table fall back to float32
        wavelength = jnp.asarray(wavelength, dtype=jnp.result_type(float, wavelength))
        value = self.dispersion.index(wavelength)
        low, high = self.wavelength_range
        if low <= 0 and high == np.inf:
            return value
        inside = (wavelength >= low) & (wavelength <= high)
        if is_real(value):
            return jnp.where(inside, value, jnp.nan)
        return Pair(jnp.where(inside, real(value), jnp.nan), jnp.where(inside, imag(value), jnp.nan))

    def check_range(self, wavelengths: Any) -> None:
        """Raise DataError (a ValueError) if any of the concrete `wavelengths` (nm) is outside the range."""
        at = np.atleast_1d(np.asarray(wavelengths, dtype=float))
        low, high = self.wavelength_range
        outside = at[~((at >= low) & (at <= high))]
        if not outside.size:
            return
        first, last = float(outside.min()), float(outside.max())
        which = f"{first:g} nm" if not last > first else f"{first:g} to {last:g} nm"
        source = "" if self.page == self.name else f" ({self.page})"
        remedies = []
        if at.min() < high and at.max() > low:
            remedies.append(f"cut the data with --range {max(low, at.min()):g}:{min(high, at.max()):g}")
        others = covering(self.page, float(at.min()), float(at.max()))
        remedies.append(
            f"use a page that covers them all ({', '.join(others)})" if others else "use another page"
        )
        raise DataError(
            f"{self.name}{source} is known from {low:g} to {high:g} nm, not at {which}: "
            f"{' or '.join(remedies)}"
        )

    def warnings(self) -> list[str]:
        """Sentences that a result made with this material must carry."""
        sentences = [self.caution] if self.caution else []
        if not self.has_extinction:
            sentences.append(
                f"{self.name} ({self.page}) has no data for k: it is taken as transparent, "
                "which its source does not say."
            )
        return sentences


def materials_in(tree: Any) -> list[Material]:
    """Every Material inside a pytree (a scene, a layer, a mixture), each once."""
    leaves = jax.tree.leaves(tree, is_leaf=lambda node: isinstance(node, Material))
    found: dict[tuple[str, str], Material] = {}
    for leaf in leaves:
        if isinstance(leaf, Material):
            found.setdefault((leaf.name, leaf.page), leaf)
    return list(found.values())
