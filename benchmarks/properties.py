"""Properties of a million random scenes: finite values and derivatives, conservation of energy.

Run `python benchmarks/properties.py` (`make properties`). Single films and stacks of 1 to 8 layers, in
float64 and float32: media that are real, weakly absorbing, metallic; dense ambients; thickness 0 and
1e-6 nm to 1 mm; angles at 0, at 90 and up to 1e-9 degrees from it, and critical in a layer or in the
substrate. Each line counts the scenes that violate a law; the exit code is 1 if there are any. N² + C² + S²
must be 1, and at most 1 for a mixture of two samples.
"""

from __future__ import annotations

import argparse
import sys
import time
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

import pellicle as pl
from pellicle.optics import coherent
from pellicle.optics.ellipsometry import Stokes, normalised, stokes
from pellicle.optics.pair import abs2, to_pair

CHUNK = 5000


def rounding(rows: np.ndarray, values: np.ndarray, slopes: np.ndarray, layers: int) -> np.ndarray:
    """Return the allowed deviation of R + T from 1: 32 roundings of 1, of each layer, and of resonances.

    The flux through a layer is conserved by c² + Q f² = 1 for every phase, so neither grazing incidence
    nor a critical angle matters. A guided wave does: an index that is rotated by ε in the complex plane by
    rounding changes the sum by ε n ∂(R + T)/∂k, and amplitudes of size 1 cancel in a denominator that is
    as small as cos θ/|1 + r|.
    """
    n, k = rows[:, layers : 2 * layers], slopes[:, :4, 2 * layers : 3 * layers]
    turned = np.sum(np.abs(k[:, :2] + k[:, 2:]) * n[:, None], axis=2)
    cosine = np.maximum(np.cos(np.deg2rad(rows[:, -2:-1])), 1e-9)
    return 32 * np.finfo(rows.dtype).eps * (1 + layers + turned + values[:, 10:] / cosine)


def scenes(rng: np.random.Generator, count: int, layers: int) -> np.ndarray:
    """Draw rows of thicknesses, n and k of each layer; n, k of the substrate; ambient, angle, wavelength."""

    def often(values, edges, chance=0.15):
        return np.where(rng.random(values.shape) < chance, rng.choice(edges, values.shape), values)

    def media(*shape):
        n = often(10 ** rng.uniform(-1.3, 0.8, shape), [1.0, 1.5])
        return n, often(10 ** rng.uniform(-12, 1, shape), [0.0], 0.4)

    thickness = often(10 ** rng.uniform(-6, 6, (count, layers)), [0.0])
    (n, k), (n2, k2) = media(count, layers), media(count)
    transparent = rng.random(count) < 0.3
    k, k2 = np.where(transparent[:, None], 0.0, k), np.where(transparent, 0.0, k2)
    ambient = often(rng.uniform(1, 4, count), [1.0, 1.5])
    near_grazing = 90 - 10 ** rng.uniform(-9, 0, count)
    angle = often(often(rng.uniform(0, 90, count), [0.0, 30.0, 90.0]), near_grazing, 0.1)
    critical = np.where(rng.random(count) < 0.5, n2, n[:, 0]) / ambient
    total = (critical < 1) & (rng.random(count) < 0.2)
    angle = np.where(total, np.rad2deg(np.arcsin(np.minimum(critical, 1))), angle)
    rest = (n2, k2, ambient, angle, 10 ** rng.uniform(1, 6, count))
    return np.concatenate([thickness, n, k, np.stack(rest, 1)], axis=1)


