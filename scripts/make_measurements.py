"""Write the synthetic spectra of `measurements/` from their recipes, and their index.

Rows of the index for measured files, and for files computed by other programs, are kept.

Run `python scripts/make_measurements.py FOLDER` (default: measurements). Existing files are not
overwritten: remove a file to write it again.
"""

from __future__ import annotations

import csv
import io
import sys
import tomllib
from pathlib import Path

from pellicle.cli.simulate import SimulationFlags, simulate
from pellicle.files import write_text

ROOT = Path(__file__).resolve().parents[1]
COLUMNS = ("file", "kind", "recipe", "seed", "truth", "sample", "source", "licence")


def main(folder: Path) -> None:
    """Simulate one spectrum per recipe; the seed is its position in alphabetical order, from 1."""
    rows: list[tuple[str, ...]] = []
    for seed, recipe in enumerate(sorted((ROOT / "measurements" / "recipes").glob("*.toml")), start=1):
        target = folder / f"{recipe.stem}.csv"
        if not target.exists():
            simulate(str(recipe), out=str(target), how=SimulationFlags(seed=seed))
        rows.append(_row(recipe, target, seed))
    rows += _other_rows(folder / "INDEX.csv")
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerows([COLUMNS, *rows])
    write_text(folder / "INDEX.csv", text.getvalue(), overwrite=True)


def _other_rows(index: Path) -> list[tuple[str, ...]]:
    """Return the rows of files that this script does not write."""
    if not index.exists():
        return []
    with index.open(encoding="utf-8", newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["kind"] != "synthetic"]
    return [tuple(row[name] for name in COLUMNS) for row in rows]


def _row(recipe: Path, target: Path, seed: int) -> tuple[str, ...]:
    text = recipe.read_text(encoding="utf-8")
    (layer,) = tomllib.loads(text)["scene"]["layer"]
    about = text.splitlines()[0].lstrip("# ")
    truth = f"thickness {layer['thickness']['value']} nm"
    return (
        target.name,
        "synthetic",
        f"recipes/{recipe.name}",
        str(seed),
        truth,
        about,
        "pellicle simulate",
        "MIT",
    )


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "measurements")
