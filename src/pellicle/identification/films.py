"""Materials that an identification tries, and those of them that cannot be tried on given data."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pellicle.errors import UsageError, did_you_mean
from pellicle.identification.hypothesis import NotTried
from pellicle.identification.signal_view import SignalView
from pellicle.materials import Material
from pellicle.scene.layers import medium

FAMILIES = {
    "oxide": [
        *("SiO2", "alumina", "Y2O3", "SiO", "MgO", "HfO2", "ZrO2", "Ta2O5", "Nb2O5", "TiO2", "ZnO", "Sc2O3"),
        *("TiO2/Devore-o", "TiO2/Devore-e", "ITO", "Fe2O3", "Cu2O", "CuO"),
    ],
    "nitride": ["Si3N4", "AlN", "TiN"],
    "fluoride": ["MgF2"],
    "polymer": ["PMMA", "polystyrene", "SU-8", "PVA"],
    "semiconductor": ["a-Si", "a-Si:H", "Ge", "CdS", "ZnS"],
    "metal": ["Au", "Ag", "Al", "Cu", "Cr", "Ti", "Ni"],
}
"""Films that are tried, by their families."""
_BEYOND = 0.06
"""Share of the wavelength by which a table is continued: the index of polymers, known from 405 nm, changes by
0.002 to 380 nm, less than the uncertainty of a page."""
FILMS = [name for names in FAMILIES.values() for name in names]


def chosen(among: Sequence[str] | None, family: str | None) -> list[str]:
    """Names of the materials to be tried.

    **Raises:** UsageError for `among` without a list of names, for an unknown family, and for both.
    """
    if among is not None and family is not None:
        raise UsageError("give `among` or `family`, not both")
    if isinstance(among, str) or not all(isinstance(x, str) for x in among or ()):
        raise UsageError(
            f"`among` must be a list of names of materials and files of n and k, not {among!r}:"
            " films of a free index are tried beside these"
        )
    if family is not None and family not in FAMILIES:
        near = did_you_mean(family, FAMILIES)
        known = ", ".join(FAMILIES)
        raise UsageError(f"no family {family!r} of films; give one of {known}{near}, or films by `among`")
    return list(among) if among is not None else list(FILMS if family is None else FAMILIES[family])


def _continued(index: np.ndarray, wavelength: np.ndarray) -> np.ndarray:
    """An index that goes on in a straight line behind the ends of its data, for `_BEYOND` of them."""
    nm, first, of = np.unique(wavelength, return_index=True, return_inverse=True)
    known = np.flatnonzero(np.isfinite(index[first]))
    if known.size < 2 or known.size == nm.size:
        return index
    found = index[first]
    for end, inside, rows in (
        (known[0], known[:8][-1], np.arange(known[0])),
        (known[-1], known[-8:][0], np.arange(known[-1] + 1, nm.size)),
    ):
        near = rows[np.abs(nm[rows] / nm[end] - 1) < _BEYOND]
        slope = (found[inside] - found[end]) / (nm[inside] - nm[end])
        line = found[end] + slope * (nm[near] - nm[end])
        found[near] = np.maximum(line.real, 0.01) + 1j * np.maximum(line.imag, 0.0)
    return found[of]


def tabulated(views: Sequence[SignalView], names: Sequence[str]) -> list[NotTried]:
    """Put the index of materials at the wavelengths of each view into its `tables`.

    Returns those that do not cover the data. SiO2, that of a native oxide, is always there.
    """
    left_out = []
    for name in dict.fromkeys([*names, "SiO2"]):
        known = medium(name)
        index = [_continued(view.index_of(known), view.wavelength) for view in views]
        if all(np.all(np.isfinite(x)) for x in index):
            for view, own in zip(views, index, strict=True):
                view.tables[name] = own
        else:
            low, high = known.wavelength_range if isinstance(known, Material) else (np.nan, np.nan)
            left_out.append(NotTried(name, f"known from {low:g} to {high:g} nm only"))
    return left_out
