"""Command, program in Python and recipe that repeat a fit, and the sources to cite with it."""

import shlex
import tomllib
from collections.abc import Callable, Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from pellicle.errors import UsageError
from pellicle.fitting.result import Fit
from pellicle.materials.catalogue import materials_in
from pellicle.sampling.result import Posterior

_LONGEST = 200_000
"""Bytes of a recipe above which it is not copied into the page."""


def repetition(
    fit: Fit,
    described: Mapping[str, Any] | None,
    recipe_in: Callable[[Path], str] | None = None,
    saved: Path | None = None,
) -> list[tuple[str, str]]:
    """Descriptions and texts of the command, the program in Python and the recipe of a fit; only the recipe
    for a fit in Python.

    `described` is what the scene was built from, a recipe's path or flags, with the flags of a sampler.
    `recipe_in` gives the text of a recipe in a folder that repeats a fit by flags; `saved` is the path of the
    one that was written for the program.
    """
    if described is None:
        return _written(fit)
    files = list(dict.fromkeys(part.data.path for part in fit.parts if part.data.path))
    sampler = described.get("sampler")
    recipe = described.get("recipe")
    named = [] if recipe is not None and _has_tables_of_files(recipe) else files
    words = ["pellicle", "fit" if sampler is None else "sample", *named]
    words += [] if recipe is None else ["--recipe", str(recipe)]
    for name, value in {
        **described.get("flags", {}),
        **described.get("reading", {}),
        **(sampler or {}),
    }.items():
        flag = name.replace("_", "-")
        words += [f"--no-{flag}"] if value is False else [f"--{flag}"]
        words += [] if isinstance(value, bool) else [_word(value)]
    joint = ["--joint"] if len(files) > 1 and recipe is None else []
    result = [("Command", shlex.join([*words, *joint]))]
    result += [] if saved is None else [("Python", _program(saved, sampler))]
    if recipe is None:
        try:
            return [*result, *([("Recipe", recipe_in(Path()))] if recipe_in else _written(fit))]
        except UsageError:
            return result
    try:
        text = Path(recipe).read_text(encoding="utf-8")
    except (OSError, ValueError):  # it has gone since
        return result
    return result if len(text) > _LONGEST else [*result, (f"Recipe {Path(recipe).name}", text)]


def _has_tables_of_files(recipe: str) -> bool:
    """True of a recipe with [[sample]] or [[data.file]], beside which a command takes no files."""
    try:
        tables = tomllib.loads(Path(recipe).read_text(encoding="utf-8"))
    except (OSError, ValueError):  # of another program, or gone since
        return False
    return "sample" in tables or "file" in tables.get("data", {})


def _program(recipe: Path, sampler: Mapping[str, Any] | None) -> str:
    """A program that repeats a fit, or the sampling of its posterior, by a recipe."""
    what, verb = ("fit", "fit") if sampler is None else ("posterior", "sample")
    arguments = ["data", "scene", "**options", *(f"{name}={x!r}" for name, x in (sampler or {}).items())]
    return f"""\
import pellicle as pl

[(data, scene, options)] = pl.read_problems({recipe.as_posix()!r})
{what} = pl.{verb}({", ".join(arguments)})
print({what})
"""


def comparison_again(
    recipes: Mapping[str, str], files: Sequence[str], position: int
) -> list[tuple[str, str]]:
    """Command, program and recipes of a comparison of recipes, paths by name, on their files or `files`;
    the program is of the fits at one position."""
    words = [
        "pellicle",
        "compare",
        *files,
        *(word for path in recipes.values() for word in ("--recipe", path)),
    ]
    program = f"""\
import pellicle as pl

recipes = {dict(recipes)!r}
problems = {{name: pl.read_problems(path, {list(files)!r})[{position}] for name, path in recipes.items()}}
data, _, options = next(iter(problems.values()))
scenes = {{name: scene for name, (_, scene, _) in problems.items()}}
comparison = pl.compare(data, scenes, residual=options.get("residual"))
print(comparison)
"""
    texts = [(f"Recipe {name}", Path(path).read_text(encoding="utf-8")) for name, path in recipes.items()]
    return [("Command", shlex.join(words)), ("Python", program), *texts]


