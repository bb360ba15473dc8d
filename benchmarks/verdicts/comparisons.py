"""Comparisons of two scenes of one measurement: `python benchmarks/verdicts --only comparisons`.

Nitride on silicon without and with an oxide beneath, or a layer on top, thin (3 to 8 nm) or thick (15 to
40 nm), seen by instruments whose scale, wavelengths, angle and indices are off by what is usual. Each is
fitted with and without that layer. Counted are verdicts for the wrong scene, and those that call it strongly
favoured, by the evidence and, in brackets, by a BIC beyond 6.
"""

from __future__ import annotations

import time
import zlib
from collections import Counter
from collections.abc import Iterator
from itertools import product

import numpy as np
from family import ellipsometer_view, log_uniform, spectrum_view
from measurement import Conditions, Stack, View, recorded_angles, recorded_power, seen
from media import catalogued

import pellicle as pl

EACH = 10
"""Cases without the effect, with a thin and with a thick one, of each signal and effect."""
SIZES = {"no": (0.0, 0.0), "thin": (3.0, 8.0), "thick": (15.0, 40.0)}
"""Thicknesses in nm."""
STRONG_BIC = 6.0
VIEWS = (spectrum_view("R", 400, 800, 101), ellipsometer_view(400, 800, 64, 70.0))
FILM = pl.Layer("Si3N4", pl.Free(10, 800), name="film")
PLAIN = "plain"
SCENES = {
    PLAIN: pl.Scene(FILM, "Si"),
    "native oxide": pl.Scene([FILM, pl.Layer("SiO2", pl.Free(0.0, 60.0), name="native")], "Si"),
    "top layer": pl.Scene([pl.Layer(1.5, pl.Free(0.0, 60.0), name="top"), FILM], "Si"),
}


def _measured(view: View, effect: str, size: str, random: np.random.Generator) -> tuple[pl.Spectrum, str]:
    """A spectrum with everyday errors, and its numbers."""
    extra = random.uniform(*SIZES[size])
    conditions = Conditions(
        shift=0.3 * random.standard_normal(),
        angle_error=0.1 * random.standard_normal() if np.any(view.angle) else 0.0,
        film_factor=1 + 0.003 * random.standard_normal(),
        substrate_factor=1 + 0.002 * random.standard_normal(),
        factor=1 + 0.007 * random.standard_normal(),
        overlayer_nm=extra if effect == "top layer" else 0.0,
        interlayer=catalogued("SiO2") if extra and effect == "native oxide" else None,
        interlayer_nm=extra,
    )
    stack = Stack(((catalogued("Si3N4"), log_uniform(random, 60, 500)),), catalogued("Si"))
    noise, values = log_uniform(random, 3e-4, 2e-3), seen(stack, conditions, 0.0, view)
    detail = f"{conditions}; {stack.thickness:.4g} nm, noise {noise:.1g}"
    if view.signal == "R":
        values = recorded_power(values, conditions, view) + noise * random.standard_normal(values.shape)
        return pl.Spectrum(view.wavelength, values, "R", sigma=np.full(values.shape, noise)), detail
    psi, delta = recorded_angles(values, conditions)
    sd = np.rad2deg(noise / 2), np.rad2deg(noise / np.maximum(np.abs(np.sin(2 * np.deg2rad(psi))), 0.02))
    psi = np.clip(psi + sd[0] * random.standard_normal(psi.size), 0, 90)
    delta = np.mod(delta + sd[1] * random.standard_normal(psi.size), 360)
    about = {"sigma": np.full(psi.size, sd[0]), "delta": delta, "delta_sigma": sd[1], "angle": view.angle}
    return pl.Spectrum(view.wavelength, psi, "psi-delta", **about), detail


def _outcomes(seed: int) -> Iterator[tuple[str, str, str]]:
    """Outcome, name and what there is to say of each comparison."""
    for view, effect, size, number in product(VIEWS, SCENES, SIZES, range(EACH)):
        if effect == PLAIN:
            continue
        name, began = f"{view.signal}, {size} {effect}, {number + 1}", time.perf_counter()
        data, detail = _measured(view, effect, size, np.random.default_rng([seed, zlib.crc32(name.encode())]))
        comparison = pl.compare(data, {key: SCENES[key] for key in (PLAIN, effect)})
        truth = PLAIN if size == "no" else effect
        by_bic = sorted(comparison.candidates, key=lambda c: c.bic)
        outcome = "right" if comparison.best.name == truth else "wrong"
        if "do not distinguish" in comparison.verdict:
            outcome = "undecided"
        elif "strongly" in comparison.verdict:
            outcome += " strongly"
        bic = "strongly" if by_bic[1].bic - by_bic[0].bic >= STRONG_BIC else ""
        bic = f"{'right' if by_bic[0].name == truth else 'wrong'} {bic}".strip()
        print(f"{time.perf_counter() - began:6.2f} s  {outcome:15} ({bic:14})  {name}", flush=True)
        yield f"{size}: {outcome}", f"{size}: {bic}", f"{name}: {comparison.verdict} ({detail})"


def report(seed: int) -> None:
    """Print the counts of outcomes, and every wrong verdict."""
    every = list(_outcomes(seed))
    for title, place in (("by evidence", 0), ("by BIC", 1)):
        counts = Counter(row[place] for row in every)
        print(
            f"\n{len(every)} comparisons {title}: " + ", ".join(f"{n} {w}" for w, n in sorted(counts.items()))
        )
    for outcome, _, detail in every:
        if "wrong" in outcome or (outcome.startswith("thick") and "strongly" not in outcome):
            print(f"  {outcome}: {detail}")
