"""`pellicle demo`: a measurement that never was, from the recipe to the posterior."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from pellicle.cli.batch import Batch, Sampler
from pellicle.cli.flags import ReadWords, SceneWords
from pellicle.cli.session import say, start

RECIPE = """\
# A layer of hematite, the red of ochre, on window glass: try other numbers.
[data]
files = ["hematite.csv"]
signal = "R"
noise = 0.004
wavelengths = { start = 400, stop = 780, step = 4 }

[scene]
ambient = "air"
substrate = "BK7"

[[scene.layer]]
name = "hematite"
material = "Fe2O3"
thickness = { value = 140, lower = 10, upper = 1000 }
"""
FOLDER = "pellicle-demo"


def demo(
    *, out: Annotated[str, Parameter(help="The folder to make; an existing one is not touched.")] = FOLDER
) -> int:
    """Simulate a measurement, fit it, sample the posterior, and draw it: a first look at everything.

    Makes a folder with a recipe, a spectrum, and results, and says which commands did it.
    """
    from pellicle.cli.chart import chart
    from pellicle.cli.inputs import groups
    from pellicle.cli.simulate import simulate
    from pellicle.files import write_text
    from pellicle.recipes import read_recipe
    from pellicle.recipes.film import FilmRecipe
    from pellicle.sampling.checks import missing

    folder = _unused(Path(out))
    folder.mkdir(parents=True)
    recipe, data, picture = folder / "hematite.toml", folder / "hematite.csv", folder / "colours.png"
    write_text(recipe, RECIPE)
    say(f"{recipe}: a recipe, to be changed and tried again")
    _told(f"pellicle simulate {recipe} --out {data} --seed 1")
    simulate(str(recipe), out=str(data), seed=1)
    sampler, command = (None, "fit") if missing() else (Sampler(), "sample")
    _told(f"pellicle {command} --recipe {recipe} --out {folder / 'result'}")
    described = read_recipe(recipe)
    assert isinstance(described, FilmRecipe)
    found, together = groups([], described, SceneWords(), ReadWords(), joint=False)
    start()
    code = Batch(str(folder / "result"), False, together, 0.0, sampler)(found)
    _told(f"pellicle chart {recipe} --out {picture} --thickness 0:600")
    chart(str(recipe), out=str(picture), thickness="0:600")
    if sampler is None:
        say("no posterior was sampled: pip install 'pellicle[posterior]'")
    say(f"look into {folder}/result (report.txt, figure.png) and at {picture}")
    return code


def _told(command: str) -> None:
    say("", f"$ {command}")


def _unused(folder: Path) -> Path:
    """The folder itself, or with -2, -3, ... where something of that name is there."""
    count, found = 1, folder
    while found.exists():
        count += 1
        found = folder.with_name(f"{folder.name}-{count}")
    return found
