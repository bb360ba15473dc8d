"""Make docs/examples/oxide_cube.nc: a simulated cube of an oxide on silicon, a wedge with a step.

Run `python scripts/make_oxide_cube.py`. 40 x 30 pixels of 0.1 mm and 50 bands from 420 to 910 nm, with noise
of 0.005. The oxide is 250 nm thick at the left edge and grows by 40 nm/mm; above y = 1.5 mm it is 60 nm
thicker. A grain of dust reflects half of the light, two pixels are dead, and so is one row. The reflectance
is computed here, by Airy's formula.
"""

from pathlib import Path

import numpy as np
import xarray as xr

import pellicle as pl

CUBE = Path(__file__).parents[1] / "docs" / "examples" / "oxide_cube.nc"
X, Y = np.arange(40) * 0.1, np.arange(30) * 0.1
BANDS = np.arange(420.0, 911.0, 10.0)
NOISE = 0.005


def silica(nm: np.ndarray) -> np.ndarray:
    """Index of fused silica by Malitson 1965, J. Opt. Soc. Am. 55, 1205."""
    um2 = (nm / 1000) ** 2
    terms = ((0.6961663, 0.0684043), (0.4079426, 0.1162414), (0.8974794, 9.896161))
    return np.sqrt(1 + sum(b * um2 / (um2 - c**2) for b, c in terms))


def reflectance(thickness: np.ndarray) -> np.ndarray:
    """Reflectance (..., bands) at normal incidence."""
    film, pair = silica(BANDS), pl.material("Si").index(BANDS)
    silicon = np.asarray(pair.re) + 1j * np.asarray(pair.im)
    upper, lower = (1 - film) / (1 + film), (film - silicon) / (film + silicon)
    turn = np.exp(4j * np.pi * film * thickness[..., None] / BANDS)
    return np.abs((upper + lower * turn) / (1 + upper * lower * turn)) ** 2


def thickness() -> np.ndarray:
    """Thickness (y, x) in nm."""
    return 250 + 40 * X + np.where(Y[:, None] > 1.45, 60.0, 0.0)


def main() -> None:
    """Write the cube."""
    values = reflectance(thickness())
    dust = np.hypot(X - 3.0, Y[:, None] - 0.7) < 0.22
    values[dust] = 0.5
    values += np.random.default_rng(0).normal(0.0, NOISE, values.shape)
    values[[4, 20], [11, 33]] = np.nan
    values[25] = np.nan
    cube = xr.Dataset(
        {"reflectance": (("y", "x", "wavelength"), values, {"units": "1", "long_name": "reflectance"})},
        coords={
            "y": ("y", Y, {"units": "mm"}),
            "x": ("x", X, {"units": "mm"}),
            "wavelength": ("wavelength", BANDS, {"units": "nm"}),
        },
        attrs={"title": "simulated oxide on silicon, a wedge with a step"},
    )
    packed = {"dtype": "int16", "scale_factor": 1e-4, "_FillValue": -32768, "zlib": True, "complevel": 9}
    cube.to_netcdf(CUBE, engine="h5netcdf", encoding={"reflectance": packed})


if __name__ == "__main__":
    main()
