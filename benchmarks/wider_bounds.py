"""Best fits within wider bounds: `python benchmarks/wider_bounds.py [NAME...]`.

Widening a bound must never worsen the best fit. Every kept fit of a film (`fits/`, `measurements/recipes`,
`docs/examples`), and thick films seen through wide slits and uneven spots, simulated by the independent model
of `benchmarks/verdicts`, are fitted within their own bounds, and with all bounds 4 and 20 times as wide. It
prints the rms of the residuals (χ² where the noise is known) of each, and ends with exit code 1 where that of
the wider bounds is larger by more than 0.2 %.
"""

from __future__ import annotations

import argparse
import json
import re
import shutil
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import chdir, redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent / "verdicts"))

from family import spectrum_view
from measurement import Conditions, Stack, seen
from media import catalogued, cauchy

from pellicle.cli.fit import fit
from pellicle.cli.flags import BatchFlags
from pellicle.cli.simulate import SimulationFlags, simulate

ROOT = Path(__file__).resolve().parents[1]
FACTORS = (1, 4, 20)
WORSE = 1.002
BOUNDS = re.compile(r"lower = ([-+.\deE_]+), upper = ([-+.\deE_]+)")
PHYSICAL = {"fraction": (0, 1), "top": (0, 1), "bottom": (0, 1), "back_collected": (0, 1), "axis": (0, 90)}
"""Bounds that cannot be widened beyond these."""
MEASURED = 'signal = "R"\n\n[scene]\nsubstrate = "Si"\n\n[[scene.layer]]\nmaterial = '
POLYMER = '{ model = "cauchy", A = 1.395, B = 4300.0 }\n'
WIDTHS = {
    # thickness (nm), spread (nm), window (nm), and the bounds of the instrument's numbers
    "polymer, slit 0 to 5 nm": (13700.0, 0.0, 2.2, "bandwidth = { lower = 0, upper = 5 }"),
    "polymer, uneven": (13700.0, 25.0, 0.0, "thickness_spread = { lower = 0, upper = 30 }"),
    "thin polymer, uneven": (2400.0, 60.0, 0.0, "thickness_spread = { lower = 0, upper = 100 }"),
    "polymer, slit and spread": (
        9200.0,
        15.0,
        3.0,
        "bandwidth = { lower = 0, upper = 6 }\nthickness_spread = { lower = 0, upper = 30 }",
    ),
    "polymer, wide slit": (6100.0, 0.0, 9.0, "bandwidth = { lower = 0, upper = 12 }"),
}


def widened(recipe: str, factor: float) -> str:
    """The recipe with bounds `factor` times as wide, within what is physical."""

    def wider(line: str) -> str:
        least, most = next((ends for key, ends in PHYSICAL.items() if key in line), (-np.inf, np.inf))

        def of(match: re.Match) -> str:
            low, high = float(match[1]), float(match[2])
            more = (factor - 1) * (high - low)
            floor = 1.0 if re.search(r"\b(n|A) = \{[^}]*$", line[: match.start()]) and low >= 1 else 0.0
            new = max(low - more / 2, floor if low >= 0 else -np.inf, least)
            # what the lower end cannot give the upper end has
            return f"lower = {new:.10g}, upper = {min(high + more - (low - new), most):.10g}"

        return BOUNDS.sub(of, line)

    return "\n".join(wider(line) for line in recipe.splitlines()) + "\n"


