"""Write the table of cinnabar (HgS), whose index and absorption edge are modelled, not measured.

No n and k of HgS below 620 nm have been published under a free licence. Known are the
ordinary index above 620 nm (Bond 1967, as Bhar's formula) and the cause of the colour, an absorption
edge near 2.05 eV. The model is one Tauc-Lorentz band (Jellison and Modine, Appl. Phys. Lett. 69,
371 (1996)) that begins at this edge and whose real part, by the Kramers-Kronig relation, reproduces
Bond's index: its height, its centre and the constant ε∞ are fitted to 620-2500 nm; its width, which
the index does not determine, is set to 1 eV. Run: python scripts/make_hgs_model.py
"""

import csv
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

TARGET = Path(__file__).parents[1] / "src/pellicle/materials/data/model/HgS.csv"
EV_NM = 1239.841984
EDGE_EV, WIDTH_EV = 2.05, 1.0
STEP_EV = 0.002
# midpoints, so that the singular point of the principal value lies between two of them
GRID_EV = np.arange(EDGE_EV + STEP_EV / 2, 20.0, STEP_EV)


def absorption(energy, height, centre):
    """Return Im ε of the Tauc-Lorentz band at energies in eV."""
    band = height * centre * WIDTH_EV * (energy - EDGE_EV) ** 2
    shape = (energy**2 - centre**2) ** 2 + (WIDTH_EV * energy) ** 2
    return np.where(energy > EDGE_EV, band / shape / energy, 0.0)


def permittivity(energy, height, centre, constant):
    """Return Re ε by Kramers-Kronig; the value at the singular point is subtracted from the integrand."""
    here = absorption(energy, height, centre)[:, None]
    there = absorption(GRID_EV, height, centre)
    far, near = GRID_EV[-1] + STEP_EV / 2, EDGE_EV
    x = energy[:, None]
    regular = np.sum((GRID_EV * there - x * here) / (GRID_EV**2 - x**2), axis=1) * STEP_EV
    # ∫ x dE / (E² − x²) from `near` to `far`, principal value
    rest = 0.5 * (np.log((far - energy) / (far + energy)) - np.log(np.abs(near - energy) / (near + energy)))
    tail = np.where(here[:, 0] > 0, here[:, 0] * rest, 0.0)
    return constant + 2 / np.pi * (regular + tail)


def bond_squared(nm):
    """Return n² of the ordinary ray: refractiveindex.info main/HgS/Bond-o, formula 2."""
    square = (nm / 1000) ** 2
    return 1 + 3.1506 + 2.7896 * square / (square - 0.1328) + 1.1378 * square / (square - 705)


def lattice(nm):
    """Return the infrared term of the same formula, which the band does not include."""
    square = (nm / 1000) ** 2
    return 1.1378 * square / (square - 705)


def main():
    nm = np.linspace(620, 2500, 200)

    def misfit(p):
        return permittivity(EV_NM / nm, *p) + lattice(nm) - bond_squared(nm)

    fit = least_squares(misfit, [60.0, 3.3, 4.0])
    print("height eV, centre eV, ε∞:", fit.x, "worst n²:", np.abs(fit.fun).max())
    at = np.concatenate([np.arange(350, 620, 2.5), np.arange(620, 1000, 10), np.arange(1000, 2501, 50)])
    energy = EV_NM / at
    epsilon = permittivity(energy, *fit.x) + lattice(at) + 1j * absorption(energy, *fit.x[:2])
    index = np.sqrt(epsilon)
    TARGET.parent.mkdir(exist_ok=True)
    with TARGET.open("w", newline="") as file:
        file.write("# model, not measured: scripts/make_hgs_model.py\n")
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["wavelength_nm", "n", "k"])
        writer.writerows((f"{w:g}", f"{z.real:.5f}", f"{z.imag:.5f}") for w, z in zip(at, index, strict=True))


if __name__ == "__main__":
    main()
