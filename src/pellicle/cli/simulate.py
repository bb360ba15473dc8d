"""`pellicle simulate` and `pellicle demo`: synthetic measurements, with the true values in the header."""

from __future__ import annotations

from dataclasses import dataclass, replace
from importlib.metadata import version
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from pellicle.cli.batch import Batch
from pellicle.cli.flags import Flags, SamplerFlags
from pellicle.cli.inputs import inputs
from pellicle.cli.messages import say, show
from pellicle.cli.reading import directions, each_setting, recipe_angles, refuse_wavelengths, wavelengths
from pellicle.cli.session import check_folder, not_negative, start
from pellicle.data.options import SPACES
from pellicle.errors import DataError, UsageError, install_command

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pellicle.recipes.read import FilmRecipe, SurfaceRecipe
    from pellicle.scene.film import Scene
    from pellicle.signals.base import Signal
    from pellicle.simulation.spectra import SimulatedSignal


SYNTHETIC = "SYNTHETIC: simulated, not measured"


@dataclass(frozen=True)
class SimulationFlags(Flags):
    """Flags of the noise and of the effects of a simulation."""

    noise: Annotated[float | str | None, Parameter(metavar="SIGMA")] = None
    """Standard deviation of the noise, or "2 %" of a BRDF (the recipe's, or 0)."""
    depolarisation_noise: Annotated[
        float | None,
        Parameter(
            help="Standard deviation of the depolarisation, a fraction: it comes with Ψ and Δ where the scene"
            " depolarises (4 times --noise in radians).",
            metavar="SIGMA",
        ),
    ] = None
    seed: int = 0
    """Seed of the noise."""
    tolerance: float = 0.0
    """Leave out effects that change the signal by less than this (0: none)."""


def simulate(
    recipe: Annotated[str, Parameter(help="TOML file that describes the scene or surface.")],
    *,
    out: Annotated[
        str,
        Parameter(
            help="CSV file to write; an existing file is not overwritten. A folder with --depth, and for a"
            " recipe of several samples."
        ),
    ],
    how: Annotated[SimulationFlags, Parameter(name="*")] = SimulationFlags(),
    depth: Annotated[
        str | None,
        Parameter(
            help="Wavelengths in nm: |E|² and absorbed power against depth there, and the absorptance of"
            " each layer against wavelength.",
            metavar="NM[,NM]",
        ),
    ] = None,
    json: Annotated[bool, Parameter(help="Print one JSON object (with --depth).", negative="")] = False,
) -> int:
    """Simulate the spectrum or the colours of a recipe's film, or BRDF samples of its surface.

    With --depth, compute instead where a film absorbs light.

    Example: pellicle simulate film.toml --out film.csv --noise 0.002 --seed 1
    """
    from pellicle.recipes.read import SurfaceRecipe, read_recipe

    spread = _checked_spread(how, depth, json)
    described = read_recipe(recipe)
    several = [] if isinstance(described, SurfaceRecipe) else described.samples
    recipes = several or [described]
    for one in recipes:
        _check_depolarisation(one, how.depolarisation_noise)
    if depth is not None:
        _write_depth_profile(described, out, depth, json)
        return 0
    paths = _paths(several, out) if several else [out]
    start()
    for number, (one, path) in enumerate(zip(recipes, paths, strict=True)):
        # noise of its own for each file
        _write(one, path, replace(how, seed=how.seed + number), spread)
    return 0


def _paths(recipes: Sequence[FilmRecipe], out: str) -> list[str]:
    """Path in the folder `out`, which is made, of the CSV file of each recipe, by the stem of its file.

    Raises UsageError where `out` is no folder, and DataError where two files have one name.
    """
    if Path(out).suffix or Path(out).is_file():
        raise UsageError(f"--out {out}: several samples are simulated into a folder, as in --out simulated")
    paths = [str(Path(out) / f"{Path(one.files[0]).stem}.csv") for one in recipes]
    if twice := [path for path in paths if paths.count(path) > 1]:
        raise DataError(
            f"{recipes[0].path}: two files of its samples would be simulated as {twice[0]}: give each a name"
            " of its own"
        )
    Path(out).mkdir(parents=True, exist_ok=True)
    return paths


