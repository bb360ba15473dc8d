"""Coverage of n(λ), k(λ) and the thickness of absorbers: `python benchmarks/verdicts --only absorbers`.

Films of pigments and semiconductors whose index is none of the formulas that are fitted: tables of the
catalogue, and sums of skewed absorption bands in k, one of them beyond the spectrum, whose n is integrated by
the method of K. Ohta and H. Ishida (1988, Appl. Spectrosc. 42, 952). Needs only `index` of a fit, so that it
scores any version.
"""

from __future__ import annotations

import math
import time
import zlib
from collections.abc import Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from family import _scene, ellipsometer_view, log_uniform, recipe, spectrum_view
from measurement import Conditions, Stack, View, recorded_angles, seen
from media import HC, Index, catalogued

import pellicle as pl

TABLES = ("Fe2O3", "Cu2O", "CuO", "CdS", "CdSe", "CdTe", "GaP", "InP", "a-Si")
EACH = 10
"""Cases of each group."""
WITHIN, OUTSIDE = 1.959964, 3.0
PLATE = '{ material = "BK7", back = "air", plate_mm = 1.0 }'
KNOTS = "400,470,540,610,690,780"
R, T = spectrum_view("R", 400, 780, 96), spectrum_view("T", 400, 780, 96)
ANGLES = ellipsometer_view(400, 780, 48, 60.0, 70.0)


class Group(NamedTuple):
    """Measurements of one kind: the formula that is fitted, the substrate, and if the thickness is free."""

    name: str
    model: str
    views: tuple[View, ...]
    substrate: str
    free: bool


GROUPS = (
    Group("R, thickness given", f"spline-kk({KNOTS})", (R,), "BK7", False),
    Group("R, thickness given", f"spline({KNOTS})", (R,), "BK7", False),
    Group("R", "tauc-lorentz", (R,), "Ag", True),
    Group("R and T", f"spline-kk({KNOTS})", (R, T), "BK7", True),
    Group("psi and delta", f"spline-kk({KNOTS})", (ANGLES,), "Si", True),
    Group("psi and delta", "tauc-lorentz", (ANGLES,), "Si", True),
)


class Curve(NamedTuple):
    """One answer: the share of points of n and of k within 95 %, the thickness and the status."""

    name: str
    detail: str
    n: np.ndarray
    k: np.ndarray
    width: float
    truth: float
    value: float
    stderr: float
    status: str
    chi2: float
    seconds: float
    verdict: str


def pigment(random: np.random.Generator) -> Index:
    """Skewed absorption bands and the n that follows from them, tabulated from 0.3 to 14 eV."""
    energy = np.arange(0.3, 14.0, 0.01)
    k = np.zeros(energy.size)
    bands = [
        (random.uniform(1.9, 3.0), random.uniform(0.1, 0.8)),
        (random.uniform(3.4, 5.5), random.uniform(0.6, 1.6)),
    ]
    if random.uniform() < 0.5:
        bands.append((random.uniform(2.2, 3.4), random.uniform(0.05, 0.4)))
    for centre, height in bands:
        width, skew = random.uniform(0.07, 0.2), random.uniform(-0.4, 0.4)
        x = np.log(energy / centre) / width
        k += height * np.exp(-0.5 * (x / (1 + skew * np.tanh(x))) ** 2)
    # sums over every second energy leave out the pole
    n = np.empty(energy.size)
    for i, e in enumerate(energy):
        other = slice((i + 1) % 2, None, 2)
        n[i] = 2 / math.pi * 0.02 * np.sum(energy[other] * k[other] / (energy[other] ** 2 - e**2))
    table, level = n + 1j * k, random.uniform(1.3, 1.9)
    return lambda nm: level + np.interp(HC / nm, energy, table)


@lru_cache
def tabulated(name: str) -> Index:
    """Measured index of a material of the catalogue over the spectra."""
    nm = np.linspace(399.0, 781.0, 3821)
    table = np.asarray(pl.refractive_index(nm, name), dtype=complex)
    return lambda at: np.interp(at, nm, table)


