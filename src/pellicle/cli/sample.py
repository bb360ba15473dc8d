"""`pellicle sample`: posterior samples of the free parameters."""

from __future__ import annotations

from typing import Annotated

from cyclopts import Parameter

from pellicle.cli.batch import Batch, Sampler
from pellicle.cli.flags import OUTPUT, SAMPLER, SCENE, ReadingFlags, SceneFlags, flag, switch
from pellicle.cli.inputs import inputs
from pellicle.cli.session import not_negative, start
from pellicle.errors import UsageError

FEWEST_STEPS = 10


def sample(
    *data: Annotated[str, Parameter(help="Files to fit and sample, one by one.")],
    recipe: Annotated[str | None, flag(SCENE, "TOML file that describes the scene or surface.")] = None,
    scene: Annotated[SceneFlags | None, Parameter(name="*")] = None,
    reading: Annotated[ReadingFlags | None, Parameter(name="*")] = None,
    joint: Annotated[bool, switch(SCENE, "One posterior for all files: they are of one sample.")] = False,
    tolerance: Annotated[
        float, flag(SCENE, "Leave out effects that change the signal by less than this (0: none).")
    ] = 0.0,
    walkers: Annotated[
        int | None, flag(SAMPLER, "Number of walkers, even (four per parameter, at least 32).")
    ] = None,
    steps: Annotated[int | None, flag(SAMPLER, "Maximum number of steps (20000).")] = None,
    seed: Annotated[int, flag(SAMPLER, "Seed of the random numbers.")] = 0,
    out: Annotated[
        str | None, flag(OUTPUT, "Folder for report, figures and chain; an interrupted chain is continued.")
    ] = None,
    json: Annotated[bool, switch(OUTPUT, "Print one JSON object a line.")] = False,
    jobs: Annotated[int, flag(OUTPUT, "Number of processes that share several files (1).")] = 1,
    refit: Annotated[
        bool, switch(OUTPUT, "Fit all files, also those whose results an earlier run left in --out.")
    ] = False,
) -> int:
    """Fit, then sample the posterior of every free parameter, starting from every minimum that matters.

    Example: pellicle sample oxide.csv --layer SiO2 --substrate Si --free n --out results/oxide
    """
    not_negative("--tolerance", tolerance)
    if jobs < 1:
        raise UsageError(f"--jobs must be at least 1, got {jobs}")
    if steps is not None and steps < FEWEST_STEPS:
        raise UsageError(f"--steps must be at least {FEWEST_STEPS}, got {steps}")
    if not 0 <= seed < 2**32:
        raise UsageError(f"--seed must lie in 0 to 4294967295, got {seed}")
    files = inputs(list(data), recipe, scene or SceneFlags(), reading or ReadingFlags(), joint, False)
    start()
    return Batch(files, tolerance, Sampler(walkers, steps, seed), out, json, jobs, refit).run()
