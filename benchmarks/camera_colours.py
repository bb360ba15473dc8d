"""Thickness from the colours of cameras: orders, probabilities and errors against the truth, as Markdown.

Run `python benchmarks/camera_colours.py`. Films of SiO₂ on silicon from 50 to 1500 nm are seen by three
cameras under two lamps at 0°, 20°, 40°, 55° and 65°, or at 0° alone, with normal noise of 1 % of white in
each linear channel, and with a known exposure (the scale) or a free one. Their colours are computed here with
NumPy alone, from the reflectance in steps of 1 nm. A fit searches 10 to 1600 nm. The table gives the share of
fits that list the truth (within 5 nm or four standard errors) among their orders, the share whose best order
is the true one, the same of those that give it a probability above 0.9, and the shares of true best orders
within 1 and 1.96 standard errors.
"""

from __future__ import annotations

import argparse

import numpy as np

import pellicle as pl
from pellicle.colour.observers import camera_sensor, illuminant_spectrum
from pellicle.data.colours import Colours

ANGLES = (0.0, 20.0, 40.0, 55.0, 65.0)
NOISE = 0.01
CAMERAS = {  # centres and standard deviations (nm) of red, green and blue, and their crosstalk
    "narrow": ((600.0, 540.0, 460.0), (18.0, 20.0, 16.0), 0.0),
    "broad": ((595.0, 535.0, 460.0), (35.0, 38.0, 28.0), 0.1),
    "shifted": ((620.0, 550.0, 445.0), (28.0, 30.0, 22.0), 0.05),
}
LAMPS = ("D65", "A")


def sensors():
    """The sensor of each camera under each lamp, by name."""
    nm = np.arange(380.0, 731.0)
    found = {}
    for name, (centres, widths, crosstalk) in CAMERAS.items():
        bands = np.exp(-0.5 * ((nm[:, None] - np.array(centres)) / np.array(widths)) ** 2)
        bands = bands @ (np.eye(3) + crosstalk * (1 - np.eye(3)))
        for lamp in LAMPS:
            found[f"{name}, {lamp}"] = camera_sensor(nm, bands, *illuminant_spectrum(lamp))
    return found


def reflectance(thickness, nm, angle):
    """Reflectance of SiO₂ on Si for unpolarised light, by the Airy formula, (films, wavelengths)."""
    n1, n2 = (np.asarray(pl.material(name)(nm)) for name in ("SiO2", "Si"))
    sine, cosine = np.sin(np.deg2rad(angle)), np.cos(np.deg2rad(angle))
    q1, q2 = np.sqrt(n1**2 - sine**2 + 0j), np.sqrt(n2**2 - sine**2 + 0j)
    phase = np.exp(4j * np.pi * q1 * np.asarray(thickness)[:, None] / nm)
    total = 0.0
    for a, b, c in ((cosine, q1, q2), (1 / cosine, n1**2 / q1, n2**2 / q2)):
        r01, r12 = (a - b) / (a + b), (b - c) / (b + c)
        total = total + 0.5 * np.abs((r01 + r12 * phase) / (1 + r01 * r12 * phase)) ** 2
    return total


def fits(sensor, angles, scale, truths, random):
    """For every film its fit, and its truth."""
    scene = pl.Scene(
        pl.Layer("SiO2", pl.Free(10, 1600)),
        "Si",
        instrument=pl.Instrument(scale=scale),
        uncertainty=pl.Uncertainty.none(),
    )
    exact = np.stack([reflectance(truths, sensor.wavelength, a) @ sensor.weights for a in angles], axis=1)
    exposure = 1.0 if scale == 1.0 else np.exp(random.uniform(*np.log([0.5, 2.0]), (len(truths), 1, 1)))
    measured = exposure * exact + NOISE * random.standard_normal(exact.shape)
    for truth, values in zip(truths, measured, strict=True):
        sigma = np.full(values.shape, NOISE)
        colours = Colours(values, sensor, "rgb", sigma=sigma, angle=np.array(angles))
        yield pl.fit(colours, scene), truth


def row(name, found):
    """Print one row of the table."""
    listed, best, sure, scores = [], [], [], []
    for fit, truth in found:
        own = fit["thickness"]
        rivals = [(r.parameters["thickness"], r.stderr["thickness"]) for r in fit.rivals if r.stderr]
        every = np.array([(own.value, own.stderr), *rivals])
        near = np.abs(every[:, 0] - truth) < np.maximum(5.0, 4 * every[:, 1])
        listed.append(near.any())
        best.append(near[0])
        sure.append((fit.probability or 0.0) > 0.9)
        if best[-1] and np.isfinite(own.stderr):
            scores.append((own.value - truth) / own.stderr)
    best, sure, scores = np.array(best), np.array(sure), np.abs(scores)
    right = f"{np.sum(best & sure)} of {np.sum(sure)}"
    print(
        f"| {name} | {100 * np.mean(listed):.1f} | {100 * np.mean(best):.1f} | {right}"
        f" | {100 * np.mean(scores < 1):.1f} | {100 * np.mean(scores < 1.96):.1f} |",
        flush=True,
    )


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--films", type=int, default=30)
    parser.add_argument("--repeats", type=int, default=3, help="films with other noise")
    arguments = parser.parse_args()
    print("| angles | exposure | listed (%) | best (%) | best where surer than 0.9 | 1 σ (%) | 1.96 σ (%) |")
    print("|:--|:--|--:|--:|--:|--:|--:|")
    for angles in (ANGLES, ANGLES[:1]):
        for scale in (1.0, "free"):
            random = np.random.default_rng(1)
            found = []
            for sensor in sensors().values():
                for _ in range(arguments.repeats):
                    truths = random.uniform(50.0, 1500.0, arguments.films)
                    found += fits(sensor, angles, scale, truths, random)
            row(f"{len(angles)} | {'known' if scale == 1.0 else 'free'}", found)


if __name__ == "__main__":
    main()
