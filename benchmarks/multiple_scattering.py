"""Albedo of films on rough facets with one reflection and with all, against a random walk over the facets.

Run `python benchmarks/multiple_scattering.py [--rays 400000]`; it prints the tables of
docs/explanation/effects.md. The walk follows rays over GGX facets of Smith's uncorrelated heights until they
leave (E. Heitz, J. Hanika, E. d'Eon and C. Dachsbacher, ACM TOG 35(4), 58 (2016)), with visible normals from
spherical caps (J. Dupuy and A. Benyoub, CGF 42(8), 2023), in NumPy.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable

import jax
import numpy as np

from pellicle.brdf.albedo import directional_albedo
from pellicle.brdf.models import model

WAVELENGTHS = (645.0, 525.0, 445.0)
FACES = {
    "steel": {"thickness": 0.0, "n": 1.5, "base_n": 2.7, "base_k": 2.8},
    "40 nm of oxide on steel": {"thickness": 40.0, "n": 2.9, "base_n": 2.7, "base_k": 2.8},
    "300 nm of SiO₂ on silicon": {"thickness": 300.0, "n": 1.46, "base_n": 4.1, "base_k": 0.05},
}
ALPHAS, ANGLES = (0.1, 0.2, 0.35, 0.5, 0.7, 1.0), (0.0, 60.0)
_MOST = 60
"""Reflections after which a ray is given up; of a white surface of α = 1 none of 1e6 has so many."""


def airy(cosine: np.ndarray, face: dict[str, float]) -> np.ndarray:
    """Unpolarised reflectance (rays, wavelengths) of a film, by Airy's formula (Born and Wolf, 7.6)."""
    c0, n0, n1 = cosine[:, None], face["n"], face["base_n"] + 1j * face["base_k"]
    c1, c2 = (np.sqrt(1 - (1 - c0**2) / n**2 + 0j) for n in (n0, n1))
    phase = np.exp(4j * np.pi * n0 * face["thickness"] * c1 / np.array(WAVELENGTHS))
    s = (c0 - n0 * c1) / (c0 + n0 * c1), (n0 * c1 - n1 * c2) / (n0 * c1 + n1 * c2)
    p = (n0 * c0 - c1) / (n0 * c0 + c1), (n1 * c1 - n0 * c2) / (n1 * c1 + n0 * c2)
    both = [np.abs((r1 + r2 * phase) / (1 + r1 * r2 * phase)) ** 2 for r1, r2 in (s, p)]
    return np.mean(both, axis=0)


def walk(
    reflectance: Callable[[np.ndarray], np.ndarray], alpha: float, theta: float, rays: int, seed: int = 0
) -> np.ndarray:
    """Share of light that leaves again, (channels,): `reflectance` of a cosine on a facet has them last."""
    rng = np.random.default_rng(seed)
    ray = np.tile([np.sin(np.deg2rad(theta)), 0.0, -np.cos(np.deg2rad(theta))], (rays, 1))
    level = np.ones(rays)  # of the cumulative distribution of heights, 1 at the top
    energy = np.ones((rays, reflectance(np.ones(1)).shape[1]))
    left = np.zeros(energy.shape[1])
    for _ in range(_MOST):
        # Smith's Λ of the direction of travel: below -1 on the way down
        tangent = alpha**2 * (1 / np.maximum(ray[:, 2] ** 2, 1e-20) - 1)
        slope = 0.5 * (np.sign(ray[:, 2]) * np.sqrt(1 + tangent) - 1)
        slope = np.where(slope == 0, 1e-12, slope)
        luck = rng.random(len(ray))
        leaves = (ray[:, 2] > 0) & (luck > 1 - level ** np.maximum(slope, 0.0))
        left += energy[leaves].sum(axis=0)
        stays = ~leaves
        if not stays.any():
            break
        ray, energy = ray[stays], energy[stays]
        level = np.minimum(level[stays] / (1 - luck[stays]) ** (1 / slope[stays]), 1.0)
        normal = _visible_normals(-ray, alpha, rng)
        across = np.sum(-ray * normal, axis=1)
        ray = ray + 2 * across[:, None] * normal
        energy *= reflectance(np.clip(across, 1e-6, 1.0))
    return left / rays


def _visible_normals(view: np.ndarray, alpha: float, rng: np.random.Generator) -> np.ndarray:
    stretch = np.array([alpha, alpha, 1.0])
    stretched = view * stretch
    stretched /= np.linalg.norm(stretched, axis=1, keepdims=True)
    z = (1 - rng.random(len(view))) * (1 + stretched[:, 2]) - stretched[:, 2]
    radius, azimuth = np.sqrt(np.clip(1 - z * z, 0, 1)), 2 * np.pi * rng.random(len(view))
    cap = np.stack([radius * np.cos(azimuth), radius * np.sin(azimuth), z], axis=1)
    normal = (cap + stretched) * stretch
    return normal / np.linalg.norm(normal, axis=1, keepdims=True)


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--rays", type=int, default=400_000)
    rays = arguments.parse_args().rays
    jax.config.update("jax_enable_x64", True)
    facets = model("microfacet-film")

    @jax.jit
    def albedo(numbers, theta):
        return directional_albedo(facets, {**numbers, "specular": 1.0, "wavelengths": WAVELENGTHS}, theta)

    white = {"thickness": 0.0, "n": 1.5, "base_n": 1e-4, "base_k": 100.0, "multiple_scattering": 1.0}
    print("| α | white, random walk | one reflection | all reflections |\n|---|---|---|---|")
    for alpha in ALPHAS:
        truth = walk(lambda cosine: np.ones((len(cosine), 1)), alpha, 0.0, rays)[0]
        every = float(albedo({**white, "roughness": alpha}, 0.0)[0])
        once = float(albedo({**white, "roughness": alpha, "multiple_scattering": 0.0}, 0.0)[0])
        print(f"| {alpha:g} | {truth:.4f} | {once:.4f} | {every:.4f} |")
    print(
        "\n| film | "
        + " | ".join(f"α {alpha:g}" for alpha in ALPHAS)
        + " |\n|---"
        + "|---" * len(ALPHAS)
        + "|"
    )
    for name, face in FACES.items():
        cells = []
        for alpha in ALPHAS:
            worst = [0.0, 0.0]
            for theta in ANGLES:
                truth = walk(lambda cosine, face=face: airy(cosine, face), alpha, theta, rays)
                for k in range(2):
                    numbers = {**face, "roughness": alpha, "multiple_scattering": float(k)}
                    found = np.asarray(albedo(numbers, theta))
                    worst[k] = max(worst[k], float(np.max(np.abs(found / truth - 1))))
            cells.append(f"{100 * worst[0]:.2g} → {100 * worst[1]:.2g} %")
        print(f"| {name} | {' | '.join(cells)} |")


if __name__ == "__main__":
    main()
