"""Comparisons of two scenes of one measurement: `python benchmarks/verdicts --only comparisons`.

Nitride on silicon with and without an oxide beneath, or a layer on top, seen by instruments whose scale,
wavelengths, angle and indices are off by what is usual. Each is fitted with and without that layer. Counted
are verdicts for the wrong scene, and those that call it strongly favoured.
"""

from __future__ import annotations

import time
import zlib
from collections import Counter
from collections.abc import Iterator

import numpy as np
from family import ellipsometer_view, log_uniform, spectrum_view
from measurement import Conditions, Stack, View, recorded_angles, recorded_power, seen
from media import catalogued

import pellicle as pl
from pellicle.fitting.comparison import UNDECIDED

EACH = 15
"""Cases with and without the effect, of each signal and effect."""
VIEWS = (spectrum_view("R", 400, 800, 101), ellipsometer_view(400, 800, 64, 70.0))
FILM = pl.Layer("Si3N4", pl.Free(10, 800), name="film")
SCENES = {
    "plain": pl.Scene(FILM, "Si"),
    "native oxide": pl.Scene([FILM, pl.Layer("SiO2", pl.Free(0.0, 12.0), name="native")], "Si"),
    "top layer": pl.Scene([pl.Layer(1.5, pl.Free(0.0, 12.0), name="top"), FILM], "Si"),
}


def _measured(view: View, effect: str, there: bool, random: np.random.Generator) -> tuple[pl.Spectrum, str]:
    """A spectrum with everyday errors, and its numbers."""
    conditions = Conditions(
        shift=0.3 * random.standard_normal(),
        angle_error=0.1 * random.standard_normal() if np.any(view.angle) else 0.0,
        film_factor=1 + 0.003 * random.standard_normal(),
        substrate_factor=1 + 0.002 * random.standard_normal(),
        factor=1 + 0.007 * random.standard_normal(),
        overlayer_nm=random.uniform(3.0, 7.0) if there and effect == "top layer" else 0.0,
        interlayer=catalogued("SiO2") if there and effect == "native oxide" else None,
        interlayer_nm=random.uniform(3.0, 8.0),
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
    for view in VIEWS:
        for effect in ("native oxide", "top layer"):
            for number in range(2 * EACH):
                there, began = number % 2 == 1, time.perf_counter()
                name = f"{view.signal}, {effect if there else f'no {effect}'}, {number // 2 + 1}"
                data, detail = _measured(
                    view, effect, there, np.random.default_rng([seed, zlib.crc32(name.encode())])
                )
                comparison = pl.compare(data, {key: SCENES[key] for key in ("plain", effect)})
                best, second = sorted(comparison.candidates, key=lambda c: c.bic)
                outcome = "right" if (best.name == effect) == there else "wrong"
                if second.bic - best.bic < UNDECIDED:
                    outcome = "undecided"
                elif "strongly" in comparison.verdict:
                    outcome += " strongly"
                print(f"{time.perf_counter() - began:6.2f} s  {outcome:15}  {name}", flush=True)
                yield outcome, name, f"{comparison.verdict} ({detail})"


def report(seed: int) -> None:
    """Print the counts of outcomes, and every wrong verdict."""
    every = list(_outcomes(seed))
    counts = Counter(outcome for outcome, *_ in every)
    print(f"\n{len(every)} comparisons: " + ", ".join(f"{n} {word}" for word, n in sorted(counts.items())))
    for outcome, name, detail in every:
        if outcome.startswith("wrong"):
            print(f"  {outcome}: {name}: {detail}")
