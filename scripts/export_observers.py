"""Export the CIE observers and illuminants from colour-science to src/pellicle/colour/data.

Run once: python scripts/export_observers.py (needs colour-science, which the extra `dev` installs).
"""

import csv
from pathlib import Path

import colour
import numpy as np

DATA = Path(__file__).parents[1] / "src/pellicle/colour/data"
OBSERVERS = {"1931": "CIE 1931 2 Degree Standard Observer", "1964": "CIE 1964 10 Degree Standard Observer"}
ILLUMINANTS = ("A", "D50", "D55", "D65", "D75")  # E is constant


def write(name: str, source: str, header: list[str], columns: list[np.ndarray]) -> None:
    with (DATA / name).open("w", encoding="utf-8", newline="") as file:
        file.write(
            f"# {source}, exported from colour-science {colour.__version__} by {Path(__file__).name}\n"
        )
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(header)
        writer.writerows([f"{x:.10g}" for x in row] for row in zip(*columns, strict=True))


def main() -> None:
    functions = [colour.MSDS_CMFS[name] for name in OBSERVERS.values()]
    wavelength = functions[0].wavelengths
    header = ["wavelength_nm", *(f"{axis}_{year}" for year in OBSERVERS for axis in "xyz")]
    columns = [wavelength, *(column for f in functions for column in f.values.T)]
    write("observers.csv", "CIE colour-matching functions", header, columns)
    wavelength = np.arange(360.0, 781.0, 5.0)
    spectra = [colour.SDS_ILLUMINANTS[name][wavelength] for name in ILLUMINANTS]
    source = "Relative spectral power of CIE illuminants"
    write("illuminants.csv", source, ["wavelength_nm", *ILLUMINANTS], [wavelength, *spectra])


if __name__ == "__main__":
    main()
