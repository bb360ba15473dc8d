"""Measurements and files of other programs, identified, beside what is known of them.

`python benchmarks/identify --real`. Files outside the repository are skipped where they are absent.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import pellicle as pl

ROOT = Path(__file__).resolve().parents[2]
_OTHERS = ROOT.parent / "shared" / "data"
"""Measurements whose licence keeps them out of the repository."""


class File(NamedTuple):
    """A file, what is stated of its sample, and what is known."""

    path: str
    substrate: str
    about: dict[str, str]
    known: str


_PLATE = {"back": "air"}
_WATER = {"ambient": "water"}
FILES = (
    File("regresspro_filmetrics_F20/quartz_reflectance.csv", "Si", {}, "oxide, 752 nm by another program"),
    File("regresspro_filmetrics_F20/quartz_reflectance.csv", "fused silica", {}, "is on silicon"),
    File("regresspro_filmetrics_F20/reflectance.csv", "Si", {}, "unknown, also its substrate"),
    File("regresspro_fsg_oxide_on_si/reflectance.csv", "Si", {}, "fluorinated oxide, 630 nm, n 1.41"),
    File("thinfilmstools_oxides/hafnia_T.csv", "SiO2", _PLATE, "HfO2, 189 to 194 nm"),
    File("thinfilmstools_oxides/scandia_T.csv", "SiO2", _PLATE, "Sc2O3, 91.9 nm"),
    File("thinfilmstools_oxides/scandia2_T.csv", "SiO2", _PLATE, "Sc2O3, 86.3 nm, n 1.96"),
    *(File(f"cds_on_glass_{d}nm.csv", "BK7", {}, f"CdS, {d} nm") for d in (80, 250, 600)),
    File("cds_on_glass_80nm.csv", "BK7", _PLATE, "CdS, 80 nm, no back face"),
    *(File(f"hematite_on_glass_{d}nm.csv", "BK7", {}, f"hematite, {d} nm") for d in (60, 140, 260)),
    File("hematite_on_glass_140nm.csv", "BK7", _PLATE, "hematite, 140 nm, no back face"),
    *(File(f"gold_on_glass_{d}nm.csv", "BK7", _PLATE, f"Au, {d} nm") for d in (12, 35, 70)),
    File("gold_on_glass_300nm.csv", "BK7", {}, "Au, opaque"),
    File("wvase/cauchy_100nm.txt", "Si/Aspnes", {}, "n 1.47 + 4950/λ², 100 nm"),
    File("wvase/oxide_30nm_in_water.txt", "Si/Aspnes", _WATER, "silica, 30 nm"),
    File(
        "wvase/polymer_20nm_on_oxide_2nm_in_water.txt", "Si/Aspnes", _WATER, "wet polymer 20 nm on oxide 2 nm"
    ),
)


def report() -> None:
    """Print a row of a Markdown table for each file."""
    print("| file | stated | answer | known |\n|---|---|---|---|")
    for file in FILES:
        places = [folder / file.path for folder in (ROOT / "measurements", _OTHERS)]
        path = next((x for x in places if x.exists()), None)
        if path is None:
            print(f"{file.path} is absent", flush=True)
            continue
        about: Any = file.about
        found = pl.identify(pl.read_spectrum(path), file.substrate, **about)
        stated = ", ".join([f"on {file.substrate}", *(f"{key} {x}" for key, x in file.about.items())])
        print(f"| {path.name} | {stated} | {found.status}: {_answer(found)} | {file.known} |", flush=True)


def _answer(found: Any) -> str:
    """The best films in words, and the condition under which they are."""
    words = []
    for x in found.hypotheses[:3]:
        layers = [
            f"{' or '.join(layer.like[:2]) or layer.material} {layer.thickness.value:.1f} ±"
            f" {layer.thickness.stderr:.2g} nm, n {layer.n[0]:.2f} to {layer.n[1]:.2f}"
            for layer in x.layers
        ]
        words.append(" on ".join(layers))
    condition = found.hypotheses[0].condition if found.hypotheses else ""
    return "; ".join(words) + (f" (if {condition})" if condition else "")