def _write(
    described: FilmRecipe | SurfaceRecipe, out: str, how: SimulationFlags, spread: float | str | None
) -> None:
    """Simulate one film or surface, and write it to the file `out`."""
    from pellicle.recipes.read import SurfaceRecipe
    from pellicle.signals.limits import noise_of

    noise: Any = (described.tables.data.noise or 0.0) if spread is None else spread
    said = f"{noise:g}" if isinstance(noise, float | int) else noise
    name = Path(described.path).name
    source = f"recipe {name}, seed {how.seed}, noise {said}, pellicle {version('pellicle')}"
    comments = [SYNTHETIC, source]
    if isinstance(described, SurfaceRecipe):
        _write_samples(described, out, noise, how, comments)
        return
    noise = noise_of("a simulated spectrum", noise) if isinstance(noise, str) else noise
    if described.tables.data.signal in SPACES:
        _write_colours(described, out, noise, how, comments)
    else:
        _write_spectrum(described, out, noise, how, comments)


def _checked_spread(how: SimulationFlags, depth: str | None, json: bool) -> float | str | None:
    """The noise: a number from 0, or a share as text. Raises UsageError, also for flags that contradict."""
    from pellicle.signals.limits import noise_level

    if json and depth is None:
        raise UsageError("--json is for --depth: spectra, colours and BRDF samples are written to --out")
    spread = how.noise
    if spread:
        level = noise_level(spread, "--noise")
        spread = str(level) if level.relative else level.value
    not_negative("--tolerance", how.tolerance)
    if depth is not None and (spread or how.tolerance):
        raise UsageError("--depth is exact: leave out --noise and --tolerance")
    return spread


def _check_depolarisation(described: FilmRecipe | SurfaceRecipe, noise: float | None) -> None:
    """Raise UsageError where noise of a depolarisation is given that the signal does not have."""
    from pellicle.recipes.read import SurfaceRecipe
    from pellicle.signals.registry import KINDS

    if noise is None:
        return
    not_negative("--depolarisation-noise", noise)
    kind = None if isinstance(described, SurfaceRecipe) else KINDS.get(described.tables.data.signal or "")
    if kind is None or "depolarisation" not in kind.keywords:
        raise UsageError("--depolarisation-noise is for a film with the signal psi-delta")


def _write_depth_profile(recipe: FilmRecipe | SurfaceRecipe, out: str, depth: str, json: bool) -> None:
    """Write the absorption and the field at the wavelengths that --depth lists."""
    try:
        chosen = [float(word) for word in depth.split(",")]
    except ValueError:
        chosen = [0.0]
    if not all(0 < nm < inf for nm in chosen):
        raise UsageError(f"--depth {depth}: expected wavelengths in nm, as in --depth 450,600")
    from pellicle.recipes.read import SurfaceRecipe

    if isinstance(recipe, SurfaceRecipe) or recipe.tables.data.signal in SPACES:
        raise DataError(f"{recipe.path}: --depth is for a film and its spectrum")
    check_folder(out)
    start()
    from pellicle.api.simulations import depth_profile
    from pellicle.fitting.film.messages import log_scene
    from pellicle.reporting.depth_profile import report, to_json, write_depth_profile

    scene = recipe.scene()
    log_scene(scene)
    profile = depth_profile(scene, chosen, wavelengths(recipe, scene))
    source, name = f"recipe {Path(recipe.path).name}, pellicle {version('pellicle')}", str(recipe.path)
    angle, light = getattr(scene.light.angle, "start", scene.light.angle), scene.light.polarisation
    comments = [SYNTHETIC, source, f"angle {angle:g} degrees, {light}", _truth(scene)]
    folder = write_depth_profile(out, profile, name, comments)
    show(to_json(profile, name) if json else report(profile, name))
    say(f"{folder}: figure and tables written")


