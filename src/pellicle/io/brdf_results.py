"""A fit of a BRDF as a folder of files."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pellicle import __version__
from pellicle.io.atomic import MARKER, new_folder, write_text
from pellicle.io.columns import DIRECTIONS
from pellicle.io.records import brdf_to_json as brdf_to_json
from pellicle.io.records import indented

if TYPE_CHECKING:
    from pellicle.brdf_fitting.result import BrdfFit


def write_brdf_fit(folder: str | os.PathLike[str], fit: BrdfFit) -> Path:
    """Write report.txt, result.json, fit.csv and figure.png into a folder, each whole or not at all.

    Raises UsageError where it holds anything that pellicle did not write, or cannot be written.
    """
    from pellicle.report.brdf import brdf_report
    from pellicle.report.brdf_figure import brdf_figure

    target = new_folder(folder)
    write_text(target / MARKER, indented(brdf_to_json(fit)), overwrite=True)
    write_text(target / "report.txt", brdf_report(fit), overwrite=True)
    write_text(target / "fit.csv", brdf_csv(fit), overwrite=True)
    brdf_figure(fit, target / "figure.png", overwrite=True)
    return target


def brdf_csv(fit: BrdfFit) -> str:
    """Every sample with its model: pellicle reads the data again as they were."""
    samples, names = fit.samples, fit.samples.channels
    header = [
        f"# BRDF in 1/sr, directions in degrees; model_{names[0]} and so on: {fit.surface.model} as fitted",
        f"# from {' '.join(samples.path.split()) or 'samples'}, sha256 {samples.sha256 or 'unknown'}",
        f"# written by pellicle {__version__}",
        ",".join([*DIRECTIONS, *names, *(f"model_{name}" for name in names)]),
    ]
    columns = [*(getattr(samples, name) for name in DIRECTIONS), samples.values, fit.model]
    rows = (",".join(f"{x:.8g}" for x in row) for row in np.column_stack(columns))
    return "\n".join([*header, *rows]) + "\n"
