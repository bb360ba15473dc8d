"""`pellicle series`: thickness and rate of a film against time, from all spectra together."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Group, Parameter

from pellicle.cli.flags import OUTPUT, READING, CameraFlags, CubeFlags, Flags, flag, switch
from pellicle.cli.map import MOST_DECIDED, StoreFlags, again, film_recipe, fitted, refuse
from pellicle.cli.messages import as_flags, say, show
from pellicle.cli.session import GOOD, INTERRUPTED, UNCLEAR, check_folder, start
from pellicle.errors import UsageError

if TYPE_CHECKING:
    from pellicle.recipes.read import FilmRecipe

MOVIES = Group("Movies", sort_key=5)

TimeFrom = Annotated[
    str | None,
    flag(
        READING,
        "Times of files: name (the number that differs), mtime, header, or a table of file, time (s).",
    ),
]
"""The flag --time-from."""
_OF_BOTH = ("--signal", "--wavelengths")


@dataclass(frozen=True)
class MovieFlags(Flags):
    """Flags of the frames of a movie, None where not given."""

    frame_rate: Annotated[float | None, flag(MOVIES)] = None
    """Frames per second, by the numbers in the names of the frames."""
    strip: Annotated[str | None, flag(MOVIES, "X0,Y0,X1,Y1: ends of a line, in pixels.")] = None
    region: Annotated[str | None, flag(MOVIES, "X,Y,WIDTH,HEIGHT in pixels (the whole frame).")] = None
    points: Annotated[
        str | None, flag(MOVIES, "X,Y of places for thinning laws, of a line X; ';' between several.")
    ] = None


def series(
    *data: Annotated[
        str,
        Parameter(
            help="Files of all times, a table with a column for each, a cube with an axis time, or the "
            "frames of a movie."
        ),
    ],
    recipe: Annotated[str, Parameter(help="TOML file that describes the film, with a free thickness.")],
    time_from: TimeFrom = None,
    run: Annotated[StoreFlags | None, Parameter(name="*")] = None,
    cube: Annotated[CubeFlags | None, Parameter(name="*")] = None,
    movie: Annotated[MovieFlags | None, Parameter(name="*")] = None,
    camera: Annotated[CameraFlags | None, Parameter(name="*")] = None,
    out: Annotated[str | None, flag(OUTPUT, "Folder for the series, report and figure.")] = None,
    json: Annotated[bool, switch(OUTPUT, "Print one JSON object.")] = False,
) -> int:
    """Fit a film that changes: thickness and rate against time from all spectra together.

    The thickness varies slowly, and other free numbers are the same at all times, unless a recipe says
    `varies = "slowly"`, "freely" or "shared" beside their bounds. Continuity decides orders of interference
    that single spectra leave open; jumps and gaps are found. The exit code is 4 where fewer than half of the
    times have one thickness.

    Frames of a movie, a folder of images or a TIFF of pages, give the thickness at each place: gain and dark
    level come from the fringes, the order from continuity and from the black film, where one appears.

    Example: pellicle series run_*.csv --recipe growth.toml --out growth

    Example: pellicle series frames --recipe soap.toml --frame-rate 25 --strip 40,10,40,470 --out drained
    """
    from pellicle.data.movies import is_movie

    described = film_recipe(recipe, "describes a surface, and a series needs the recipe of a film")
    run, cube = run or StoreFlags(), cube or CubeFlags()
    movie, camera = movie or MovieFlags(), camera or CameraFlags()
    source: Any = data[0] if len(data) == 1 else list(data)
    if is_movie(source):
        refuse(data[0], "movie", "spectra", [x for x in (*run.given(), *cube.given()) if x not in _OF_BOTH])
        return _movie(source, described, {"time_from": time_from} | vars(movie), cube, camera, out, json)
    refuse(data[0], "series of spectra", "movies", [*movie.given(), *camera.given()])
    run.check(out)
    if out is not None:
        check_folder(out)
    scene = described.scene(fitted=True)
    given = vars(run) | {"time_from": time_from}
    options: dict[str, Any] = {name: value for name, value in given.items() if value is not None}
    start()
    from pellicle.reporting.series import report, to_json, write_series

    folder = None if out is None else Path(out)
    options |= cube.arguments(described) | {"recipe": Path(described.path).read_text(encoding="utf-8")}
    made = fitted("series", source, scene, folder, options)
    if made is None:
        return INTERRUPTED
    show(to_json(made) if json else as_flags(report(made)), folder is not None)
    if folder is not None:
        flags = vars(run) | vars(cube) | {"time_from": time_from}
        repeated = again("series", source, described.path, flags, options, str(out))
        repeated.append(("Recipe", options["recipe"]))
        say(f"{write_series(folder, made, repeated)}: series.nc, series.csv, report and figure written")
    return GOOD if made.decided >= MOST_DECIDED else UNCLEAR


def _movie(
    source: Any,
    described: FilmRecipe,
    flags: dict[str, Any],
    cube: CubeFlags,
    camera: CameraFlags,
    out: str | None,
    json: bool,
) -> int:
    """Fit the frames of a movie; print and write the result."""
    stated: dict[str, Any] = camera.options().given()
    seen = described.camera | stated
    if idle := [x for x in ("chart", "white", "white_balance") if seen.pop(x, None) is not None]:
        raise UsageError(
            f"`{idle[0]}` is not of movies, whose fringes give the gain of each channel: leave it out"
        )
    transmitted = seen.pop("transmitted", False)
    signal = cube.signal or described.tables.data.signal
    if signal not in (None, "R", "T", "srgb", "rgb"):
        raise UsageError(f"a movie has the signal srgb or rgb, not {signal}")
    if out is not None:
        check_folder(out)
    scene = described.scene()
    start()
    import equinox as eqx

    from pellicle.api import maps
    from pellicle.reporting.movie import report, to_json, write_movie

    if transmitted or signal == "T":
        scene = eqx.tree_at(lambda s: s.light, scene, replace(scene.light, signal="T"))
    options = {"wavelengths": cube.wavelengths, "space": signal if signal in ("srgb", "rgb") else None}
    options |= flags | seen
    options = {name: x for name, x in options.items() if x is not None}
    made = maps.series(source, scene, **options)
    show(to_json(made) if json else as_flags(report(made)), out is not None)
    if out is not None:
        given = flags | vars(cube) | vars(camera)
        repeated = again("series", source, described.path, given, options, out)
        repeated.append(("Recipe", Path(described.path).read_text(encoding="utf-8")))
        say(f"{write_movie(out, made, repeated)}: series.nc, series.csv, report and figure written")
    return GOOD if made.decided >= MOST_DECIDED else UNCLEAR