def _write_spectrum(
    recipe: FilmRecipe, out: str, noise: float, how: SimulationFlags, comments: list[str]
) -> None:
    from pellicle.files import write_text
    from pellicle.fitting.film.messages import log_plan, log_scene
    from pellicle.signals.registry import of_parts
    from pellicle.simulation.spectra import simulate_signal

    scene = recipe.scene()
    log_scene(scene)
    if scene.light.ellipsometric and recipe.tables.data.angle is None:
        raise DataError(f"{recipe.path}: ellipsometry needs an angle of incidence: give [data] angle = 70")
    grid = wavelengths(recipe, scene)
    scene, nm = each_setting(scene, grid)
    options, kind = recipe.tables.data, scene.light.kind
    if options.elements is not None and kind.parts:
        kind = of_parts(options.elements, scene.light.signal)
    result = simulate_signal(scene, nm, noise, how.seed, how.tolerance, how.depolarisation_noise, kind)
    log_plan(result.plan)
    write_text(out, _csv(scene, result, kind, noise, comments))
    span = f"{grid[0]:g} to {grid[-1]:g} nm" if len(grid) > 1 else f"at {grid[0]:g} nm"
    say(f"{out}: {len(nm)} points, {span}" if len(nm) > 1 else f"{out}: 1 point, {span}")


def _write_colours(
    recipe: FilmRecipe, out: str, noise: float, how: SimulationFlags, comments: list[str]
) -> None:
    from pellicle.data.colours import write_colours
    from pellicle.fitting.film.messages import log_plan, log_scene
    from pellicle.simulation.colours import simulate_colours

    scene, seen, table = recipe.scene(), recipe.sight(), recipe.tables
    refuse_wavelengths(recipe)
    log_scene(scene)
    options: Any = {"gamma": table.camera.gamma or 1.0, "camera": seen.matrix, "noise": noise}
    options |= {"seed": how.seed, "tolerance": how.tolerance}
    space, angles = table.data.signal or "srgb", recipe_angles(recipe)
    colours, plan = simulate_colours(scene, seen.sensor, space, angles, **options)
    log_plan(plan)
    write_colours(out, [colours], comments=[*comments, *seen.notes, _truth(scene)])
    say(f"{out}: {len(colours)} colour{'s' * (len(colours) != 1)} in {colours.space}")


def _truth(scene: Scene) -> str:
    """The true values of the parameters, as a comment."""
    from pellicle.fitting.film.parameters import fixed_numbers, parameters, tied_numbers
    from pellicle.scene.expressions import value

    numbers = [(p.name, p.start, p.unit) for p in parameters(scene)]
    start = {name: x for name, x, _ in numbers}
    numbers += [(x.name, value(x.expression, start.__getitem__), x.unit) for x in tied_numbers(scene)]
    numbers += fixed_numbers(scene)
    return "truth: " + ", ".join(f"{name} = {value:.10g} {unit}".rstrip() for name, value, unit in numbers)


