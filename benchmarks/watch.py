"""Time from a closed file to its line of `pellicle watch`, warm.

Run `python benchmarks/watch.py`. A writer closes a file every 0.3 s; the first ten are not counted, and pages
are not served. Every other file is renamed into the folder.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import pellicle as pl

FILMS = {
    "R, 400 points": ("R", "1.46", 400),
    "R, 2000 points": ("R", "1.46", 2000),
    "R, index free": ("R", '{ model = "constant", n = { lower = 1.4, upper = 1.5 } }', 400),
    "psi, delta, 400 points": ("psi-delta", "1.46", 400),
}
"""Signal, material of the layer, and wavelengths, by name."""
COUNT, FIRST, PAUSE = 50, 10, 0.3
"""Files, those that are not counted, and seconds between them."""


def recipe(signal: str, material: str) -> str:
    """A recipe of a layer of this material."""
    angle = "angle = 70\n" if signal == "psi-delta" else ""
    layer = f"[[scene.layer]]\nmaterial = {material}\nthickness = {{ lower = 0, upper = 3000 }}\n"
    return f'[data]\nsignal = "{signal}"\n{angle}[scene]\nsubstrate = 3.9\n{layer}'


def content(signal: str, points: int, thickness: float, random: np.random.Generator) -> str:
    """The text of a file."""
    nm = np.linspace(400.0, 800.0, points)
    if signal == "R":
        columns = [np.asarray(pl.reflectance(nm, thickness, 1.46, 3.9))]
    else:
        psi, delta = pl.ellipsometry(nm, thickness, 1.46, 3.9, angle=70.0)
        columns = [np.asarray(psi), np.asarray(delta) % 360]
    size = 0.003 if signal == "R" else 0.05
    columns = [x + size * random.standard_normal(points) for x in columns]
    head = "wavelength_nm," + ("R" if signal == "R" else "psi_deg,delta_deg")
    rows = "\n".join(",".join(f"{x:.5f}" for x in row) for row in zip(nm, *columns, strict=True))
    return f"{head}\n{rows}\n"


def latencies(signal: str, material: str, points: int, page: bool) -> list[float]:
    """Seconds from each closed file to its line."""
    random, seconds = np.random.default_rng(0), []
    with tempfile.TemporaryDirectory() as folder:
        data = Path(folder) / "data"
        data.mkdir()
        film = Path(folder) / "film.toml"
        film.write_text(recipe(signal, material))
        words = ["watch", str(data), "--recipe", str(film), "--out", f"{folder}/out", "--json"]
        words += ["--idle", "120"] + ([] if page else ["--no-page"])
        program = [sys.executable, "-m", "pellicle", *words]
        with subprocess.Popen(program, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as run:
            assert run.stdout is not None
            for i in range(COUNT):
                text, path = content(signal, points, 100.0 + 7 * i, random), data / f"film_{i:03d}s.csv"
                draft = data / f".{path.name}" if i % 2 else path
                draft.write_text(text)
                if draft != path:
                    os.replace(draft, path)
                closed = time.perf_counter()
                record = json.loads(run.stdout.readline())
                seconds.append(time.perf_counter() - closed)
                assert "error" not in record, record
                time.sleep(PAUSE)
            run.terminate()
    return seconds[FIRST:]


def main() -> None:
    """Print a row for each kind of film."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--page", action="store_true", help="serve the page, too")
    page = parser.parse_args().page
    print(f"{'film':24}  median ms  95 % ms  most ms")
    for name, about in FILMS.items():
        seconds = 1e3 * np.array(latencies(*about, page))
        print(
            f"{name:24}  {np.median(seconds):9.1f}  {np.percentile(seconds, 95):7.1f}  {seconds.max():7.1f}"
        )


if __name__ == "__main__":
    main()
