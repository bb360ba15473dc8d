"""`pellicle warm`: compile the programs of fits to come."""

from pathlib import Path
from time import perf_counter
from typing import Annotated

from cyclopts import Parameter

from pellicle.api.recipe_fits import Inputs, measurement
from pellicle.cli.flags import SCENE, FileFlags, FitFlags, SceneFlags, switch
from pellicle.cli.inputs import inputs
from pellicle.cli.messages import Progress, say
from pellicle.cli.session import CACHE_VARIABLE, GOOD, cache_folder, start
from pellicle.errors import UsageError


def warm(
    *data: Annotated[str, Parameter(help="Files like those to come.")],
    recipe: Annotated[
        list[str] | None,
        Parameter(group=SCENE, help="Recipe of fits to come; several may be given.", negative=""),
    ] = None,
    scene: Annotated[SceneFlags | None, Parameter(name="*")] = None,
    reading: Annotated[FileFlags | None, Parameter(name="*")] = None,
    fitting: Annotated[FitFlags | None, Parameter(name="*")] = None,
    joint: Annotated[bool, switch(SCENE, "The files are fitted together: they are of one sample.")] = False,
) -> int:
    """Compile and keep the programs of fits to come: the first is then as quick as later ones.

    Files are fitted, and the results dropped. A program serves files of one scene whose numbers of points,
    rounded up to a multiple of 64, are equal.

    Example: pellicle warm --recipe oxide.toml
    """
    flags = scene, reading, fitting, joint
    every = {path or "flags": inputs(list(data), path, *flags) for path in recipe or [None]}
    start()
    import jax

    folder = jax.config.jax_compilation_cache_dir  # pyright: ignore[reportAttributeAccessIssue]
    if not folder or cache_folder() is None:
        raise UsageError(
            f"programs are not kept, so there is nothing to prepare: {CACHE_VARIABLE} is off, or its folder"
            " cannot be used; pellicle doctor names it"
        )
    for name, files in every.items():
        began, before = perf_counter(), _kept(folder)
        _compile(files, name)
        new = len(_kept(folder) - before)
        say(f"{name}: {new} programs compiled in {perf_counter() - began:.1f} s and kept in {folder}")
    return GOOD


def _kept(folder: str) -> set[str]:
    return {path.name for path in Path(folder, "programs").glob("*")}


def _compile(files: Inputs, name: str) -> None:
    """Fit every group of files by compiled programs."""
    from pellicle.api.fits import fit
    from pellicle.programs.cache import compiled_at_once

    options = {"loss": files.loss, "tolerance": files.tolerance, "residual": files.residual}
    with compiled_at_once(), Progress(name) as progress:
        for group in files.groups:
            fit(*measurement(group, files.joint, None), progress=progress, **options)
