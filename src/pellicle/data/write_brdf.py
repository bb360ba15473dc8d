"""Writing of BRDF samples as CSV."""

from __future__ import annotations

import os
from collections.abc import Sequence
from importlib.metadata import version

import numpy as np

from pellicle.data.brdf_samples import BrdfSamples, sigma_names
from pellicle.data.tabular.columns import DIRECTIONS
from pellicle.files import write_text


def write_brdf_samples(
    path: str | os.PathLike[str],
    samples: BrdfSamples,
    *,
    comments: Sequence[str] = (),
    overwrite: bool = False,
) -> None:
    """Write samples as CSV, which `read_brdf_samples` reads back unchanged.

    `comments` are lines of the header. Raises UsageError where `path` exists without `overwrite`, or cannot
    be written.
    """
    names = [*DIRECTIONS, *samples.channels]
    names += [] if samples.sigma is None else sigma_names(samples.channels)
    source = " ".join(samples.path.split()) or "samples"
    header = [
        "# BRDF in 1/sr; directions in degrees, from the normal and around it",
        *(f"# {line}" for line in comments),
        f"# from {source}, sha256 {samples.sha256 or 'unknown'}",
        f"# written by pellicle {version('pellicle')}",
        ",".join(names),
    ]
    sigma = [] if samples.sigma is None else [samples.sigma]
    columns = [*(getattr(samples, name) for name in DIRECTIONS), samples.values, *sigma]
    # each number with the digits that reproduce it exactly
    rows = (",".join(map(repr, row)) for row in np.column_stack(columns).tolist())
    write_text(path, "\n".join([*header, *rows, ""]), overwrite=overwrite)
