"""Measurements in the repository, fitted and compared with a fit by the tmm package and SciPy."""

from pathlib import Path

import numpy as np
import pytest
import tmm
from scipy.optimize import least_squares

import pellicle as pl
from pellicle.data.read_spectrum import read_spectrum

FOLDER = Path(__file__).parents[1] / "measurements" / "ellipsometry"
OXIDE = 2.0  # nm
WAVELENGTH = 658.0  # nm
BRUSH = pl.dispersion.Cauchy(1.47, 4950.0)


def sphere(psi: np.ndarray, delta: np.ndarray) -> np.ndarray:
    """N, C and S of Ψ and Δ in degrees, which have no wrap-around, (3 · points,)."""
    psi, delta = 2 * np.deg2rad(psi), np.deg2rad(delta)
    return np.concatenate([np.cos(psi), np.sin(psi) * np.cos(delta), np.sin(psi) * np.sin(delta)])


def by_tmm(spectrum: pl.Spectrum) -> float:
    """Thickness (nm) of the brush by the tmm package and SciPy, from the best of many starts."""
    n = [1.0] + [complex(pl.refractive_index(WAVELENGTH, each)) for each in (BRUSH, "SiO2", "Si")]

    def residuals(x: np.ndarray) -> np.ndarray:
        found = [
            tmm.ellips(n, [np.inf, x[0], OXIDE, np.inf], np.deg2rad(angle), WAVELENGTH)
            for angle in spectrum.angle
        ]
        psi = np.rad2deg([each["psi"] for each in found])
        # tmm has the opposite sign of time and of r_p
        delta = 180.0 - np.rad2deg([each["Delta"] for each in found])
        return sphere(psi, delta) - sphere(spectrum.values, spectrum.delta)

    fits = [least_squares(residuals, [start], bounds=([0.0], [300.0])) for start in (5.0, 20.0, 60.0, 150.0)]
    return float(min(fits, key=lambda fit: fit.cost).x[0])


@pytest.mark.parametrize("name", ["15-1-1.dat", "19-1-1.dat"])
def test_polymer_brushes_on_oxidised_silicon(name):
    """Real Ψ and Δ at eight angles: the thickness is that of another program, far within its error."""
    spectrum = read_spectrum(FOLDER / name)
    layers = [pl.Layer(BRUSH, pl.Free(0, 300), name="brush"), pl.Layer("SiO2", OXIDE, name="oxide")]
    fit = pl.fit(spectrum, pl.Scene(layers, "Si"))
    assert fit.status is pl.Status.CONVERGED
    depth = fit["brush.thickness"]
    assert abs(depth.value - by_tmm(spectrum)) < 0.05 * depth.stderr
