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
from scipy.special import digamma, wofz

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


def of_energy(epsilon: Callable[[np.ndarray], np.ndarray]) -> Index:
    """Index of a permittivity as a function of the photon energy (eV)."""
    return lambda wavelength: np.sqrt(epsilon(HC / np.asarray(wavelength)) + 0j)


def smith(ep: float, gamma: float, c: float, eps_inf: float) -> Index:
    """N. Smith, Phys. Rev. B 64, 155106 (2001)."""
    return of_energy(lambda e: eps_inf - ep**2 / (e**2 + 1j * gamma * e) * (1 + c / (1 - 1j * e / gamma)))


def poles(a_uv: float, e_uv: float, a_ir: float, eps_inf: float) -> Index:
    return of_energy(lambda e: eps_inf + a_uv / (e_uv**2 - e**2) - a_ir / e**2)


def critical_point(a: float, e0: float, gamma: float, degrees: float, eps_inf: float) -> Index:
    """P. Etchegoin and others, J. Chem. Phys. 125, 164705 (2006)."""
    turn = np.exp(1j * np.radians(degrees))
    return of_energy(
        lambda e: eps_inf + a * e0 * (turn / (e0 - e - 1j * gamma) + np.conj(turn) / (e0 + e + 1j * gamma))
    )


def parabolic_bands(a: float, e0: float, gamma: float, degrees: float, eps_inf: float) -> Index:
    turn = np.exp(1j * np.radians(degrees))
    return of_energy(lambda e: eps_inf + a * turn * gamma / (2 * e0 - 2 * e - 1j * gamma))


def adachi_m0(a: float, e0: float, gamma: float, eps_inf: float) -> Index:
    def epsilon(e: np.ndarray) -> np.ndarray:
        x = (e + 1j * gamma) / e0
        return eps_inf + a * e0**-1.5 * (2 - np.sqrt(1 + x) - np.sqrt(1 - x)) / x**2

    return of_energy(epsilon)


def adachi_m1(a: float, e0: float, gamma: float, eps_inf: float) -> Index:
    def epsilon(e: np.ndarray) -> np.ndarray:
        x = (e + 1j * gamma) / e0
        return eps_inf - a * np.log(1 - x**2) / x**2

    return of_energy(epsilon)


def tanguy(a: float, eg: float, r: float, gamma: float, eps_inf: float) -> Index:
    """C. Tanguy, Phys. Rev. Lett. 75, 4090 (1995), with ψ(1 − ξ) in place of ψ(ξ) + π cot πξ."""

    def g(z: np.ndarray) -> np.ndarray:
        xi = np.sqrt(r / (eg - z))
        return 2 * np.log(xi) - 2 * digamma(1 - xi) - 1 / xi

    def epsilon(e: np.ndarray) -> np.ndarray:
        z = e + 1j * gamma
        return eps_inf + a * np.sqrt(r) / z**2 * (g(z) + g(-z) - 2 * g(0 * z))

    return of_energy(epsilon)


def brendel_bormann(a: float, e0: float, gamma: float, sigma: float, eps_inf: float) -> Index:
    """A. Rakić and others, Appl. Opt. 37, 5271 (1998)."""

    def epsilon(e: np.ndarray) -> np.ndarray:
        root, width = np.sqrt(e**2 + 1j * gamma * e), np.sqrt(2) * sigma
        both = wofz((root - e0) / width) + wofz((root + e0) / width)
        return eps_inf + 0.5j * np.sqrt(np.pi) * a / (root * width) * both

    return of_energy(epsilon)


def triangle(a: float, e0: float, fwhm: float, left: float, right: float, eps_inf: float) -> Index:
    """Psemi with straight pieces: a triangle of ε₂, broadened numerically."""
    width = fwhm / (2 * np.sqrt(np.log(2)))
    nodes, weights = np.polynomial.legendre.leggauss(400)

    def loss(e: np.ndarray) -> np.ndarray:
        total = np.zeros(np.shape(e))
        for low, high in ((e0 - left, e0), (e0, e0 + right)):
            x = 0.5 * (low + high) + 0.5 * (high - low) * nodes
            height = a * np.interp(x, [e0 - left, e0, e0 + right], [0, 1, 0]) * weights * 0.5 * (high - low)
            for sign in (1, -1):
                at = (e[..., None] - sign * x) / width
                total += sign * (np.exp(-(at**2)) @ height) / (np.sqrt(np.pi) * width)
        return total

    return absorbing(eps_inf, loss)


def amorphous(n_inf: float, eg: float, f: float, e0: float, gamma: float) -> Index:
    """A. Forouhi and I. Bloomer, Phys. Rev. B 34, 7018 (1986)."""
    b, c = 2 * e0, e0**2 + gamma**2
    q = 0.5 * np.sqrt(4 * c - b**2)
    b0 = f / q * (-(b**2) / 2 + eg * b - eg**2 + c)
    c0 = f / q * ((eg**2 + c) * b / 2 - 2 * eg * c)

    def index(wavelength: np.ndarray) -> np.ndarray:
        e = HC / np.asarray(wavelength)
        below = e**2 - b * e + c
        return n_inf + (b0 * e + c0) / below + 1j * f * np.maximum(e - eg, 0) ** 2 / below

    return index


