"""`pellicle series`: thickness and rate of a film against time, from all spectra together."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from pellicle.cli.flags import OUTPUT, READING, CubeFlags, Flags, flag, switch
from pellicle.cli.map import MOST_DECIDED, RUN, STORE, film_recipe, started
from pellicle.cli.messages import PixelProgress, as_flags, say, show
from pellicle.cli.session import GOOD, INTERRUPTED, UNCLEAR, check_folder, start


@dataclass(frozen=True)
class SeriesFlags(Flags):
    """Flags of the computation of a series, None where not given."""

    time_from: Annotated[str | None, flag(READING)] = None
    """Times of files: name (the number that differs), mtime, header, or a table of file and time (s)."""
    workers: Annotated[int | None, flag(RUN)] = None
    """Processes on this machine, one thread each (its cores, if that saves time)."""
    resume: Annotated[bool | None, flag(OUTPUT)] = None
    """Go on with the series that an earlier run left in --out (the default)."""
    overwrite: Annotated[bool | None, switch(OUTPUT, "Replace a series that is in --out.")] = None


def series(
    *data: Annotated[
        str,
        Parameter(help="Files of all times, a table with a column for each, or a cube with an axis time."),
    ],
    recipe: Annotated[str, Parameter(help="TOML file that describes the film, with a free thickness.")],
    run: Annotated[SeriesFlags | None, Parameter(name="*")] = None,
    cube: Annotated[CubeFlags | None, Parameter(name="*")] = None,
    out: Annotated[str | None, flag(OUTPUT, "Folder for the series, report and figure.")] = None,
    json: Annotated[bool, switch(OUTPUT, "Print one JSON object.")] = False,
) -> int:
    """Fit a film that changes: thickness and rate against time from all spectra together.

    The thickness varies slowly, and other free numbers are the same at all times, unless a recipe says
    `varies = "slowly"`, "freely" or "shared" beside their bounds. Continuity decides orders of interference
    that single spectra leave open; jumps and gaps are found. The exit code is 4 where fewer than half of the
    times have one thickness.

    Example: pellicle series run_*.csv --recipe growth.toml --out growth
    """
    described = film_recipe(recipe, "describes a surface, and a series needs the recipe of a film")
    run, cube = run or SeriesFlags(), cube or CubeFlags()
    if out is not None:
        check_folder(out)
    scene = described.scene(fitted=True)
    options: dict[str, Any] = {name: value for name, value in vars(run).items() if value is not None}
    start()
    from pellicle.api import maps
    from pellicle.reporting.series import report, to_json, write_series

    source: Any = data[0] if len(data) == 1 else list(data)
    folder = None if out is None else Path(out)
    progress = PixelProgress("series")
    options |= cube.arguments(described) | {"recipe": Path(described.path).read_text(encoding="utf-8")}
    try:
        with progress, started(folder, progress):
            store = None if folder is None else folder / STORE
            made = maps.series(source, scene, out=store, progress=progress, **options)
    except KeyboardInterrupt:
        kept = f"; they are kept in {folder}, and the same command goes on from there" if folder else ""
        say(f"interrupted after {progress.done} of {progress.total} times{kept}")
        return INTERRUPTED
    show(to_json(made) if json else as_flags(report(made)), folder is not None)
    if folder is not None:
        say(f"{write_series(folder, made)}: series.nc, series.csv, report and figure written")
    return GOOD if made.decided >= MOST_DECIDED else UNCLEAR
