"""`pellicle fit`: measured spectra in, a report out."""

from __future__ import annotations

from typing import Annotated

from cyclopts import Parameter

from pellicle.cli import fit_brdf
from pellicle.cli.batch import Batch, Sampler
from pellicle.cli.flags import OUTPUT, SAMPLER, SCENE, ReadWords, SceneWords, flag, switch
from pellicle.cli.inputs import described_by, groups
from pellicle.cli.session import not_negative, start


def fit(
    *data: Annotated[str, Parameter(help="Files to fit, one by one.")],
    recipe: Annotated[str | None, flag(SCENE, "A TOML file that describes the scene.")] = None,
    words: Annotated[SceneWords | None, Parameter(name="*")] = None,
    reading: Annotated[ReadWords | None, Parameter(name="*")] = None,
    joint: Annotated[bool, switch(SCENE, "All files are of one sample: fit them together.")] = False,
    tolerance: Annotated[
        float, flag(SCENE, "Leave out effects that change the signal by less than this; 0 leaves none out.")
    ] = 0.0,
    posterior: Annotated[bool, switch(SAMPLER, "Sample the posterior too, as pellicle sample does.")] = False,
    out: Annotated[str | None, flag(OUTPUT, "A folder for report, figure and tables.")] = None,
    json: Annotated[bool, switch(OUTPUT, "One JSON object a line.")] = False,
) -> int:
    """Fit a layer to measured reflectance, transmittance, ellipsometry, or samples of a BRDF.

    Example: pellicle fit oxide.csv --layer SiO2 --substrate Si --thickness 10:3000
    """
    words, reading = words or SceneWords(), reading or ReadWords()
    sampler = Sampler() if posterior else None
    from pellicle.recipes.surface import SurfaceRecipe

    described = described_by(recipe, reading.signal)
    if isinstance(described, SurfaceRecipe):
        given = fit_brdf.of_films(words, joint, tolerance)
        return fit_brdf.fit_surface(list(data), described, given, reading, out, json, sampler)
    not_negative("--tolerance", tolerance)
    found, together = groups(list(data), described, words, reading, joint)
    start()
    return Batch(out, json, together, tolerance, sampler)(found)