def _csv(scene: Scene, result: SimulatedSignal, kind: Signal, noise: float, comments: list[str]) -> str:
    """The spectrum as CSV below its comments, which end with the true values of the parameters."""
    import numpy as np

    from pellicle.reporting.drawable import Table
    from pellicle.reporting.plain_text import csv_text

    light, count = scene.light, len(result.wavelength)
    angles = np.asarray(getattr(light.angle, "start", light.angle), float)
    about = "" if light.ellipsometric else f", {light.polarisation}"
    stated = ", ".join(f"{angle:g}" for angle in np.unique(angles))
    lines = [*comments, f"signal {light.signal}, angle {stated} degrees{about}", _truth(scene)]
    known = [("wavelength_nm", result.wavelength)]
    if light.ellipsometric or angles.ndim:
        known.append(("angle_deg", np.broadcast_to(angles, count)))
    if light.azimuth is not None:
        known.append(("azimuth_deg", np.broadcast_to(light.azimuth, count)))
    measured = [*zip([q.header for q in kind.quantities], result.values.reshape(count, -1).T, strict=True)]
    errors = [("sigma", noise)]
    if result.depolarisation is not None:
        measured.append(("depolarisation", result.depolarisation))
        errors.append(("sigma_depolarisation", result.depolarisation_noise))
    columns = {name: [f"{x:.10g}" for x in values.tolist()] for name, values in known}
    columns |= {name: [f"{x:.8f}" for x in values.tolist()] for name, values in measured}
    columns |= {name: [f"{error:g}"] * count for name, error in errors if error}
    return csv_text(Table(columns, lines))


def _write_samples(
    recipe: SurfaceRecipe, out: str, noise: Any, how: SimulationFlags, comments: list[str]
) -> None:
    import numpy as np

    from pellicle.data.brdf_samples import write_brdf_samples
    from pellicle.fitting.film.messages import log_plan
    from pellicle.simulation.brdf import simulate_samples

    surface = recipe.scene()
    samples, plan = simulate_samples(surface, directions(recipe), noise, how.seed, how.tolerance)
    log_plan(plan)
    units = {parameter.key: parameter.unit for parameter in surface.brdf.parameters}
    truth = [f"truth: model {surface.model}"]
    for key, numbers in surface.start_numbers().items():
        if key != "weights":
            means = np.ravel(numbers @ surface.bands.weights if numbers.size > 1 else numbers)
            values = " ".join(f"{x:.10g}" for x in means)
            truth.append(f"{key} = {values} {units.get(key, 'nm')}".rstrip())
    truth += ["means over the bands of a sensor"] if surface.sensor is not None else []
    write_brdf_samples(out, samples, comments=[*comments, ", ".join(truth)])
    say(f"{out}: {len(samples)} samples of {', '.join(samples.channels)}", *samples.notes)


DEMO_RECIPE = """\
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
DEMO_FOLDER = "pellicle-demo"


def demo(
    *, out: Annotated[str, Parameter(help="Folder to make; an existing folder is not changed.")] = DEMO_FOLDER
) -> int:
    """Simulate a measurement, fit it, sample its posterior and draw the film's colours.

    Makes a folder with a recipe, a spectrum and results, and prints the commands that made them.
    """
    from pellicle.cli.chart import ChartFlags, chart
    from pellicle.files import write_text
    from pellicle.sampling.chain import missing

    folder, count = Path(out), 1
    while folder.exists():
        count += 1
        folder = Path(out).with_name(f"{Path(out).name}-{count}")
    folder.mkdir(parents=True)
    recipe, data, image = folder / "hematite.toml", folder / "hematite.csv", folder / "colours.png"
    write_text(recipe, DEMO_RECIPE)
    say(f"{recipe}: a recipe to change and try again")
    say("", f"$ pellicle simulate {recipe} --out {data} --seed 1")
    simulate(str(recipe), out=str(data), how=SimulationFlags(seed=1))
    sampler, command = (None, "fit") if missing() else (SamplerFlags(), "sample")
    say("", f"$ pellicle {command} --recipe {recipe} --out {folder / 'result'}")
    files = inputs([], str(recipe))
    start()
    code = Batch(files, sampler=sampler, out=str(folder / "result")).run()
    say("", f"$ pellicle chart {recipe} --out {image} --thickness 0:600")
    chart(str(recipe), out=str(image), how=ChartFlags(thickness="0:600"))
    if sampler is None:
        say(f"no posterior was sampled: {install_command('posterior')}")
    say(f"see {folder}/result (report.txt, figure.png) and {image}")
    return code
