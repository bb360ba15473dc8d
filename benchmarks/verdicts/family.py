"""A kind of sample: how it is drawn, measured, and described to pellicle by a recipe."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from measurement import Conditions, Stack, View, recorded_angles, recorded_power, seen
from media import Index, cauchy

import pellicle as pl

Theta = tuple[float, ...]
Bounds = tuple[tuple[float, float], ...]
COUNTS = 12.0
"""Counts of a mirror, on a scale on which a soap film, which reflects 8 % at most, has 1."""


@dataclass(frozen=True)
class Family:
    """One kind of sample with its instrument.

    `draw` returns the true numbers that its recipe leaves free, the thickness first, and `stack` the sample
    with these numbers; `bounds` are those of the recipe. `traits` are words that decide which flaws it can
    have. `gain` and `dark` are the degrees of a free scale and offset, None where they are fixed; `counts`
    are of unknown scale. `noise` is the range of its standard deviation, of N, C and S for ellipsometry.
    """

    name: str
    recipe: str
    view: View
    noise: tuple[float, float]
    bounds: Bounds
    draw: Callable[[np.random.Generator], Theta]
    stack: Callable[[Theta], Stack]
    traits: frozenset[str] = frozenset()
    bandwidth: int | None = None
    gain: int | None = None
    dark: int | None = None
    counts: bool = False

    def scene(self) -> Any:
        """The scene of the recipe, read as pellicle reads recipes."""
        return _scene(self.recipe)

    def signal(self, theta: Theta) -> np.ndarray:
        """R, T (points,) or Ψ and Δ (2, points) that the scene's own model has at `theta`."""
        return self.recorded(self.stack(theta), self.window(theta), Conditions(), self.view)

    def window(self, theta: Theta) -> float:
        """Bandwidth in nm that the scene describes."""
        return 0.0 if self.bandwidth is None else theta[self.bandwidth]

    def recorded(
        self, stack: Stack, bandwidth: float, conditions: Conditions, view: View, lamp: Any = 1.0
    ) -> np.ndarray:
        """Signal without noise of any stack under `conditions`, in the light of `lamp`."""
        found = seen(stack, conditions, bandwidth, view)
        if view.signal == "psi-delta":
            return recorded_angles(found, conditions)
        return recorded_power(lamp * found, conditions, view)

    def lamp(self, random: np.random.Generator) -> np.ndarray | float:
        """Lamp and detector curve of uncalibrated counts: a positive cubic, as a slow scale can follow."""
        if self.gain is None:
            return 1.0
        slopes = random.uniform(-1, 1, self.gain) * np.array([0.5, 0.3, 0.1])[: self.gain]
        level = random.uniform(0.8, 1.2) * (COUNTS if self.counts else 1.0)
        return level * np.polynomial.chebyshev.chebval(self.view.position, [1, *slopes])


@lru_cache
def _scene(recipe: str) -> Any:
    with TemporaryDirectory() as folder:
        path = Path(folder) / "scene.toml"
        path.write_text(recipe, encoding="utf-8")
        return pl.read_recipe(path).scene()


def recipe(
    signal: str,
    substrate: str,
    material: str,
    thickness: tuple[float, float],
    *,
    instrument: str = "",
) -> str:
    """A recipe of one layer; `substrate` and `material` are TOML values."""
    low, high = thickness
    return (
        f'[data]\nsignal = "{signal}"\n\n[scene]\nsubstrate = {substrate}\n\n[[scene.layer]]\n'
        f"material = {material}\nthickness = {{ lower = {low:g}, upper = {high:g} }}\n"
        + (f"\n[instrument]\n{instrument}\n" if instrument else "")
    )


def spectrum_view(signal: str, start: float, stop: float, points: int) -> View:
    """Evenly spaced wavelengths at normal incidence."""
    return View(signal, np.linspace(start, stop, points), np.zeros(points))


def ellipsometer_view(start: float, stop: float, points: int, *angles: float) -> View:
    """Evenly spaced wavelengths at each of the angles, in the order of a Spectrum."""
    wavelength = np.repeat(np.linspace(start, stop, points), len(angles))
    return View("psi-delta", wavelength, np.tile(np.array(angles), points))


def one_layer(index: Index, substrate: Index, plate_mm: float | None = None) -> Callable[[Theta], Stack]:
    """Stack of a film whose only free number is its thickness."""
    return lambda theta: Stack(((index, theta[0]),), substrate, plate_mm=plate_mm)


def cauchy_layer(substrate: Index, plate_mm: float | None = None) -> Callable[[Theta], Stack]:
    """Stack of a film with free thickness, A and B."""
    return lambda theta: Stack(((cauchy(*theta[1:3]), theta[0]),), substrate, plate_mm=plate_mm)


def log_uniform(random: np.random.Generator, low: float, high: float) -> float:
    """A number whose logarithm is distributed evenly."""
    return float(np.exp(random.uniform(np.log(low), np.log(high))))


def depth(low: float, high: float) -> Callable[[np.random.Generator], Theta]:
    """Draw a thickness, evenly in its logarithm."""
    return lambda random: (log_uniform(random, low, high),)


def depth_and_cauchy(
    low: float, high: float, a: tuple[float, float], b: tuple[float, float]
) -> Callable[[np.random.Generator], Theta]:
    """Draw thickness, A and B."""
    return lambda random: (random.uniform(low, high), random.uniform(*a), random.uniform(*b))
