"""Writing of BRDF samples as CSV or ALTA text."""

from __future__ import annotations

import os
from collections.abc import Sequence
from importlib.metadata import version

import numpy as np

from pellicle.data.brdf_samples import BrdfSamples, sigma_names
from pellicle.data.tabular.columns import DIRECTIONS
from pellicle.files import write_text

Path = str | os.PathLike[str]


def write_brdf_samples(
    path: Path, samples: BrdfSamples, *, comments: Sequence[str] = (), overwrite: bool = False
) -> None:
    """Write samples as CSV, which `read_brdf_samples` reads back unchanged.

    `comments` are lines of the header. Raises UsageError where `path` exists without `overwrite`, or cannot
    be written.
    """
    names = [*DIRECTIONS, *samples.channels]
    names += [] if samples.sigma is None else sigma_names(samples.channels)
    header = [
        "# BRDF in 1/sr; directions in degrees, from the normal and around it",
        *(f"# {line}" for line in comments),
        *_source(samples),
        ",".join(names),
    ]
    directions = [getattr(samples, name) for name in DIRECTIONS]
    write_text(path, _text(header, directions, samples, ","), overwrite=overwrite)


def write_alta(path: Path, samples: BrdfSamples, *, overwrite: bool = False) -> None:
    """Write samples as ALTA text: spherical coordinates in radians, sigma as the radius of intervals.

    Raises UsageError where `path` exists without `overwrite`, or cannot be written.
    """
    count = len(samples.channels)
    header = [
        *_source(samples),
        f"#DIM 4 {count}",
        "#PARAM_IN SPHERICAL_TL_PL_TV_PV",
        f"#PARAM_OUT {'INV_STERADIAN' if count == 1 else 'RGB_COLOR'}",
    ]
    if samples.sigma is not None:
        header.append("#VS" + " 1" * count)
    directions = [np.deg2rad(getattr(samples, name)) for name in DIRECTIONS]
    write_text(path, _text(header, directions, samples, "\t"), overwrite=overwrite)


def _source(samples: BrdfSamples) -> list[str]:
    """Comments; the blank after # keeps ALTA from reading them as a header."""
    path = " ".join(samples.path.split()) or "samples"
    return [
        f"# from {path}, sha256 {samples.sha256 or 'unknown'}",
        f"# written by pellicle {version('pellicle')}",
    ]


def _text(
    header: Sequence[str], directions: Sequence[np.ndarray], samples: BrdfSamples, delimiter: str
) -> str:
    """Header and rows, each number with the digits that reproduce it exactly."""
    sigma = [] if samples.sigma is None else [samples.sigma]
    table = np.column_stack([*directions, samples.values, *sigma])
    rows = (delimiter.join(map(repr, row)) for row in table.tolist())
    return "\n".join([*header, *rows]) + "\n"
