"""Refractive indices of simulated samples, as functions of wavelength in nm that return n + ik."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np

import pellicle as pl

Index = Callable[[np.ndarray], np.ndarray]
HC = 1239.841984
"""Photon energy times wavelength in eV nm."""
GRID = np.linspace(350.0, 1000.0, 6501)
"""Wavelengths of the tables of catalogued materials: measurements lie on grid points."""


@lru_cache
def catalogued(name: str) -> Index:
    """Measured index of a material in pellicle's catalogue: the same data, not the same program."""
    n = np.asarray(pl.refractive_index(GRID, name), dtype=complex)
    return lambda wavelength: np.interp(wavelength, GRID, n)


def air(wavelength: np.ndarray) -> np.ndarray:
    """Index 1."""
    return np.ones_like(wavelength, dtype=complex)


def cauchy(a: float, b: float) -> Index:
    """A + B/λ², without absorption; B in nm²."""
    return lambda wavelength: a + b / wavelength**2 + 0j


def resonance(wavelength: np.ndarray, strength: float, energy: float, width: float) -> np.ndarray:
    """Permittivity of a bound charge (Born and Wolf, section 2.3.4); `energy` and `width` in eV."""
    photon = HC / wavelength
    return strength * energy**2 / (energy**2 - photon**2 - 1j * width * photon)


def lorentz(eps_inf: float, strength: float, energy: float, width: float) -> Index:
    """Root of a constant permittivity and one resonance."""
    return lambda wavelength: np.sqrt(eps_inf + resonance(wavelength, strength, energy, width))


def with_resonance(index: Index, strength: float, energy: float, width: float) -> Index:
    """An index with one more resonance."""
    return lambda wavelength: np.sqrt(index(wavelength) ** 2 + resonance(wavelength, strength, energy, width))


def scaled(index: Index, factor: float) -> Index:
    """An index times a factor."""
    return lambda wavelength: factor * index(wavelength)


def bruggeman(first: Index, second: Index, share: float) -> Index:
    """Mixture with the volume share `share` of the second medium (D. A. G. Bruggeman, 1935)."""

    def index(wavelength: np.ndarray) -> np.ndarray:
        a, b = first(wavelength) ** 2, second(wavelength) ** 2
        half = ((2 - 3 * share) * a + (3 * share - 1) * b) / 4
        root = np.sqrt(half**2 + a * b / 2)
        return np.sqrt(half + root)  # the root of the permittivity with a positive real part

    return index
