"""Simulated measurements that every program fits, with the same bounds and the same film formula."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

import pellicle as pl
from whole_fits.numpy_film import plate_transmittance, psi_delta, reflectance

Array = np.ndarray
Limit = tuple[float, float, float, float]
"""Bounds of a parameter, and the narrower range from which true values are drawn."""
Film = Callable[[tuple[Array, ...]], Any]
"""Parameters, each (candidates, 1) → R or T (candidates, points), or Ψ and Δ in degrees."""


@dataclass(frozen=True)
class Case:
    """A kind of measurement: the scene that pellicle fits, and its NumPy simulation for the others.

    `limits` are in the order of the film's parameters, by pellicle's names of them.
    `film(wavelength, angle)` tabulates the indices of these points and returns their simulation. The scan of
    the other programs takes thicknesses `step` nm apart, an eighth of the shortest wavelength in the layer,
    and `levels` values of each of the other parameters. `noise` is the standard deviation of R, T or Ψ
    (degrees); that of Δ is larger by 2/sin 2Ψ.
    """

    name: str
    target: float  # seconds
    scene: pl.Scene
    limits: dict[str, Limit]
    film: Callable[[Array, Array], Film]
    wavelength: Array
    angles: tuple[float, ...] = (0.0,)
    noise: float = 0.002
    levels: tuple[int, ...] = ()
    step: float = 30.0
    drifting: bool = False
    files: int = 20

    @property
    def points(self) -> tuple[Array, Array]:
        """Wavelength and angle of every point."""
        return np.repeat(self.wavelength, len(self.angles)), np.tile(self.angles, len(self.wavelength))

    @property
    def thickness_axis(self) -> int:
        return next(i for i, name in enumerate(self.limits) if name.endswith("thickness"))

    @property
    def bounds(self) -> Array:
        """Bounds of the free parameters, (parameters, 2)."""
        return np.array([limits[:2] for limits in self.limits.values()])


@dataclass(frozen=True)
class Measurement:
    """One simulated file: true values, R, T or Ψ, and Δ."""

    truth: Array
    values: Array
    delta: Array | None
    spectrum: pl.Spectrum


def measurement(case: Case, seed: int) -> Measurement:
    """A file with true values and noise from `seed`. The noise is not given to pellicle."""
    random = np.random.default_rng([seed, *case.name.encode()])
    limits = np.array(list(case.limits.values()))
    truth = random.uniform(limits[:, 2], limits[:, 3])
    nm, angle = case.points
    clean = case.film(nm, angle)(tuple(truth.reshape(-1, 1, 1)))
    noise = case.noise * random.standard_normal((2, nm.size))
    if case.scene.light.signal == "psi-delta":
        psi = clean[0][0] + noise[0]  # equal noise in all directions on the sphere of N, C and S
        delta = (clean[1][0] + 2 * noise[1] / np.sin(2 * np.deg2rad(clean[0][0]))) % 360
        return Measurement(truth, psi, delta, pl.Spectrum(nm, psi, "psi-delta", delta=delta, angle=angle))
    values = clean[0]
    if case.drifting:  # a lamp that drifts slowly, and a dark level
        x = np.linspace(-1.0, 1.0, nm.size)
        slope, bend = random.normal(0.0, (0.15, 0.1))
        values = random.uniform(0.5, 2.0) * (1 + slope * x + bend * (2 * x * x - 1)) * values
        values = values + random.uniform(0.0, 0.03)
    values = values + noise[0]
    spectrum = pl.Spectrum(nm, values, case.scene.light.signal, calibrated=not case.drifting)
    return Measurement(truth, values, None, spectrum)


THICKNESS: Limit = (10.0, 1000.0, 60.0, 900.0)
SOAP: Limit = (100.0, 6000.0, 500.0, 4500.0)
OXIDE: Limit = (0.5, 20.0, 1.0, 12.0)
DENSE_A, DENSE_B = (1.7, 2.3, 1.8, 2.2), (0.0, 40000.0, 5000.0, 30000.0)
LOW = {"A": (1.3, 1.7, 1.38, 1.62), "B": (0.0, 20000.0, 2000.0, 15000.0), "thickness": THICKNESS}
HIGH = {"A": DENSE_A, "B": DENSE_B, "thickness": THICKNESS}
TWO = {"layer1.A": DENSE_A, "layer1.B": DENSE_B, "layer1.thickness": THICKNESS, "layer2.thickness": OXIDE}
GLASS = 1.5046, 4200.0  # A and B of BK7
WATER = 1.332, 3100.0
ANGLES = 65.0, 70.0, 75.0


def cases() -> list[Case]:
    """The cases of the table."""
    glass, cauchy = pl.dispersion.Cauchy(*GLASS), pl.dispersion.Cauchy
    depth, oxide, soap = (pl.Free(*limit[:2]) for limit in (THICKNESS, OXIDE, SOAP))
    low, high = (cauchy(*(pl.Free(*x[key][:2]) for key in "AB")) for x in (LOW, HIGH))
    constant = {"n": (1.3, 2.2, 1.4, 2.1), "thickness": THICKNESS}
    n = pl.dispersion.Constant(pl.Free(*constant["n"][:2]), 0.0)
    ellipsometry = pl.Light(signal="psi-delta", angle=65.0)
    film, native = pl.Layer(high, depth), pl.Layer("SiO2", oxide)
    lamp = pl.Instrument(scale="slow", offset="free")
    return [
        Case(
            "R, oxide on silicon: thickness",
            target=0.03,
            scene=pl.Scene(pl.Layer("SiO2", depth), "Si"),
            limits={"thickness": THICKNESS},
            film=_oxide_reflectance,
            wavelength=_nm(1341),
        ),
        Case(
            "R, film on silicon: thickness, Cauchy A and B",
            target=0.1,
            scene=pl.Scene(pl.Layer(low, depth), "Si"),
            limits=LOW,
            film=_film_reflectance,
            wavelength=_nm(401),
            levels=(4, 3),
        ),
        Case(
            "T, film on a glass plate: thickness, Cauchy A and B",
            target=0.1,
            scene=pl.Scene(pl.Layer(high, depth), pl.Substrate(glass, "air"), light=pl.Light(signal="T")),
            limits=HIGH,
            film=_plate_transmittance,
            wavelength=_nm(400),
            levels=(4, 3),
            step=21.0,
        ),
        Case(
            "Ψ and Δ, film on glass: thickness, Cauchy A and B",
            target=0.15,
            scene=pl.Scene(pl.Layer(high, depth), glass, light=ellipsometry),
            limits=HIGH,
            film=_film_on_glass,
            wavelength=_nm(99),
            angles=(55.0, 60.0, 65.0, 70.0, 75.0),
            noise=0.05,
            levels=(4, 3),
            step=21.0,
        ),
        Case(
            "Ψ and Δ, film on silicon: thickness, n",
            target=0.15,
            scene=pl.Scene(pl.Layer(n, depth), "Si", light=ellipsometry),
            limits=constant,
            film=_constant_on_silicon,
            wavelength=_nm(38),
            angles=ANGLES,
            noise=0.05,
            levels=(5,),
            step=21.0,
        ),
        Case(
            "Ψ and Δ, oxide on silicon: thickness",
            target=0.3,
            scene=pl.Scene(pl.Layer("SiO2", depth), "Si", light=ellipsometry),
            limits={"thickness": THICKNESS},
            film=_oxide_ellipsometry,
            wavelength=_nm(1286),
            angles=ANGLES,
            noise=0.05,
        ),
        Case(
            "Ψ and Δ, film and oxide on silicon: two thicknesses, Cauchy A and B",
            target=0.5,
            scene=pl.Scene([film, native], "Si", light=ellipsometry),
            limits=TWO,
            film=_two_layers,
            wavelength=_nm(463),
            angles=(65.0, 75.0),
            noise=0.05,
            levels=(4, 3, 1),
            step=21.0,
        ),
        Case(
            "intensity, soap film: thickness, slow scale, offset; each of 119 files",
            target=0.1,
            scene=pl.Scene(pl.Layer(cauchy(*WATER), soap), "air", instrument=lamp),
            limits={"thickness": SOAP},
            film=_soap_film,
            wavelength=_nm(400),
            noise=0.003,
            drifting=True,
            files=119,
        ),
    ]


def _nm(points: int) -> Array:
    return np.linspace(400.0, 900.0, points)


def _table(name: str, nm: Array) -> Array:
    index = np.asarray(pl.refractive_index(nm, name))
    return index if np.any(index.imag) else index.real


def _cauchy(A: Any, B: Any, nm: Array) -> Array:
    return A + B / nm**2


def _oxide_reflectance(nm: Array, angle: Array) -> Film:
    oxide, silicon = _table("SiO2", nm), _table("Si", nm)
    return lambda x: reflectance(nm, [(oxide, x[0])], silicon)


def _film_reflectance(nm: Array, angle: Array) -> Film:
    silicon = _table("Si", nm)
    return lambda x: reflectance(nm, [(_cauchy(x[0], x[1], nm), x[2])], silicon)


def _plate_transmittance(nm: Array, angle: Array) -> Film:
    glass = _cauchy(*GLASS, nm)
    return lambda x: plate_transmittance(nm, [(_cauchy(x[0], x[1], nm), x[2])], glass)


def _film_on_glass(nm: Array, angle: Array) -> Film:
    glass = _cauchy(*GLASS, nm)
    return lambda x: psi_delta(nm, [(_cauchy(x[0], x[1], nm), x[2])], glass, angle)


def _constant_on_silicon(nm: Array, angle: Array) -> Film:
    silicon = _table("Si", nm)
    return lambda x: psi_delta(nm, [(x[0], x[1])], silicon, angle)


def _oxide_ellipsometry(nm: Array, angle: Array) -> Film:
    oxide, silicon = _table("SiO2", nm), _table("Si", nm)
    return lambda x: psi_delta(nm, [(oxide, x[0])], silicon, angle)


def _two_layers(nm: Array, angle: Array) -> Film:
    oxide, silicon = _table("SiO2", nm), _table("Si", nm)
    return lambda x: psi_delta(nm, [(_cauchy(x[0], x[1], nm), x[2]), (oxide, x[3])], silicon, angle)


def _soap_film(nm: Array, angle: Array) -> Film:
    water = _cauchy(*WATER, nm)
    return lambda x: reflectance(nm, [(water, x[0])], 1.0)
