"""Light, angles and wavelengths at which a recipe is simulated, some of them those of its files."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from pellicle.api.data_files import read, read_films
from pellicle.cli.flags import light
from pellicle.cli.messages import say
from pellicle.data.options import SPACES, FileOptions
from pellicle.errors import DataError

if TYPE_CHECKING:
    import numpy as np

    from pellicle.data.brdf_samples import BrdfSamples
    from pellicle.recipes.read import FilmRecipe, SurfaceRecipe
    from pellicle.scene.film import Scene
    from pellicle.simulation.brdf import Directions


def recipe_angles(recipe: FilmRecipe) -> np.ndarray:
    """Angles of incidence (colours,) of a recipe: its list, those of its first file, or its one angle."""
    import numpy as np

    options = FileOptions(**recipe.first.reading)
    if recipe.files and not isinstance(options.angle, list):
        stated = read_films(recipe.files[0], options)[0].angle
        if stated is not None:
            say(f"angles: those of {recipe.files[0]} (the recipe gives none)")
            return stated
    angle: Any = light(options).angle
    return np.atleast_1d(np.asarray(getattr(angle, "start", angle), float))


MOST = 1_000_000
"""Most wavelengths of a simulation: more result from a mistaken step."""


def measured_scene(recipe: FilmRecipe) -> tuple[Scene, np.ndarray]:
    """The scene in the light of the recipe and its wavelengths: the recipe's, or those of its first file.

    Raises DataError for ellipsometry without an angle.
    """
    scene, nm = scene_and_wavelengths(recipe)
    if scene.light.ellipsometric and scene.light.largest_angle == 0.0:
        raise DataError(f"{recipe.path}: ellipsometry needs an angle of incidence: give [data] angle = 70")
    return scene, nm


def scene_and_wavelengths(recipe: FilmRecipe) -> tuple[Scene, np.ndarray]:
    """`measured_scene` at any angle."""
    data = recipe.tables.data
    if recipe.first.tables.data.signal in SPACES:
        return _in_colours(recipe)
    if recipe.files and data.wavelengths is None:
        return _as_measured(recipe)
    scene = recipe.scene()
    return each_setting(scene, wavelengths(recipe, scene))


def refuse_wavelengths(recipe: FilmRecipe) -> None:
    """Raise DataError where a recipe of colours has wavelengths."""
    if recipe.tables.data.wavelengths is not None:
        raise DataError(
            f"{recipe.path}: [data] wavelengths: colours take those of their sensor; leave them out"
        )


def _in_colours(recipe: FilmRecipe) -> tuple[Scene, np.ndarray]:
    """The scene at each angle of its colours, and the wavelengths of the sensor for each."""
    import equinox as eqx
    import numpy as np

    refuse_wavelengths(recipe)
    scene, angles = recipe.first.scene(), recipe_angles(recipe)
    nm = recipe.first.sight().sensor.wavelength
    say(f"wavelengths: {nm[0]:g} to {nm[-1]:g} nm every 1 nm, those of the sensor")
    angle: Any = scene.light.angle if len(angles) == 1 else np.repeat(angles, len(nm))
    light = replace(scene.light, wavelength=None, angle=angle)
    return eqx.tree_at(lambda s: s.light, scene, light), np.tile(nm, len(angles))


def _as_measured(recipe: FilmRecipe) -> tuple[Scene, np.ndarray]:
    """The scene in the light of the recipe's first file, at the first of its angles and azimuths."""
    import equinox as eqx
    import numpy as np

    from pellicle.scene.film import Light

    path = recipe.files[0]
    scene, options = recipe.first.scene(), FileOptions(**recipe.first.reading)
    spectrum = read(path, options, scene)[0]
    say(f"wavelengths: those of {path} (the recipe gives none)")
    stated, first = light(options), spectrum.settings[0]
    angle = stated.angle if spectrum.angle is None else first.angle
    azimuth = scene.light.azimuth if first.azimuth is None else first.azimuth or None
    polarised = spectrum.polarisation if spectrum.polarisation != "unpolarised" else stated.polarisation
    seen = Light(None, angle, spectrum.signal, polarised, azimuth, spectrum.transmission)
    return eqx.tree_at(lambda s: s.light, scene, seen), np.sort(spectrum.wavelength[first.rows])


def each_setting(scene: Scene, nm: np.ndarray) -> tuple[Scene, np.ndarray]:
    """The scene and the wavelengths at each angle and azimuth that a recipe lists, one after the other."""
    import numpy as np

    from pellicle.scene.film import with_wavelength

    angles, azimuths = scene.light.angle, scene.light.azimuth
    if not np.ndim(angles) and not np.ndim(azimuths):
        return scene, nm
    several, turns, repeated = np.size(angles), np.size(azimuths), {}
    if np.ndim(angles):
        repeated["angle"] = np.repeat(angles, turns * len(nm))
    if np.ndim(azimuths):
        repeated["azimuth"] = np.tile(np.repeat(azimuths, len(nm)), several)
    return with_wavelength(scene, scene.light.wavelength, **repeated), np.tile(nm, several * turns)


def wavelengths(recipe: FilmRecipe, scene: Scene) -> np.ndarray:
    """The recipe's wavelengths, or the visible ones that every material has data for."""
    import numpy as np

    from pellicle.simulation.spectra import VISIBLE, default_wavelengths

    grid = recipe.tables.data.wavelengths
    if grid is None:
        nm = default_wavelengths(scene)
        if len(nm) < 2:
            raise DataError(
                f"{recipe.path}: the materials share no wavelengths in {VISIBLE[0]:g} to {VISIBLE[1]:g} nm:"
                " give [data] wavelengths = { start, stop, step }"
            )
        say(f"wavelengths: {nm[0]:g} to {nm[-1]:g} nm every {VISIBLE[2]:g} nm (the recipe gives none)")
        return nm
    stated = f"{recipe.path}: [data] wavelengths"
    if isinstance(grid, list):
        nm = np.array(grid)
    elif (grid.stop - grid.start) / grid.step > MOST:
        raise DataError(f"{stated} are more than {MOST:,} points: give a larger step")
    else:
        nm = np.arange(grid.start, grid.stop + grid.step / 2, grid.step)
    if not len(nm) or not np.all(np.diff(nm) > 0) or nm[0] <= 0:
        raise DataError(f"{stated} must be rising positive numbers")
    return nm


def directions(recipe: SurfaceRecipe) -> Directions | BrdfSamples:
    """Directions of the recipe's first file, or default ones spread over the lobe and around it."""
    from pellicle.simulation.brdf import default_directions

    if recipe.files:
        say(f"directions: those of {recipe.files[0]}")
        return recipe.read(recipe.files[0])
    pairs = default_directions()
    say(f"directions: {len(pairs.theta_i)} spread over the lobe and around it (the recipe names no files)")
    return pairs