_OF_RUN = "workers", "scheduler", "resume", "overwrite", "out", "progress", "recipe"
"""Arguments of a map that do not change its numbers."""


def map_program(
    verb: str, source: str | list[str], recipe: str, options: Mapping[str, Any], written: Mapping[str, str]
) -> str:
    """A program that repeats a map, or a series (`verb`), by the scene of a recipe.

    `written` are expressions of options that have no literal.
    """
    given = {name: repr(x) for name, x in options.items() if name not in _OF_RUN} | dict(written)
    words = "".join(f",\n    {name}={text}" for name, text in given.items())
    imports, double = "import pellicle as pl", ""
    if any("pl.reflectance" in text for text in written.values()):  # in double precision, as the command
        imports, double = f"import jax\n{imports}", '\njax.config.update("jax_enable_x64", True)'
    return f"""\
{imports}
{double}
scene = pl.read_recipe({recipe!r}).scene()
result = pl.{verb}(
    {source!r},
    scene{words},
)
print(result)
"""


def _word(value: Any) -> str:
    if isinstance(value, tuple | list):
        numbers = all(isinstance(each, float | int) for each in value)
        return (":" if numbers and isinstance(value, tuple) else ",").join(f"{each}" for each in value)
    return str(value)


def _written(fit: Fit) -> list[tuple[str, str]]:
    """The recipe of a fit of one spectrum; none where a recipe cannot express its scene."""
    from pellicle.data.spectrum import Spectrum
    from pellicle.recipes.write import recipe_text
    from pellicle.scene.film import Scene, with_wavelength

    scene, data = fit.scene, fit.parts[0].data
    if len(fit.parts) != 1 or not isinstance(scene, Scene) or not isinstance(data, Spectrum):
        return []
    # the file has its own angles, and its wavelengths in any case
    own = with_wavelength(scene, None, None if data.angle is None else 0.0)
    if np.ndim(own.light.angle) or np.ndim(own.light.azimuth):
        return []  # those of the points of a spectrum in Python: a recipe would take each for all wavelengths
    try:
        return [("Recipe", recipe_text(own, files=[data.path] if data.path else []))]
    except UsageError:
        return []


_BIBTEX = """\
@software{pellicle,
  author = {{The pellicle developers}},
  title = {pellicle: thickness and refractive index of thin layers from measured spectra},
  version = {VERSION},
}"""
_GRANIER = "X. Granier and W. Heidrich: A simple layered RGB BRDF model. Pacific Graphics 2002."
_BELCOUR = (
    "L. Belcour and P. Barla: A practical extension to microfacet theory for the modeling of varying"
    " iridescence. ACM Transactions on Graphics 36 (4), 65 (2017), doi:10.1145/3072959.3073620."
)
_MODELS = {"granier-heidrich": _GRANIER, "microfacet-film": _BELCOUR}
"""Papers of BRDF models, by the beginning of the model's name."""
_EMCEE = (
    "D. Foreman-Mackey, D. W. Hogg, D. Lang and J. Goodman: emcee: the MCMC hammer."
    " Publications of the Astronomical Society of the Pacific 125, 306 (2013)."
)
_DATABASE = (
    "M. N. Polyanskiy: refractiveindex.info database of optical constants. Scientific Data 11, 94 (2024),"
    " doi:10.1038/s41597-023-02898-2."
)


def sources(fit: Fit, posterior: Posterior | None = None) -> list[str]:
    """Sources of a fit, pellicle first."""
    result = [f"The pellicle developers: pellicle {version('pellicle')}."]
    named = [material for material in materials_in(fit.scene) if material.citation]
    result += [f"{each.name} ({each.page}): {each.citation.rstrip('.')}." for each in named]
    if any(each.page.count("/") >= 2 for each in named):
        result.append(_DATABASE)
    if fit.layer_test is not None:
        result += [text for name, text in _MODELS.items() if fit.surface.model.startswith(name)]
    if posterior is not None:
        result.append(_EMCEE)
    return list(dict.fromkeys(result))


def bibtex() -> str:
    """BibTeX entry of this version of pellicle."""
    return _BIBTEX.replace("VERSION", version("pellicle"))
