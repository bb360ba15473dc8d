"""`pellicle demo`: a simulated measurement, from the recipe to the posterior."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from pellicle.cli.batch import Batch, Sampler
from pellicle.cli.inputs import inputs
from pellicle.cli.session import say, start
from pellicle.errors import install_command

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
    *, out: Annotated[str, Parameter(help="Folder to make; an existing folder is not changed.")] = FOLDER
) -> int:
    """Simulate a measurement, fit it, sample its posterior and draw the film's colours.

    Makes a folder with a recipe, a spectrum and results, and prints the commands that made them.
    """
    from pellicle.cli.chart import chart
    from pellicle.cli.simulate import SimulationFlags, simulate
    from pellicle.files import write_text
    from pellicle.sampling.chain import missing

    folder, count = Path(out), 1
    while folder.exists():
        count += 1
        folder = Path(out).with_name(f"{Path(out).name}-{count}")
    folder.mkdir(parents=True)
    recipe, data, image = folder / "hematite.toml", folder / "hematite.csv", folder / "colours.png"
    write_text(recipe, RECIPE)
    say(f"{recipe}: a recipe to change and try again")
    say("", f"$ pellicle simulate {recipe} --out {data} --seed 1")
    simulate(str(recipe), out=str(data), how=SimulationFlags(seed=1))
    sampler, command = (None, "fit") if missing() else (Sampler(), "sample")
    say("", f"$ pellicle {command} --recipe {recipe} --out {folder / 'result'}")
    files = inputs([], str(recipe))
    start()
    code = Batch(files, sampler=sampler, out=str(folder / "result")).run()
    say("", f"$ pellicle chart {recipe} --out {image} --thickness 0:600")
    chart(str(recipe), out=str(image), thickness="0:600")
    if sampler is None:
        say(f"no posterior was sampled: {install_command('posterior')}")
    say(f"see {folder}/result (report.txt, figure.png) and {image}")
    return code
