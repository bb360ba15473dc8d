"""Simulated measurements of films by the tmm package (S. J. Byrnes, arXiv:1603.02720), with everyday flaws.

The indices are those of catalogue pages, where there is one of another page than the default that pellicle
tries, times a factor of their own.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any

import numpy as np
import tmm

import pellicle as pl

PAGES = {
    "SiO2": "SiO2",
    "MgF2": "main/MgF2/Rodriguez-de_Marcos",
    "PMMA": "PMMA",
    "polystyrene": "polystyrene",
    "alumina": "main/Al2O3/Zhukovsky",
    "Y2O3": "Y2O3",
    "HfO2": "main/HfO2/Al-Kuhaili",
    "Si3N4": "main/Si3N4/Vogt-2.09",
    "ZnO": "main/ZnO/Stelling",
    "Ta2O5": "Ta2O5",
    "Nb2O5": "Nb2O5",
    "TiO2": "sopra/TiO2/TIO2",
    "ZnS": "ZnS",
    "ITO": "sopra/In2O3-SnO2/ITO2",
    "Cu2O": "Cu2O",
    "Si": "main/Si/Schinke",
    "native": "SiO2",
    "BK7": "BK7",
}
"""Pages of the true materials, by name."""
ABSORBING = ("ITO", "Cu2O")
NATIVE = 2.0
"""Oxide (nm) on every silicon wafer."""
PLATE_NM = 1e6
_NODES = ((-np.sqrt(3.0), 1 / 6), (0.0, 2 / 3), (np.sqrt(3.0), 1 / 6))
"""Nodes and weights of a normal distribution."""


@dataclass(frozen=True)
class Layer:
    """A film of a material, its thickness in nm, and a factor on its index."""

    material: str
    thickness: float
    factor: float = 1.0

    def index(self, nm: np.ndarray) -> np.ndarray:
        """n + ik (wavelengths,)."""
        return tabulated(self.material, tuple(nm)) * self.factor


@dataclass(frozen=True)
class Flaws:
    """Errors of an instrument and a sample: `scale`, `slope` and `offset` of R and T; `angle` (degrees);
    `bandwidth` and `spread` of the thickness as standard deviations (nm); `rough` and `carbon`, thicknesses
    (nm) of a half-and-half layer and of a contamination; `psi` and `delta`, offsets (degrees)."""

    scale: float = 0.0
    slope: float = 0.0
    offset: float = 0.0
    angle: float = 0.0
    bandwidth: float = 0.0
    spread: float = 0.0
    rough: float = 0.0
    carbon: float = 0.0
    psi: float = 0.0
    delta: float = 0.0


@dataclass(frozen=True)
class Specimen:
    """A sample: its layers from the air down, the substrate, and the medium behind a plate ("" for none)."""

    layers: tuple[Layer, ...]
    substrate: str
    back: str = ""
    flaws: Flaws = field(default_factory=Flaws)

    def twice(self) -> Specimen:
        """The sample with the thickest layer twice as thick."""
        thickest = max(self.layers, key=lambda layer: layer.thickness)
        return replace(
            self,
            layers=tuple(
                replace(layer, thickness=2 * layer.thickness) if layer is thickest else layer
                for layer in self.layers
            ),
        )


@dataclass(frozen=True)
class View:
    """Signal, angle (degrees), wavelengths (nm), the standard deviation of a point, and the polarisation."""

    signal: str
    angle: float
    noise: float
    start: float = 450.0
    stop: float = 950.0
    points: int = 101
    polarisation: str = "unpolarised"

    @property
    def nm(self) -> np.ndarray:
        return np.linspace(self.start, self.stop, self.points)


@lru_cache(maxsize=512)
def tabulated(material: str, nm: tuple[float, ...]) -> np.ndarray:
    """n + ik of a material's page (wavelengths,): the same data, not the same program."""
    page: Any = pl.material(PAGES.get(material, material))
    grid = np.clip(nm, *page.wavelength_range)
    value: Any = page.index(grid)
    return np.asarray(value.re + 1j * value.im if hasattr(value, "re") else value, complex) + 0j


def drawn_flaws(random: np.random.Generator, signal: str, thickness: float) -> Flaws:
    """Flaws of an ordinary instrument and sample."""
    common = {
        "bandwidth": float(random.uniform(0.3, 1.0)),
        "spread": float(min(random.uniform(0, 0.01) * thickness, 8.0)),
        "rough": float(random.uniform(0, 3.0)) if thickness > 20 else 0.0,
        "carbon": float(random.uniform(0, 1.0)),
    }
    if signal == "psi-delta":
        angles = {"angle": random.normal(0, 0.05), "psi": random.normal(0, 0.05)}
        return Flaws(**common, **angles, delta=random.normal(0, 0.15))
    levels = {"scale": random.normal(0, 0.01), "slope": random.normal(0, 0.007)}
    return Flaws(**common, **levels, offset=random.normal(0, 0.003))