def phonon(eps_inf: float, to: float, to_loss: float, lo: float, lo_loss: float) -> Index:
    """F. Gervais and B. Piriou, Phys. Rev. B 10, 1642 (1974)."""
    return of_energy(
        lambda e: eps_inf * (lo**2 - e**2 - 1j * lo_loss * e) / (to**2 - e**2 - 1j * to_loss * e)
    )


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


def passive(draw: Draw) -> Draw:
    """Draw again where ε₂ of a critical point is negative in the spectrum: such a film amplifies light."""

    def drawn(random: np.random.Generator) -> Index:
        while True:
            index = draw(random)
            if np.all(index(np.linspace(300, 1000, 71)).imag >= 0):
                return index

    return drawn


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
    "drude-smith": lambda r: smith(
        r.uniform(1.2, 3.0), r.uniform(0.1, 0.5), r.uniform(-0.7, -0.2), r.uniform(3.0, 5.0)
    ),
    "uv-pole": lambda r: poles(r.uniform(60, 250), r.uniform(8, 13), 0.0, r.uniform(1, 2.5)),
    "ir-pole": lambda r: poles(0.0, 10.0, r.uniform(0.02, 1.0), r.uniform(2.2, 5.0)),
    "critical-point": passive(
        lambda r: critical_point(
            r.uniform(0.3, 2), r.uniform(2, 6), r.uniform(0.1, 0.8), r.uniform(-50, 50), r.uniform(1.5, 4.0)
        )
    ),
    "cppb": passive(
        lambda r: parabolic_bands(
            r.uniform(1, 6), r.uniform(2, 6), r.uniform(0.2, 1.2), r.uniform(-50, 50), r.uniform(1.5, 4.0)
        )
    ),
    "adachi-m0": lambda r: adachi_m0(
        r.uniform(8, 60), r.uniform(1.8, 5), r.uniform(0.02, 0.3), r.uniform(1.5, 4.0)
    ),
    "adachi-m1": lambda r: adachi_m1(
        r.uniform(0.5, 5), r.uniform(1.8, 5), r.uniform(0.02, 0.4), r.uniform(1.5, 4.0)
    ),
    "tanguy": lambda r: tanguy(
        r.uniform(3, 20), r.uniform(2.2, 4), r.uniform(0.02, 0.1), r.uniform(0.02, 0.15), r.uniform(1.5, 4.0)
    ),
    "brendel-bormann": lambda r: brendel_bormann(
        r.uniform(3, 30), r.uniform(2, 6), r.uniform(0.05, 0.5), r.uniform(0.1, 0.8), r.uniform(1.5, 4.0)
    ),
    "psemi": lambda r: triangle(
        r.uniform(2, 12),
        r.uniform(2.5, 5.5),
        r.uniform(0.1, 0.6),
        r.uniform(0.4, 1.5),
        r.uniform(0.4, 2.0),
        r.uniform(1.2, 3.0),
    ),
    "new-amorphous": lambda r: amorphous(
        r.uniform(1.4, 2.4), r.uniform(1.0, 3.0), r.uniform(0.02, 0.4), r.uniform(3.2, 7), r.uniform(0.4, 2.0)
    ),
    "forouhi-bloomer": lambda r: amorphous(
        r.uniform(1.4, 2.4), r.uniform(1.0, 3.0), r.uniform(0.02, 0.4), r.uniform(3.2, 7), r.uniform(0.4, 2.0)
    ),
    "gervais": lambda r: phonon(
        r.uniform(1.8, 4.0),
        r.uniform(0.06, 0.12),
        r.uniform(0.001, 0.005),
        r.uniform(0.13, 0.16),
        r.uniform(0.005, 0.01),
    ),
    "spline": lambda r: knotted(
        r.uniform(1.4, 2.4) + r.uniform(0.05, 0.5) * np.exp(-np.arange(len(KNOTS)) / 2), falling(r)
    ),
    "spline-kk": lambda r: knotted_absorption(r.uniform(1.4, 2.2), falling(r)),
}
"""Films of ordinary numbers; TCO-like ones for drude and drude-smith."""
GLASS = 1.52


def spectrum(model: str, index: Index, thickness: float, random: np.random.Generator) -> pl.Spectrum:
    """Ψ and Δ at two angles from 300 to 1000 nm, on an index of 1.52; R from 400 to 1700 nm of a
    transparent conductor; Ψ and Δ from 5 to 25 µm of phonons."""
    stack = Stack(((index, thickness),), cauchy(GLASS, 0.0))
    if model in ("drude", "drude-smith"):
        view: View = spectrum_view("R", 400, 1700, 131)
        values = seen(stack, Conditions(), 0.0, view)
        noisy = values + NOISE * random.normal(size=values.shape)
        return pl.Spectrum(view.wavelength, noisy, "R", sigma=np.full(values.shape, NOISE))
    low, high, count = (5000, 25000, 161) if model == "gervais" else (300, 1000, 71)
    view = ellipsometer_view(low, high, count, 60.0, 70.0)
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
