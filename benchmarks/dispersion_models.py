"""Every dispersion model from its default bounds: `python benchmarks/dispersion_models.py [MODEL...]`.

Twenty random clean films of each model of the catalogue are simulated by formulas written out here and the
transfer matrices of `benchmarks/verdicts` (Kramers-Kronig integrals are numerical ones, splines are SciPy's),
and fitted with the bare name of the model, so within its default bounds. A film is found if the misfit is
that of the noise and the thickness is right within three of its standard errors. Prints the films that were
not found.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.interpolate import BSpline

sys.path.insert(0, str(Path(__file__).parent / "verdicts"))

from family import ellipsometer_view, spectrum_view
from measurement import Conditions, Stack, View, recorded_angles, seen
from media import HC, Index, cauchy, lorentz

import pellicle as pl
from pellicle.cli.session import start
from pellicle.recipes.dispersion_models import KNOTS, free_model

FILMS = 20
NOISE = 2e-3
GRID = np.linspace(1e-6, 150.0, 15000)
"""Photon energies (eV) of the Kramers-Kronig integrals."""
FOUND = 1.3
"""Largest reduced χ² of a film that is found: that of the truth is 1 ± 0.1."""


def conjugated(loss: Callable[[np.ndarray], np.ndarray], wavelength: np.ndarray) -> np.ndarray:
    """A function with the imaginary part `loss` of the photon energy (eV), and what Kramers and Kronig add to
    its real part."""
    table = loss(GRID)
    energies, inverse = np.unique(HC / np.asarray(wavelength), return_inverse=True)
    own = np.interp(energies, GRID, table)
    # P∫ dξ/(ξ² − E²) over all energies is 0: subtracted, the integrand has no pole
    top = GRID[None] * table - (energies * own)[:, None]
    below = GRID**2 - energies[:, None] ** 2
    integrand = np.where(np.abs(below) > 1e-9, top / np.where(below == 0, 1.0, below), 0.0)
    rest = energies * own * np.log((GRID[-1] + energies) / (GRID[-1] - energies)) / (2 * energies)
    real = 2 / np.pi * (np.trapezoid(integrand, GRID, axis=1) - rest)
    return (real + 1j * loss(energies))[inverse].reshape(np.shape(wavelength))


def absorbing(eps_inf: float, loss: Callable[[np.ndarray], np.ndarray]) -> Index:
    """Index of a permittivity with the imaginary part `loss` of the photon energy (eV)."""
    return lambda wavelength: np.sqrt(eps_inf + conjugated(loss, wavelength))


def gaussian(a: float, e0: float, fwhm: float, eps_inf: float) -> Index:
    width = fwhm / (2 * np.sqrt(np.log(2)))
    return absorbing(
        eps_inf, lambda e: a * (np.exp(-(((e - e0) / width) ** 2)) - np.exp(-(((e + e0) / width) ** 2)))
    )


def tauc_lorentz(a: float, e0: float, c: float, eg: float, eps_inf: float) -> Index:
    """G. Jellison and F. Modine, Appl. Phys. Lett. 69, 371 (1996)."""
    edge = lambda e: np.maximum(e - eg, 0.0) ** 2 / e  # noqa: E731
    return absorbing(eps_inf, lambda e: a * e0 * c * edge(e) / ((e**2 - e0**2) ** 2 + (c * e) ** 2))


def cody_lorentz(a: float, e0: float, c: float, eg: float, ep: float, eps_inf: float) -> Index:
    """A. Ferlauto and others, J. Appl. Phys. 92, 2424 (2002), without an Urbach tail."""
    edge = lambda e: np.maximum(e - eg, 0.0) ** 2 / ((e - eg) ** 2 + ep**2)  # noqa: E731
    return absorbing(eps_inf, lambda e: edge(e) * a * e0 * c * e / ((e**2 - e0**2) ** 2 + (c * e) ** 2))


def drude(ep: float, gamma: float, eps_inf: float) -> Index:
    def index(wavelength: np.ndarray) -> np.ndarray:
        e = HC / wavelength
        return np.sqrt(eps_inf - ep**2 / (e**2 + 1j * gamma * e))

    return index


def urbach(a: float, b: float, k0: float, eu: float) -> Index:
    return lambda wavelength: a + b / wavelength**2 + 1j * k0 * np.exp((HC / wavelength - 3.1) / eu)


def sellmeier(b: float, c: float) -> Index:
    return lambda wavelength: np.sqrt(1 + b * wavelength**2 / (wavelength**2 - c) + 0j)


def knotted(n: np.ndarray, k: np.ndarray) -> Index:
    """B-splines of n and k that belong to the default knots (C. de Boor's averages)."""
    inner = [np.mean(KNOTS[i : i + 3]) for i in range(1, len(KNOTS) - 3)]
    around = [KNOTS[0]] * 4 + inner + [KNOTS[-1]] * 4
    return BSpline(around, n + 1j * k, 3)


def knotted_absorption(n_inf: float, k: np.ndarray) -> Index:
    """A B-spline of k in photon energy that belongs to the default knots and falls to zero beyond them."""
    sites = HC / np.array(KNOTS[::-1])
    below = sites[0] * (sites[0] / sites[1]) ** np.array([3, 2, 1])
    above = sites[-1] * (sites[-1] / sites[-2]) ** np.array([1, 2, 3])
    around, coefficients = np.concatenate([below, sites, above]), [k[-1], *k[::-1], k[0]]
    elements = [BSpline.basis_element(around[i : i + 5], extrapolate=False) for i in range(len(coefficients))]

    def loss(energy: np.ndarray) -> np.ndarray:
        return np.nan_to_num([own(energy) for own in elements]).T @ np.array(coefficients)

    return lambda wavelength: n_inf + conjugated(loss, wavelength)


def falling(random: np.random.Generator) -> np.ndarray:
    """Extinction at the default knots, which falls towards the red."""
    return random.uniform(0.02, 0.8) * np.exp(-np.arange(len(KNOTS)) / random.uniform(0.4, 1.5))


Draw = Callable[[np.random.Generator], Index]
MODELS: dict[str, Draw] = {
    "constant": lambda r: cauchy(r.uniform(1.3, 2.6), 0.0),
    "cauchy": lambda r: cauchy(r.uniform(1.3, 2.6), r.uniform(1e3, 4e4)),
    "cauchy-urbach": lambda r: urbach(
        r.uniform(1.4, 2.4), r.uniform(2e3, 4e4), r.uniform(0.01, 0.3), r.uniform(0.2, 1.0)
    ),
    "sellmeier": lambda r: sellmeier(r.uniform(0.8, 4.5), r.uniform(5e3, 4e4)),
    "lorentz": lambda r: lorentz(
        r.uniform(1.5, 4.0), r.uniform(0.3, 3.0), r.uniform(1.8, 6.0), r.uniform(0.1, 1.5)
    ),
    "drude": lambda r: drude(r.uniform(0.8, 2.3), r.uniform(0.05, 0.3), r.uniform(3.0, 5.0)),
    "gaussian": lambda r: gaussian(
        r.uniform(0.5, 5.0), r.uniform(2.0, 6.0), r.uniform(0.3, 2.0), r.uniform(1.5, 4.0)
    ),
    "tauc-lorentz": lambda r: tauc_lorentz(
        r.uniform(20, 200), r.uniform(3.2, 6.0), r.uniform(0.5, 4.0), r.uniform(1.0, 3.0), r.uniform(1.0, 2.5)
    ),
    "cody-lorentz": lambda r: cody_lorentz(
        r.uniform(20, 150),
        r.uniform(3.2, 6.0),
        r.uniform(0.5, 4.0),
        r.uniform(1.0, 3.0),
        r.uniform(0.5, 3.0),
        r.uniform(1.0, 2.5),
    ),
    "spline": lambda r: knotted(
        r.uniform(1.4, 2.4) + r.uniform(0.05, 0.5) * np.exp(-np.arange(len(KNOTS)) / 2), falling(r)
    ),
    "spline-kk": lambda r: knotted_absorption(r.uniform(1.4, 2.2), falling(r)),
}
"""Films of ordinary numbers; TCO-like ones for drude."""
GLASS = 1.52


def spectrum(model: str, index: Index, thickness: float, random: np.random.Generator) -> pl.Spectrum:
    """Ψ and Δ at two angles from 300 to 1000 nm, on an index of 1.52; R from 400 to 1700 nm of a
    transparent conductor."""
    stack = Stack(((index, thickness),), cauchy(GLASS, 0.0))
    if model == "drude":
        view: View = spectrum_view("R", 400, 1700, 131)
        values = seen(stack, Conditions(), 0.0, view)
        noisy = values + NOISE * random.normal(size=values.shape)
        return pl.Spectrum(view.wavelength, noisy, "R", sigma=np.full(values.shape, NOISE))
    view = ellipsometer_view(300, 1000, 71, 60.0, 70.0)
    psi, delta = recorded_angles(seen(stack, Conditions(), 0.0, view), Conditions())
    sigma = np.full(psi.shape, 0.06), np.full(psi.shape, 0.15)
    psi, delta = (x + s * random.normal(size=x.shape) for x, s in zip((psi, delta), sigma, strict=True))
    about = {"delta": np.mod(delta, 360), "delta_sigma": sigma[1], "angle": view.angle}
    return pl.Spectrum(view.wavelength, np.clip(psi, 0, 90), "psi-delta", sigma=sigma[0], **about)


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("model", nargs="*", choices=[[], *MODELS], help="models (all)")
    parser.add_argument("--films", type=int, default=FILMS, help=f"films of each ({FILMS})")
    parser.add_argument("--seed", type=int, default=31, help="seed (31)")
    asked = parser.parse_args()
    start()
    missed = 0
    for name in asked.model or MODELS:
        random, began, found = np.random.default_rng([asked.seed, len(name)]), time.perf_counter(), 0
        scene = pl.Scene(pl.Layer(free_model(name), pl.Free(1, 5000)), GLASS)
        for number in range(1, asked.films + 1):
            index = MODELS[name](random)
            thickness = float(np.exp(random.uniform(np.log(50), np.log(800))))
            fit = pl.fit(spectrum(name, index, thickness, random), scene)
            depth = fit["thickness"]
            right = abs(depth.value - thickness) < max(3 * depth.stderr, 0.005 * thickness)
            if fit.chi2_reduced < FOUND and right:
                found += 1
                continue
            print(
                f"  {name} {number}: {thickness:.1f} nm, found {depth.value:.1f} ± {depth.stderr:.2g} nm,"
                f" χ² {fit.chi2_reduced:.3g}, {fit.status}; "
                + ", ".join(f"{p.name} {p.value:.4g}" for p in fit.free[1:]),
                flush=True,
            )
        missed += asked.films - found
        seconds = (time.perf_counter() - began) / asked.films
        print(f"{name:14} {found} of {asked.films} found, {seconds:.2f} s each", flush=True)
    return int(missed > 0)


if __name__ == "__main__":
    sys.exit(main())