def _stack(specimen: Specimen, nm: np.ndarray, thicker: float) -> tuple[list[np.ndarray], list[float]]:
    """Indices and thicknesses from the air to the substrate; `thicker` nm are added to the thickest layer."""
    flaws, air = specimen.flaws, np.ones(len(nm), complex)
    substrate = tabulated(specimen.substrate, tuple(nm))
    indices, depths = [layer.index(nm) for layer in specimen.layers], [x.thickness for x in specimen.layers]
    if depths:
        depths[int(np.argmax(depths))] += thicker
    if specimen.substrate == "Si" and (not indices or specimen.layers[-1].material != "SiO2"):
        indices, depths = [*indices, tabulated("native", tuple(nm))], [*depths, NATIVE]
    if flaws.rough and specimen.layers:
        e = (indices[0] ** 2, air**2)
        half = (e[0] + e[1]) / 4
        mixed = np.sqrt(half / 2 + np.sqrt(half**2 / 4 + e[0] * e[1] / 2))  # Bruggeman, half and half
        indices, depths = [mixed, *indices], [flaws.rough, *depths]
        depths[1] = max(depths[1] - flaws.rough / 2, 0.0)
    if flaws.carbon:
        indices, depths = [1.5 * air, *indices], [flaws.carbon, *depths]
    return [air, *indices, substrate], depths


def _light(specimen: Specimen, view: View, nm: np.ndarray, thicker: float) -> np.ndarray:
    """R or T (points, 1), or N, C, S (points, 3), of one thickness and of exact wavelengths."""
    indices, depths = _stack(specimen, nm, thicker)
    angle = np.deg2rad(view.angle + specimen.flaws.angle)
    letters = {"unpolarised": "sp"}.get(view.polarisation, view.polarisation)
    rows = []
    for i, wavelength in enumerate(nm):
        n, d = [x[i] for x in indices], [np.inf, *depths, np.inf]
        if view.signal == "psi-delta":
            s, p = (tmm.coh_tmm(x, n, d, angle, wavelength)["r"] for x in "sp")
            cross, power = 2 * np.conj(p) * s, abs(s) ** 2 + abs(p) ** 2
            rows.append([(abs(s) ** 2 - abs(p) ** 2) / power, cross.real / power, cross.imag / power])
        elif specimen.back:
            thick, kinds = [*d[:-1], PLATE_NM, np.inf], ["i", *("c" for _ in depths), "i", "i"]
            each = [tmm.inc_tmm(x, [*n, 1.0], thick, kinds, angle, wavelength)[view.signal] for x in letters]
            rows.append([np.mean(each)])
        else:
            each = [tmm.coh_tmm(x, n, d, angle, wavelength)[view.signal] for x in letters]
            rows.append([np.mean(each)])
    return np.array(rows, float)


def clean(specimen: Specimen, view: View) -> np.ndarray:
    """The recorded signal without noise: R or T (points,), Ψ and Δ (points, 2) in degrees."""
    flaws, nm = specimen.flaws, view.nm
    bands = _NODES if flaws.bandwidth else ((0.0, 1.0),)
    depths = _NODES if flaws.spread else ((0.0, 1.0),)
    signal = sum(
        a * b * _light(specimen, view, nm + x * flaws.bandwidth, y * flaws.spread)
        for x, a in bands
        for y, b in depths
    )
    assert isinstance(signal, np.ndarray)
    if view.signal == "psi-delta":
        n, c, s = signal.T
        psi, delta = np.rad2deg(np.arctan2(np.hypot(c, s), n)) / 2, np.rad2deg(np.arctan2(s, c))
        return np.stack([psi + flaws.psi, np.mod(delta + flaws.delta, 360)], axis=1)
    position = np.linspace(-1, 1, len(nm))
    return (1 + flaws.scale + flaws.slope * position) * signal[:, 0] + flaws.offset


def measured(specimen: Specimen, view: View, random: np.random.Generator, path: str = "") -> pl.Spectrum:
    """A spectrum with noise, without σ, as most files have none."""
    signal = clean(specimen, view)
    noisy = signal + view.noise * random.standard_normal(signal.shape)
    angle = np.full(view.points, view.angle)
    if view.signal == "psi-delta":
        psi, delta = np.clip(noisy[:, 0], 0, 90), np.mod(noisy[:, 1], 360)
        return pl.Spectrum(view.nm, psi, "psi-delta", delta=delta, angle=angle, path=path)
    return pl.Spectrum(view.nm, noisy, view.signal, angle=angle, path=path, polarisation=view.polarisation)
