"""The scene of a recipe as it is looked at, and at which wavelengths."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pellicle.cli.session import say
from pellicle.errors import DataError

if TYPE_CHECKING:
    import numpy as np

    from pellicle.recipes.film import FilmRecipe

MOST = 1_000_000
"""Most wavelengths that are simulated at once: more is a slip of the step."""


def seen(recipe: FilmRecipe) -> tuple[Any, np.ndarray]:
    """The scene, looked at as the recipe says, and its wavelengths: the recipe's, or its first file's."""
    data = recipe.tables.data
    if recipe.files and data.wavelengths is None:
        scene, wavelength = _as_measured(recipe)
    else:
        scene = recipe.scene()
        wavelength = wavelengths(recipe, scene)
    if scene.light.signal == "psi-delta" and scene.light.angle == 0.0:
        raise DataError(f"{recipe.path}: ellipsometry needs an angle of incidence: give [data] angle = 70")
    return scene, wavelength


def _as_measured(recipe: FilmRecipe) -> tuple[Any, np.ndarray]:
    """The scene seen as the recipe's first file was, at the first of its angles."""
    import equinox as eqx
    import numpy as np

    from pellicle.cli.flags import ReadWords
    from pellicle.cli.options import light, merged, read
    from pellicle.scene.film import Light
    from pellicle.scene.instrument import Drift

    path = recipe.files[0]
    own = recipe if recipe.tables.data.files else recipe.each[0]  # the first [[data.file]] has its own words
    scene, words = own.scene(), merged(ReadWords(), own)
    spectrum = read(path, words, scaled=isinstance(scene.instrument.scale, Drift))
    say(f"wavelengths: those of {path} (the recipe gives none)")
    stated = light(words)
    angle = stated.angle if spectrum.angle is None else float(spectrum.angle[0])
    same = slice(None) if spectrum.angle is None else spectrum.angle == spectrum.angle[0]
    polarised = spectrum.polarisation if spectrum.polarisation != "unpolarised" else stated.polarisation
    looked = Light(None, angle, spectrum.signal, polarised)
    return eqx.tree_at(lambda s: s.light, scene, looked), np.sort(spectrum.wavelength[same])


def wavelengths(recipe: FilmRecipe, scene: Any) -> np.ndarray:
    """The recipe's wavelengths, or the visible ones that every material has data for."""
    import numpy as np

    from pellicle.synthetic.spectra import VISIBLE, default_wavelengths

    given = recipe.tables.data.wavelengths
    if given is None:
        grid = default_wavelengths(scene)
        if len(grid) < 2:
            raise DataError(
                f"{recipe.path}: the materials share no wavelengths in {VISIBLE[0]:g} to {VISIBLE[1]:g} nm:"
                " give [data] wavelengths = { start, stop, step }"
            )
        say(f"wavelengths: {grid[0]:g} to {grid[-1]:g} nm every {VISIBLE[2]:g} nm (the recipe gives none)")
        return grid
    if isinstance(given, list):
        grid = np.array(given)
    elif (given.stop - given.start) / given.step > MOST:
        raise DataError(
            f"{recipe.path}: [data] wavelengths are more than {MOST:,} points: give a larger step"
        )
    else:
        grid = np.arange(given.start, given.stop + given.step / 2, given.step)
    if len(grid) < 2 or not np.all(np.diff(grid) > 0) or grid[0] <= 0:
        raise DataError(f"{recipe.path}: [data] wavelengths must be at least two rising positive numbers")
    return grid