def cases(folder: Path) -> Iterator[tuple[str, Path]]:
    """Name and recipe of each case, in copies of the repository's folders below `folder`."""
    for name in ("fits", "measurements", "docs/examples"):
        shutil.copytree(ROOT / name, folder / name)
    simulated = folder / "simulated"
    simulated.mkdir()
    view = spectrum_view("R", 450, 950, 1001)
    for seed, (name, (depth, spread, window, instrument)) in enumerate(WIDTHS.items()):
        stack = Stack(((cauchy(1.395, 4300.0), depth),), catalogued("Si"))
        values = seen(stack, Conditions(spread=spread), window, view)
        values = values + 2e-3 * np.random.default_rng(seed).normal(size=values.shape)
        path = simulated / f"{name}.toml"
        np.savetxt(path.with_suffix(".csv"), np.column_stack([view.wavelength, values]), delimiter=",")
        bounds = f"thickness = {{ lower = {0.5 * depth:g}, upper = {1.5 * depth:g} }}\n"
        files = f'[data]\nfiles = ["{name}.csv"]\n'
        path.write_text(f"{files}{MEASURED}{POLYMER}{bounds}\n[instrument]\n{instrument}\n")
        yield name, path
    for path in sorted([*folder.glob("fits/[!b]*/*.toml"), *folder.glob("fits/brush*/*.toml")]):
        yield f"fits/{path.parent.name}", path
    for path in sorted(folder.glob("measurements/recipes/*.toml")):
        yield f"measurements/{path.stem}", path
    for path in sorted(folder.glob("docs/examples/*.toml")):
        yield f"docs/{path.stem}", path


def best(recipe: Path, factor: float, known: str) -> tuple[float, float, str]:
    """χ² or rms of the best fit within bounds of this factor, its thickness, and its status."""
    own = recipe.with_name(f"{recipe.stem}-{factor:g}.toml")
    own.write_text(widened(recipe.read_text(encoding="utf-8"), factor), encoding="utf-8")
    out, said = recipe.parent / f"{recipe.stem}-{factor:g}", StringIO()
    with chdir(recipe.parent), redirect_stdout(StringIO()), redirect_stderr(said):
        code = fit(*([known] if known else []), recipe=own.name, results=BatchFlags(out=str(out)))
    if code not in (0, 4):
        raise ValueError(said.getvalue().strip().rpartition("\n")[2])
    result = json.loads(next(iter(out.glob("**/result.json"))).read_text(encoding="utf-8"))
    chi2 = result["chi2_reduced"]
    depths = [p["value"] for name, p in result["parameters"].items() if name.endswith("thickness")]
    size = chi2 if abs(chi2 - 1) > 1e-9 else result["rms"]
    return size, depths[0], result["status"]


def data_of(recipe: Path) -> str:
    """Data that a recipe without files gets, simulated with noise; empty for one with files, or none."""
    text = recipe.read_text(encoding="utf-8")
    if re.search(r"^files? =|^path =|\[data.file\]", text, re.M):
        return ""
    data = recipe.with_name(f"{recipe.stem}-data.csv")
    with chdir(recipe.parent), redirect_stdout(StringIO()), redirect_stderr(StringIO()):
        simulate(recipe.name, out=data.name, how=SimulationFlags(noise="0.002", seed=1))
    return data.name


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("name", nargs="*", help="cases whose names contain one of these (all)")
    asked, worse = parser.parse_args(), 0
    with tempfile.TemporaryDirectory() as folder:
        for name, recipe in cases(Path(folder)):
            if asked.name and not any(part in name for part in asked.name):
                continue
            began, line = time.perf_counter(), f"{name:40}"
            try:
                known = data_of(recipe)
                found = [best(recipe, factor, known) for factor in FACTORS]
            except ValueError as error:
                print(f"{line} not fitted: {error}", flush=True)
                continue
            sizes = [size for size, _, _ in found]
            wrong = [size > WORSE * sizes[0] for size in sizes[1:]]
            worse += sum(wrong)
            words = "  ".join(f"{size:9.4g} ({depth:.6g} nm, {status})" for size, depth, status in found)
            seconds = f"{time.perf_counter() - began:4.0f} s"
            print(f"{line} {words}  {seconds} {'WORSE' if any(wrong) else ''}", flush=True)
    print(f"widened bounds worsen {worse} best fits")
    return int(worse > 0)


if __name__ == "__main__":
    sys.exit(main())