def signals(row, layers: int):
    """Rs, Rp, Ts, Tp, Ψ, Δ, the Stokes sums and |1 + r| of one scene."""
    d, n, k = row[: 3 * layers].reshape(3, layers)
    n2, k2, ambient, angle, wavelength = row[-5:]
    media, below = list(jax.lax.complex(n, k)), jax.lax.complex(n2, k2)
    film = (wavelength, d, media, below)
    at = {"ambient": ambient, "angle": angle}
    powers = [f(*film, **at, polarisation=p) for f in (pl.reflectance, pl.transmittance) for p in "sp"]
    layered = ([to_pair(index) for index in media], to_pair(below), list(2 * jnp.pi / wavelength * d))
    responses = coherent.responses(ambient, *layered, jnp.deg2rad(angle))
    field = [abs2(1 + x.reflected / x.denominator) ** 0.5 for x in responses]
    return jnp.stack([*powers, *pl.ellipsometry(*film, **at), *stokes(*responses), *field])


@partial(jax.jit, static_argnums=1)
def run(rows, layers: int):
    one = partial(signals, layers=layers)
    return jax.vmap(lambda row: (one(row), jax.jacfwd(one)(row)))(rows)


def purity(sums) -> np.ndarray:
    """N² + C² + S² of Stokes sums (4, scenes); 1 where nothing is reflected."""
    n, c, s = map(np.asarray, normalised(Stokes(*map(jnp.asarray, sums))))
    square = n**2 + c**2 + s**2
    return np.where(square == 0, 1, square)


def violations(rows: np.ndarray, layers: int) -> dict[str, np.ndarray]:
    """Return {law: which rows violate it}."""
    values, slopes = map(np.asarray, run(rows, layers))
    unit, few = rounding(rows, values, slopes, layers), 16 * np.finfo(rows.dtype).eps
    reflected, passed, (psi, delta) = values[:, :2], values[:, 2:4], values[:, 4:6].T
    lossless = np.all(rows[:, 2 * layers : 3 * layers] == 0, axis=1) & (rows[:, -4] == 0)
    normal = rows[:, -2] == 0
    total = reflected + passed
    sums = values[:, 6:10].T
    # two samples side by side, both on the detector
    mixed = purity(sums + sums[:, ::-1])
    return {
        "value not finite": ~np.all(np.isfinite(values), axis=1),
        "derivative not finite": ~np.all(np.isfinite(slopes[:, :10]), axis=(1, 2)),
        "R or T below 0": np.any((reflected < 0) | (passed < 0), axis=1),
        "R + T above 1": np.any(total > 1 + unit, axis=1),
        "energy lost where nothing absorbs": lossless & np.any(np.abs(total - 1) > unit, axis=1),
        "s unlike p at normal incidence": normal & (np.abs(reflected[:, 0] - reflected[:, 1]) > unit[:, 0]),
        "angles out of range": ~((psi >= 0) & (psi <= 90.0001) & (delta >= 0) & (delta < 360)),
        "N, C, S off the sphere": np.abs(purity(sums) - 1) > few,
        "N, C, S of a mixture outside the sphere": mixed > 1 + few,
    }


def main(total: int) -> int:
    worst, rng = 0, np.random.default_rng(0)
    shapes = (1, 2, 4, 8)
    chunks = max(1, total // (2 * len(shapes) * CHUNK))
    for dtype in (np.float64, np.float32):
        for layers in shapes:
            began, counts, example = time.perf_counter(), {}, {}
            for _ in range(chunks):
                rows = scenes(rng, CHUNK, layers).astype(dtype)
                for law, bad in violations(rows, layers).items():
                    counts[law] = counts.get(law, 0) + int(bad.sum())
                    if bad.any():
                        example.setdefault(law, rows[bad][0].tolist())
            name = "one film" if layers == 1 else f"{layers} layers"
            print(f"{dtype.__name__}, {name}: {chunks * CHUNK} in {time.perf_counter() - began:.0f} s")
            for law, count in counts.items():
                if count:
                    print(f"  {law}: {count}, such as {example[law]}")
            worst += sum(counts.values())
            sys.stdout.flush()
    return int(worst > 0)


if __name__ == "__main__":
    jax.config.update("jax_enable_x64", True)
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", type=int, default=1_000_000)
    sys.exit(main(parser.parse_args().scenes))
