"""R and T of graded films by one package, and its time per point: films as JSON on stdin, answers on stdout.

Started by `graded.py` with the Python of the packages' environment; needs nothing else of this repository.
The slices are homogeneous, with the index in the middle of each.
"""

import json
import os
import sys
import time
import warnings

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

REPEATS = 20


def by_tmm(film, wavelengths):
    import tmm

    n = [film["ambient"], *film["index"], film["substrate"]]
    depths = [np.inf, *film["depths"], np.inf]
    found = np.empty((4, len(wavelengths)))
    for i, nm in enumerate(wavelengths):
        s, p = (tmm.coh_tmm(x, n, depths, np.deg2rad(film["angle"]), nm) for x in "sp")
        found[:, i] = s["R"], p["R"], s["T"], p["T"]
    return found


def by_pyelli(film, wavelengths):
    import elli

    def medium(n):
        return elli.IsotropicMaterial(elli.ConstantRefractiveIndex(n=n))

    layers = [elli.Layer(medium(n), d) for n, d in zip(film["index"], film["depths"], strict=True)]
    structure = elli.Structure(medium(film["ambient"]), layers, medium(film["substrate"]))
    found = structure.evaluate(wavelengths, film["angle"], solver=elli.Solver2x2)
    return np.array([found.R_ss, found.R_pp, found.T_ss, found.T_pp]).real


def by_difftmm(film, wavelengths):
    """R alone, for it returns amplitudes; from n − ik, with the layers from the substrate up."""
    import torch
    from difftmm import create_jones_matrix_isotropic

    torch.set_num_threads(1)
    row = lambda x, dtype: torch.tensor([x], dtype=dtype)  # noqa: E731
    *_, rs, rp = create_jones_matrix_isotropic(
        row([n.conjugate() for n in film["index"][::-1]], torch.complex64),
        row([1e-3 * d for d in film["depths"][::-1]], torch.float32),
        row([1e-3 * float(nm) for nm in wavelengths], torch.float32),
        film["ambient"],
        complex(film["substrate"]).conjugate(),
        row([float(np.deg2rad(film["angle"]))], torch.float32),
    )
    R = [(r.abs() ** 2).reshape(-1).numpy() for r in (rs, rp)]
    return np.array([*R, *np.full((2, len(wavelengths)), np.nan)])


def main(name):
    """Print, for each film, [R_s, R_p, T_s, T_p] at its wavelength, then µs per point of the last film."""
    warnings.simplefilter("ignore")
    compute = {"tmm": by_tmm, "pyelli": by_pyelli, "difftmm": by_difftmm}[name]
    given = json.load(sys.stdin)
    for film in given["films"]:
        film["index"] = [complex(*n) for n in film["index"]]
        film["substrate"] = complex(*film["substrate"])
    values = [compute(film, np.array([film["wavelength"]]))[:, 0].tolist() for film in given["films"]]
    # one wavelength more costs tmm as much as the first
    wavelengths, least = np.linspace(500.0, 600.0, 8 if name == "tmm" else 400), np.inf
    for _ in range(5 if name == "tmm" else REPEATS):
        start = time.process_time()
        compute(given["films"][0], wavelengths)
        least = min(least, time.process_time() - start)
    json.dump({"values": values, "microseconds": 1e6 * least / len(wavelengths)}, sys.stdout)


if __name__ == "__main__":
    main(sys.argv[1])
