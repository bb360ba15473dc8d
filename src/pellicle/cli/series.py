"""`pellicle series`: thickness and rate of a film against time, from all spectra together."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from pellicle.cli.flags import OUTPUT, READING, CubeFlags, flag, switch
from pellicle.cli.map import MOST_DECIDED, StoreFlags, film_recipe, fitted
from pellicle.cli.messages import as_flags, say, show
from pellicle.cli.session import GOOD, INTERRUPTED, UNCLEAR, check_folder, start

TimeFrom = Annotated[
    str | None,
    flag(
        READING,
        "Times of files: name (the number that differs), mtime, header, or a table of file, time (s).",
    ),
]
"""The flag --time-from."""


def series(
    *data: Annotated[
        str,
        Parameter(help="Files of all times, a table with a column for each, or a cube with an axis time."),
    ],
    recipe: Annotated[str, Parameter(help="TOML file that describes the film, with a free thickness.")],
    time_from: TimeFrom = None,
    run: Annotated[StoreFlags | None, Parameter(name="*")] = None,
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
    run, cube = run or StoreFlags(), cube or CubeFlags()
    run.check(out)
    if out is not None:
        check_folder(out)
    scene = described.scene(fitted=True)
    given = vars(run) | {"time_from": time_from}
    options: dict[str, Any] = {name: value for name, value in given.items() if value is not None}
    start()
    from pellicle.reporting.series import report, to_json, write_series

    source: Any = data[0] if len(data) == 1 else list(data)
    folder = None if out is None else Path(out)
    options |= cube.arguments(described) | {"recipe": Path(described.path).read_text(encoding="utf-8")}
    made = fitted("series", source, scene, folder, options)
    if made is None:
        return INTERRUPTED
    show(to_json(made) if json else as_flags(report(made)), folder is not None)
    if folder is not None:
        say(f"{write_series(folder, made)}: series.nc, series.csv, report and figure written")
    return GOOD if made.decided >= MOST_DECIDED else UNCLEAR
