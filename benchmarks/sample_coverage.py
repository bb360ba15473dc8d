"""Coverage of the errors of samples with a shared index: `benchmarks/sample_coverage.py [--draws 40]`.

Cauchy films (A 1.7, B 8000 nm²), R by a recursion of Fresnel coefficients in NumPy. Each draw has noise of
0.003 and all effects of `pl.Uncertainty` at its sizes: of each file shift, bandwidth, scale and offset; of
each sample native oxide, roughness, overlayer and thickness spread; of all the index of the substrate and the
dispersion of the film. Prints z, (value - truth) / stderr, and the share of |z| below 1.96.
"""

import argparse

import numpy as np

import pellicle as pl
from pellicle.dispersion import Cauchy

NM = np.linspace(400.0, 900.0, 61)
A, B, NOISE = 1.7, 8e3, 0.003
CASES = {
    "480, 120, 950 nm on Si": ((480.0, 120.0, 950.0), ("Si", "Si", "Si")),
    "480, 700 nm on Si, 120 nm on BK7": ((480.0, 120.0, 700.0), ("Si", "BK7", "Si")),
    "60, 150, 300 nm on Si": ((60.0, 150.0, 300.0), ("Si", "Si", "Si")),
}


def reflectance(nm, media, depths, spread, uneven):
    """R at normal incidence; the layer `uneven` has a normal spread of its thickness (nm)."""

    def of(depths):
        result = 0.0
        for j in range(len(media) - 2, -1, -1):
            face = (media[j] - media[j + 1]) / (media[j] + media[j + 1])
            if j == len(media) - 2:
                result = face
                continue
            below = result * np.exp(4j * np.pi / nm * media[j + 1] * depths[j])
            result = (face + below) / (1 + face * below)
        return np.abs(result) ** 2

    nodes, weights = np.polynomial.hermite_e.hermegauss(15)
    every = [[max(d + x * spread, 0) if i == uneven else d for i, d in enumerate(depths)] for x in nodes]
    return sum(w * of(own) for w, own in zip(weights / weights.sum(), every, strict=True))


def rough(above, below):
    """Index of a Bruggeman mixture of two halves."""
    one, other = above**2, below**2
    mean = 0.5 * (one + other)
    return np.sqrt((mean + np.sqrt(mean**2 + 8 * one * other)) / 4)


def measured(rng, depth, substrate, of_index, of_shape):
    """R of one film with effects of its own, drawn at the sizes of `pl.Uncertainty`."""
    scale, shift, offset = rng.normal(0, (0.01, 0.01, 0.005)), rng.normal(0, 0.5), rng.normal(0, 0.005)
    bandwidth, oxide, height, over = np.abs(rng.normal(0, (2.0, 1.0, 1.5, 0.5)))
    spread = abs(rng.normal(0, min(0.01 * depth, 12)))

    def at(nm):
        x = 2 * (nm - NM.min()) / np.ptp(NM) - 1
        film = (A + B / nm**2) * (1 + of_shape * (2 * x**2 - 1)) + 0j
        air = np.ones_like(film)
        below = np.asarray(pl.material(substrate)(nm)) * (1 + of_index)
        native = ([1.46 * air], [oxide]) if substrate == "Si" else ([], [])
        media = [air, 1.5 * air, rough(air, film), film, *native[0], below]
        return reflectance(nm, media, [over, 2 * height, depth - height, *native[1]], spread, 2)

    window = np.linspace(-2.5, 2.5, 11)
    weights = np.exp(-(window**2) / 2)
    rows = [w * at(NM + shift + u * bandwidth / 2.3548) for u, w in zip(window, weights, strict=True)]
    x = 2 * (NM - NM.min()) / np.ptp(NM) - 1
    drift = 1 + scale[0] + scale[1] * x + scale[2] * (2 * x**2 - 1)
    values = np.sum(rows, axis=0) / weights.sum() * drift + offset + rng.normal(0, NOISE, NM.size)
    return pl.Spectrum(NM, values, "R", sigma=np.full(NM.size, NOISE), path=f"film{depth:g}.csv")


def main() -> None:
    """Print a row for each number of each case."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--draws", type=int, default=40)
    draws = parser.parse_args().draws
    print("| samples | number | rms z | mean z | within 95 % | median error |\n|---|---|---|---|---|---|")
    for case, (depths, substrates) in CASES.items():
        film = pl.Layer(Cauchy(pl.Free(1.3, 2.2), pl.Free(0, 3e4)), pl.Free(20, 1500), "film")
        scenes = [pl.Scene(film, s, sample=f"d{d:g}") for d, s in zip(depths, substrates, strict=True)]
        truth = {"film.A": A, "film.B": B} | {f"d{d:g}.film.thickness": d for d in depths}
        z, errors = {name: [] for name in truth}, {name: [] for name in truth}
        for draw in range(draws):
            rng = np.random.default_rng([draw, 7000])
            of_index = dict.fromkeys(substrates, 0.0)
            of_index = {name: rng.normal(0, 0.005) for name in of_index}
            of_shape = rng.normal(0, 0.003)
            pairs = zip(depths, substrates, strict=True)
            data = [measured(rng, depth, s, of_index[s], of_shape) for depth, s in pairs]
            fit = pl.fit(data, scenes, shared=["film.A", "film.B"])
            for name, true in truth.items():
                z[name].append((fit[name].value - true) / fit[name].stderr)
                errors[name].append(fit[name].stderr)
        for name, row in z.items():
            own, inside = np.array(row), 100 * np.mean(np.abs(row) < 1.96)
            shown = f"{np.sqrt(np.mean(own**2)):.2f} | {own.mean():+.2f} | {inside:.0f} %"
            print(f"| {case} | {name} | {shown} | {np.median(errors[name]):.2g} |", flush=True)


if __name__ == "__main__":
    main()
