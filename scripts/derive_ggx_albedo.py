"""Fit the polynomial of `pellicle.brdf.microfacet`: light that one reflection by GGX facets loses.

Run `python scripts/derive_ggx_albedo.py`; it prints the coefficients and the largest error of the fit. The
albedo is an average over visible normals (E. Heitz, JCGT 7(4), 2018) of mirror-like facets with Smith's
height-correlated shadowing, by Gauss-Legendre nodes and equal steps of azimuth.
"""

from __future__ import annotations

import numpy as np

DEGREES = 10, 6
"""In √(μ/(μ + α)) and in α."""
NODES = 128


def albedo(mu: float, alpha: float) -> float:
    """Share of light from the cosine `mu` that leaves after one reflection."""
    node, weight = np.polynomial.legendre.leggauss(NODES)
    share, azimuth = 0.5 * (node + 1)[:, None], 2 * np.pi * (np.arange(2 * NODES) + 0.5) / (2 * NODES)
    sine = np.sqrt(1 - mu * mu)
    stretched = np.array([alpha * sine, 0.0, mu]) / np.hypot(alpha * sine, mu)
    across = np.array([0.0, 1.0, 0.0])
    up = np.array([-stretched[2], 0.0, stretched[0]])  # across × stretched, turned so that z is not negative
    t1 = np.sqrt(share) * np.cos(azimuth)
    bottom = 0.5 * (1 + stretched[2])
    t2 = (1 - bottom) * np.sqrt(1 - t1**2) + bottom * np.sqrt(share) * np.sin(azimuth)
    t3 = np.sqrt(np.maximum(0.0, 1 - t1**2 - t2**2))
    normal = (x[:, None, None] * t for x, t in ((across, t1), (up, t2), (stretched, t3)))
    h = sum(normal) * np.array([alpha, alpha, 1.0])[:, None, None]
    h[2] = np.maximum(h[2], 0.0)
    h /= np.linalg.norm(h, axis=0)
    view = np.array([sine, 0.0, mu])[:, None, None]
    leaving = (2 * np.sum(view * h, axis=0) * h - view)[2]

    def wall(cosine):
        return (np.sqrt(1 + alpha**2 * (1 / np.maximum(cosine, 1e-12) ** 2 - 1)) - 1) / 2

    seen = np.where(leaving > 0, (1 + wall(mu)) / (1 + wall(mu) + wall(leaving)), 0.0)
    return float(0.5 * weight @ seen.mean(axis=1))


def main() -> None:
    alphas = np.unique([*np.linspace(0.01, 1, 40), *np.geomspace(0.003, 0.2, 20)])
    cosines = np.unique([*np.linspace(0, 1, 50)[1:], *np.geomspace(1e-3, 0.3, 30)])
    alpha, mu = (x.ravel() for x in np.meshgrid(alphas, cosines, indexing="ij"))
    lost = np.array([1 - albedo(*each) for each in zip(mu, alpha, strict=True)])
    along = np.polynomial.chebyshev.chebvander(2 * np.sqrt(mu / (mu + alpha)) - 1, DEGREES[0])
    across = np.polynomial.chebyshev.chebvander(2 * alpha - 1, DEGREES[1])
    columns = (along[:, :, None] * across[:, None, :]).reshape(len(mu), -1)
    found = np.linalg.lstsq(columns, lost, rcond=1e-12)[0].round(5)
    print(f"largest error {np.max(np.abs(columns @ found - lost)):.1e}")
    for row in found.reshape(DEGREES[0] + 1, -1):
        print(f"        ({', '.join(f'{x:g}' for x in row)}),")


if __name__ == "__main__":
    main()
