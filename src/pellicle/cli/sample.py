"""`pellicle sample`: the posterior of what a fit leaves open."""

from __future__ import annotations

from typing import Annotated

from cyclopts import Parameter

from pellicle.cli import fit_brdf
from pellicle.cli.batch import Batch, Sampler
from pellicle.cli.flags import OUTPUT, SAMPLER, SCENE, ReadWords, SceneWords, flag, switch
from pellicle.cli.inputs import described_by, groups
from pellicle.cli.session import not_negative, start
from pellicle.errors import UsageError


def sample(
    *data: Annotated[str, Parameter(help="Files to fit and sample, one by one.")],
    recipe: Annotated[str | None, flag(SCENE, "A TOML file that describes the scene.")] = None,
    words: Annotated[SceneWords | None, Parameter(name="*")] = None,
    reading: Annotated[ReadWords | None, Parameter(name="*")] = None,
    joint: Annotated[bool, switch(SCENE, "All files are of one sample: one posterior for all.")] = False,
    tolerance: Annotated[
        float, flag(SCENE, "Leave out effects that change the signal by less than this; 0 leaves none out.")
    ] = 0.0,
    walkers: Annotated[
        int | None, flag(SAMPLER, "How many walkers, an even number (four a parameter, at least 32).")
    ] = None,
    steps: Annotated[
        int | None, flag(SAMPLER, "Steps after which a chain that does not settle is given up (20000).")
    ] = None,
    seed: Annotated[int, flag(SAMPLER, "Seed of the random numbers.")] = 0,
    out: Annotated[
        str | None,
        flag(OUTPUT, "A folder for report, figures and chain; one cut short is taken up again."),
    ] = None,
    json: Annotated[bool, switch(OUTPUT, "One JSON object a line.")] = False,
) -> int:
    """Fit, then sample the posterior of every free parameter, from every minimum that matters.

    Example: pellicle sample oxide.csv --layer SiO2 --substrate Si --free n --out results/oxide
    """
    words, reading = words or SceneWords(), reading or ReadWords()
    not_negative("--tolerance", tolerance)
    if steps is not None and steps < FEWEST_STEPS:
        raise UsageError(f"--steps must be at least {FEWEST_STEPS}, got {steps}")
    if not 0 <= seed < 2**32:
        raise UsageError(f"--seed must lie in 0 to 4294967295, got {seed}")
    sampler = Sampler(walkers, steps, seed)
    from pellicle.recipes.surface import SurfaceRecipe

    described = described_by(recipe, reading.signal)
    if isinstance(described, SurfaceRecipe):
        given = fit_brdf.of_films(words, joint, tolerance)
        return fit_brdf.fit_surface(list(data), described, given, reading, out, json, sampler)
    found, together = groups(list(data), described, words, reading, joint)
    start()
    return Batch(out, json, together, tolerance, sampler)(found)


FEWEST_STEPS = 10
