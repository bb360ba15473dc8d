"""Time of reading a table of a million rows, beside `pandas.read_csv` on the same file."""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

import numpy as np
import pandas as pd

from pellicle.data.read_spectrum import read_spectrum

ROWS, ROUNDS = 10**6, 7


def main() -> None:
    """Print the median processor time of both, read in turn, and their ratio."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "spectrum.csv"
        nm = np.linspace(200, 2000, ROWS)
        rows = (f"{a:.6f},{b:.8f}\n" for a, b in zip(nm, 0.3 + 0.1 * np.sin(nm / 10), strict=True))
        path.write_text("wavelength_nm,R\n" + "".join(rows))
        seconds: dict[str, list[float]] = {"pandas.read_csv": [], "read_spectrum": []}
        for _ in range(ROUNDS):
            for name, read in (("pandas.read_csv", pd.read_csv), ("read_spectrum", read_spectrum)):
                start = time.process_time()
                read(path)
                seconds[name].append(time.process_time() - start)
    medians = {name: float(np.median(each)) for name, each in seconds.items()}
    for name, median in medians.items():
        print(f"{name:16} {1e3 * median:6.0f} ms")
    print(f"ratio {medians['read_spectrum'] / medians['pandas.read_csv']:.2f}")


if __name__ == "__main__":
    main()