def measured(group: Group, number: int, seed: int) -> tuple[list[pl.Spectrum], Any, Index, float, str]:
    """Spectra with their σ, the scene that is fitted, the true index and thickness of one case."""
    random = np.random.default_rng([seed, zlib.crc32(f"{group.name} {group.model} {number}".encode())])
    name = "pigment" if number % 2 else str(random.choice(TABLES))
    index = pigment(random) if number % 2 else tabulated(name)
    depth, noise = log_uniform(random, 20, 250), log_uniform(random, 5e-4, 3e-3)
    spectra, plate = [], 1.0 if T in group.views else None
    stack = Stack(((index, depth),), catalogued(group.substrate), plate_mm=plate)
    for view in group.views:
        values = seen(stack, Conditions(), 0.0, view)
        if view.signal == "psi-delta":
            psi, delta = recorded_angles(values, Conditions())
            sd = (
                np.rad2deg(noise / 2),
                np.rad2deg(noise / np.maximum(np.abs(np.sin(2 * np.deg2rad(psi))), 0.02)),
            )
            psi = np.clip(psi + sd[0] * random.standard_normal(psi.size), 0, 90)
            delta = np.mod(delta + sd[1] * random.standard_normal(psi.size), 360)
            about = {"sigma": np.full(psi.size, sd[0]), "delta": delta, "delta_sigma": sd[1]}
            spectra.append(pl.Spectrum(view.wavelength, psi, view.signal, angle=view.angle, **about))
        else:
            noisy = values + noise * random.standard_normal(values.size)
            sigma = np.full(values.size, noise)
            spectra.append(pl.Spectrum(view.wavelength, noisy, view.signal, sigma=sigma, angle=view.angle))
    substrate = PLATE if plate else f'"{group.substrate}"'
    text = recipe(group.views[0].signal, substrate, f'"{group.model}"', (2, 1000))
    if not group.free:
        text = text.replace("{ lower = 2, upper = 1000 }", f"{depth:.8g}")
    return spectra, _scene(text), index, depth, f"{name}, {depth:.4g} nm, noise {noise:.1g}"


def answer(group: Group, number: int, seed: int) -> Curve:
    """Fit one case and compare its index and thickness with the truth."""
    spectra, scene, index, depth, detail = measured(group, number, seed)
    began = time.perf_counter()
    fit = pl.fit(spectra if len(spectra) > 1 else spectra[0], scene)
    seconds, found = time.perf_counter() - began, fit.index
    some = np.linspace(0, found.wavelength.size - 1, 13).round().astype(int)
    true = index(found.wavelength[some])
    off = [np.abs(found.n[some] - true.real), np.abs(found.k[some] - true.imag)]
    inside = [x <= WITHIN * s[some] for x, s in zip(off, (found.n_stderr, found.k_stderr), strict=True)]
    thickness = fit["thickness"]
    return Curve(
        f"{group.name}, {group.model.partition('(')[0]}, {number}",
        detail,
        *inside,
        float(np.median(found.n_stderr)),
        depth,
        thickness.value,
        thickness.stderr,
        str(fit.status),
        fit.chi2_reduced,
        seconds,
        fit.verdict,
    )


def summary(answers: Sequence[Curve]) -> str:
    """Coverage and outcomes of some answers in one line."""
    n, k = (np.mean([getattr(a, x) for a in answers]) for x in "nk")
    usable = [a for a in answers if a.status not in ("misfit", "not-converged", "failed")]
    used = np.mean([[*a.n, *a.k] for a in usable]) if usable else math.nan
    firm = [a for a in answers if a.status == "converged" and a.stderr > 0]
    outside = sum(abs(a.value - a.truth) > OUTSIDE * a.stderr for a in firm)
    width = np.median([a.width for a in answers])
    return (
        f"within 95 %: n {100 * n:.0f} %, k {100 * k:.0f} %, both of {len(usable)} usable {100 * used:.0f} %;"
        f" median error of n {width:.2g}; thickness firm {len(firm)} of {len(answers)},"
        f" outside three {outside}"
    )


def report(seed: int, limit: int | None) -> None:
    """Score all groups and print each answer."""
    every: list[Curve] = []
    for group in GROUPS:
        for number in range(min(EACH, limit or EACH)):
            every.append(answer(group, number, seed))
            a = every[-1]
            print(
                f"{a.seconds:5.1f} s  {a.name} | {a.detail}:"
                f" n {100 * a.n.mean():.0f} %, k {100 * a.k.mean():.0f} %,"
                f" χ² {a.chi2:.3g}, {a.value:.4g} ± {a.stderr:.2g}, {a.status}\n        {a.verdict}",
                flush=True,
            )
    for group in GROUPS:
        name = f"{group.name}, {group.model.partition('(')[0]},"
        print(f"{name:40} {summary([a for a in every if a.name.startswith(name)])}")
    print(f"{'all':40} {summary(every)}")
