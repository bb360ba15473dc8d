"""Reflectance of a film at many pixels in NumPy, independent of pellicle's forward model: Airy's formula."""

from __future__ import annotations

import numpy as np

import pellicle as pl


def index(name: str, wavelength: np.ndarray) -> np.ndarray:
    """Index of a material of pellicle's catalogue: the same data, not the same program."""
    return np.asarray(pl.refractive_index(wavelength, name), dtype=complex)


def reflectance(
    wavelength: np.ndarray, film: np.ndarray, thickness: np.ndarray, substrate: np.ndarray
) -> np.ndarray:
    """R at normal incidence of a film in air, (*pixels, bands), of thicknesses (*pixels) in nm.

    `film` is (bands,) or (*pixels, bands), `substrate` (bands,).
    """
    upper, lower = (1 - film) / (1 + film), (film - substrate) / (film + substrate)
    turn = np.exp(4j * np.pi * film * thickness[..., None] / wavelength)
    r = (upper + lower * turn) / (1 + upper * lower * turn)
    return r.real**2 + r.imag**2


def slopes(
    wavelength: np.ndarray, film: np.ndarray, thickness: np.ndarray, substrate: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """R and its derivative by thickness, as `reflectance`."""
    upper, lower = (1 - film) / (1 + film), (film - substrate) / (film + substrate)
    wave = 4j * np.pi * film / wavelength
    turn = np.exp(wave * thickness[..., None])
    below = 1 + upper * lower * turn
    r = (upper + lower * turn) / below
    change = lower * turn * wave * (1 - upper**2) / below**2
    return r.real**2 + r.imag**2, 2 * np.real(np.conj(r) * change)
