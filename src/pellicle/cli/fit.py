"""`pellicle fit`: fits of measured spectra, colours and BRDF samples."""

from __future__ import annotations

from typing import Annotated

from cyclopts import Parameter

from pellicle.cli.batch import Batch, Sampler
from pellicle.cli.flags import OUTPUT, SAMPLER, SCENE, ReadingFlags, SceneFlags, flag, switch
from pellicle.cli.inputs import inputs
from pellicle.cli.session import not_negative, start
from pellicle.errors import UsageError


def fit(
    *data: Annotated[str, Parameter(help="Files to fit, one by one.")],
    recipe: Annotated[str | None, flag(SCENE, "TOML file that describes the scene or surface.")] = None,
    scene: Annotated[SceneFlags | None, Parameter(name="*")] = None,
    reading: Annotated[ReadingFlags | None, Parameter(name="*")] = None,
    joint: Annotated[bool, switch(SCENE, "Fit all files together: they are of one sample.")] = False,
    repeats: Annotated[
        bool, switch(SCENE, "Compare all files: they are repeated measurements of one spot.")
    ] = False,
    tolerance: Annotated[
        float, flag(SCENE, "Leave out effects that change the signal by less than this (0: none).")
    ] = 0.0,
    posterior: Annotated[bool, switch(SAMPLER, "Sample the posterior too, as pellicle sample does.")] = False,
    out: Annotated[str | None, flag(OUTPUT, "Folder for report, figure and tables.")] = None,
    json: Annotated[bool, switch(OUTPUT, "Print one JSON object a line.")] = False,
    jobs: Annotated[int, flag(OUTPUT, "Number of processes that share several files (1).")] = 1,
    refit: Annotated[
        bool, switch(OUTPUT, "Fit all files, also those whose results an earlier run left in --out.")
    ] = False,
) -> int:
    """Fit a layer to measured reflectance, transmittance, ellipsometry, colours or BRDF samples.

    Example: pellicle fit oxide.csv --layer SiO2 --substrate Si --thickness 10:3000
    """
    not_negative("--tolerance", tolerance)
    if jobs < 1:
        raise UsageError(f"--jobs must be at least 1, got {jobs}")
    files = inputs(list(data), recipe, scene or SceneFlags(), reading or ReadingFlags(), joint, repeats)
    start()
    return Batch(files, tolerance, Sampler() if posterior else None, out, json, jobs, refit).run()
