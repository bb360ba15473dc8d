"""Thickness of a film from a camera's BRDF samples, by a fit that knows the bands and by one that does not.

Run `python benchmarks/brdf_bands.py [--runs 10]`; it prints the table of docs/brdf_recovery.md. A camera with
bands of 70 to 90 nm sees SiO₂ of 320 nm on silicon, rough with α = 0.2, in 200 directions with a noise of
1 %. The samples are integrated in steps of 1 nm, by formulas written out here. Free are the thickness, the
index, the roughness and the weights.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import numpy as np

import pellicle as pl
from pellicle.colour.observers import Sensor, camera_sensor, illuminant_spectrum
from pellicle.data.brdf_samples import BrdfSamples
from pellicle.materials import material
from pellicle.scene.free import Free
from pellicle.scene.surface import Surface
from pellicle.simulation.brdf import Directions

THICKNESS, INDEX, ROUGHNESS, DIFFUSE, NOISE = 320.0, 1.46, 0.2, 0.02, 0.01
FREE = {
    "thickness": Free(0, 1000),
    "n": Free(1.3, 1.7),
    "roughness": Free(0.01, 1),
    "specular": Free(0, 10),
    "diffuse": Free(0, 1),
}


def camera() -> Sensor:
    """Sensitivities of a common shape under daylight."""
    nm = np.arange(390.0, 731.0, 5)
    bands = [np.exp(-(((nm - peak) / width) ** 2)) for peak, width in ((600, 42), (535, 50), (460, 40))]
    return camera_sensor(nm, np.stack(bands, axis=1), *illuminant_spectrum("D65"))


def directions() -> Directions:
    """The plane of incidence: five angles of light, 40 directions each."""
    across = np.tile(np.linspace(-78, 78, 40), 5)
    light = np.repeat([10.0, 25, 40, 55, 70], 40)
    return Directions(light, np.zeros(200), np.abs(across), np.where(across > 0, 180.0, 0.0))


def samples(eye: Sensor, at: Directions, rng: np.random.Generator) -> BrdfSamples:
    """Samples with noise, by Airy's formula and GGX facets with Smith's shadowing."""
    theta_i, theta_o = np.deg2rad(at.theta_i), np.deg2rad(np.where(at.phi_o > 90, at.theta_o, -at.theta_o))
    half, inner = (theta_o - theta_i) / 2, (theta_i + theta_o) / 2
    a2 = ROUGHNESS**2
    density = a2 / (np.pi * (np.cos(half) ** 2 * (a2 - 1) + 1) ** 2)
    wall = [(np.sqrt(1 + a2 * np.tan(x) ** 2) - 1) / 2 for x in (theta_i, theta_o)]
    lobe = density / (1 + wall[0] + wall[1]) / (4 * np.cos(theta_i) * np.cos(theta_o))
    base = np.asarray(material("Si")(eye.wavelength), complex)
    c0 = np.cos(inner)[:, None]
    c1, c2 = (np.sqrt(1 - (1 - c0**2) / n**2 + 0j) for n in (INDEX, base))
    phase = np.exp(4j * np.pi * INDEX * THICKNESS * c1 / eye.wavelength)
    s = (c0 - INDEX * c1) / (c0 + INDEX * c1), (INDEX * c1 - base * c2) / (INDEX * c1 + base * c2)
    p = (INDEX * c0 - c1) / (INDEX * c0 + c1), (base * c1 - INDEX * c2) / (base * c1 + INDEX * c2)
    spectrum = sum(abs((r1 + r2 * phase) / (1 + r1 * r2 * phase)) ** 2 for r1, r2 in (s, p)) / 2
    clean = lobe[:, None] * (spectrum @ (eye.weights / eye.white)) + DIFFUSE
    noisy = clean * (1 + NOISE * rng.standard_normal(clean.shape))
    return BrdfSamples(*at, noisy, ("R", "G", "B")).with_noise("1 %")


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--runs", type=int, default=10)
    runs = arguments.parse_args().runs
    eye, at = camera(), directions()
    centres = tuple((eye.wavelength @ (eye.weights / eye.white)).tolist())
    kinds: dict[str, Callable[[], Surface]] = {
        "the bands": lambda: Surface("microfacet-film", FREE, sensor=eye, base="Si"),
        "the mean wavelength of each band": lambda: Surface("microfacet-film", FREE, centres, base="Si"),
    }
    print("| the fit knows | rms error of d (nm) | stated (nm) | reduced χ² | status | CPU time (s) |")
    print("|---|---|---|---|---|---|")
    for name, surface in kinds.items():
        began, errors, stated, chi2, statuses = time.process_time(), [], [], [], []
        for seed in range(runs):
            fit = pl.fit(samples(eye, at, np.random.default_rng(seed)), surface())
            errors.append(fit["thickness"].value - THICKNESS)
            stated.append(fit["thickness"].stderr)
            chi2.append(fit.chi2_reduced)
            statuses.append(str(fit.status))
        most = max(set(statuses), key=statuses.count)
        print(
            f"| {name} | {np.sqrt(np.mean(np.square(errors))):.2f} | {np.median(stated):.2f}"
            f" | {np.median(chi2):.3g} | {most} in {statuses.count(most)} of {runs}"
            f" | {(time.process_time() - began) / runs:.1f} |"
        )


if __name__ == "__main__":
    main()
