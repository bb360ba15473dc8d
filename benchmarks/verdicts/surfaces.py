"""BRDF samples of films on rough bases, clean and with everyday flaws, by an independent model.

GGX facets (Walter et al. 2007) with Smith's height-correlated shadowing (Heitz 2014), each with the
reflectance of `transfer_matrix` at its own angle of incidence, over the bands of a camera where a flaw asks
for them. Fitted are thickness, roughness and the weights of the lobes; the indices are those of the recipe.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from media import catalogued
from transfer_matrix import power

import pellicle as pl

BANDS = (645.0, 525.0, 445.0)
"""Wavelengths of the channels that the recipe states, in nm."""
NOISE = 0.02
EACH = 3
"""Cases of each kind."""


class Sample(NamedTuple):
    """Film, base (complex, in R, G and B), facets, and weights of their lobe and of a diffuse part."""

    thickness: float
    film: float
    base: np.ndarray
    roughness: float
    specular: float
    diffuse: float


@dataclass(frozen=True)
class Flaw:
    """Everything that a measurement has and its recipe does not know; the defaults are none of it."""

    film: float = 1.0  # factor of the film's index
    base: float = 1.0  # of the base's n and k
    centres: tuple[float, ...] = (0.0, 0.0, 0.0)  # of the channels, true minus stated, nm
    width: float = 0.0  # full width at half maximum of the channels, nm
    steps: float = 0.0  # relative thickness of the two halves of the area, ±
    gains: tuple[float, ...] = (1.0, 1.0, 1.0)
    tilt: float = 0.0  # of the sample in the plane of incidence, degrees


def drawn(kind: str, random: np.random.Generator) -> tuple[Sample, Flaw]:
    """The sample and the flaw of one case."""
    bases = [catalogued(name)(np.array(BANDS)) for name in ("Si", "Al", "Ti")]
    sample = Sample(
        random.uniform(60, 600),
        random.uniform(1.45, 2.3),
        bases[random.integers(3)],
        float(np.exp(random.uniform(np.log(0.05), np.log(0.4)))),
        random.uniform(0.5, 2.0),
        random.uniform(0.02, 0.2),
    )
    sign = random.choice([-1.0, 1.0])
    three = tuple(random.standard_normal(3).tolist())
    flaws = {
        "clean": Flaw(),
        "index": Flaw(film=1 + 0.02 * sign),
        "base": Flaw(base=1 + 0.05 * sign),
        "bands": Flaw(centres=tuple(8 * x for x in three), width=60.0),
        "two thicknesses": Flaw(steps=0.08),
        "gains": Flaw(gains=tuple(1 + 0.03 * x for x in three)),
        "tilt": Flaw(tilt=1.0 * sign),
    }
    return sample, flaws[kind]


KINDS = ("clean", "index", "base", "bands", "two thicknesses", "gains", "tilt")


def directions() -> tuple[np.ndarray, ...]:
    """Angles (degrees) to the light and to the viewer: arcs in the plane of incidence and across it."""
    across = np.tile(np.linspace(-76, 76, 32), 5)
    light = np.repeat([10.0, 25.0, 40.0, 55.0, 70.0], 32)
    turned = np.where(np.arange(160) % 4 == 0, 60.0, 0.0)
    return light, np.zeros(160), np.abs(across), np.where(across > 0, 180.0, 0.0) + turned


def unit(polar: np.ndarray, azimuth: np.ndarray) -> np.ndarray:
    """Unit vectors (samples, 3) of angles in degrees."""
    t, p = np.deg2rad(polar), np.deg2rad(azimuth)
    return np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], axis=-1)


def brdf(sample: Sample, flaw: Flaw) -> tuple[np.ndarray, np.ndarray]:
    """BRDF (samples, 3) in 1/sr at `directions`, and which of them are above the tilted horizon."""
    light_polar, light_azimuth, polar, azimuth = directions()
    turn = np.deg2rad(flaw.tilt)
    matrix = np.array([[np.cos(turn), 0, np.sin(turn)], [0, 1, 0], [-np.sin(turn), 0, np.cos(turn)]])
    i, o = unit(light_polar, light_azimuth) @ matrix.T, unit(polar, azimuth) @ matrix.T
    half = (i + o) / np.linalg.norm(i + o, axis=1, keepdims=True)
    a2 = sample.roughness**2
    facets = a2 / (np.pi * (half[:, 2] ** 2 * (a2 - 1) + 1) ** 2)
    ci, co = i[:, 2], o[:, 2]
    shadow = 0.5 / (co * np.sqrt(a2 + (1 - a2) * ci**2) + ci * np.sqrt(a2 + (1 - a2) * co**2))
    sine = np.sqrt(np.maximum(1 - np.sum(i * half, axis=1) ** 2, 0))
    nodes, weights = np.polynomial.hermite_e.hermegauss(7 if flaw.width else 1)
    colour = np.zeros((len(ci), 3))
    for c in range(3):
        for node, weight in zip(nodes, weights / weights.sum(), strict=True):
            nm = BANDS[c] + flaw.centres[c] + node * flaw.width / 2.3548
            media = [1.0, sample.film * flaw.film, sample.base[c] * flaw.base]
            for step in (-flaw.steps, flaw.steps):
                depth = [sample.thickness * (1 + step)]
                s, p = (power(nm, sine, media, depth, letter)[0] for letter in "sp")
                colour[:, c] += weight * (s + p) / 4
    values = sample.specular * (facets * shadow)[:, None] * colour + sample.diffuse
    return values * np.array(flaw.gains), (ci > 0.02) & (co > 0.02)


def cases(seed: int) -> Iterator[tuple[str, pl.BrdfSamples, pl.Surface, float, bool, str]]:
    """Kind, samples, the surface of the recipe, true thickness, whether σ is given, and what is true."""
    for kind in KINDS:
        for number in range(EACH):
            random = np.random.default_rng([seed, KINDS.index(kind), number])
            sample, flaw = drawn(kind, random)
            true, above = brdf(sample, flaw)
            noisy = np.maximum(true * (1 + NOISE * random.standard_normal(true.shape)), 0)[above]
            angles = [x[above] for x in directions()]
            data = pl.BrdfSamples(*angles, noisy, ("R", "G", "B"))
            given = number % 2 == 0
            data = data.with_noise(f"{100 * NOISE:g} %") if given else data
            numbers = {
                "thickness": pl.Free(0, 1000),
                "n": sample.film,
                "base_n": sample.base.real.tolist(),
                "base_k": sample.base.imag.tolist(),
                "roughness": pl.Free(0.01, 1),
                "specular": pl.Free(0, 10),
                "diffuse": pl.Free(0, 2),
            }
            surface = pl.Surface("microfacet-film", numbers, BANDS)
            about = replace(flaw, gains=tuple(np.round(flaw.gains, 3).tolist()))
            yield (
                kind,
                data,
                surface,
                sample.thickness,
                given,
                f"{sample._replace(base=sample.base[1])}; {about}",
            )
