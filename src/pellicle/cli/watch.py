"""`pellicle watch`: fits of the spectra of a folder as their files arrive, with a page that is redrawn."""

from __future__ import annotations

import os
import time
from contextlib import nullcontext
from json import loads
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from pellicle.cli.flags import OUTPUT, CubeFlags, flag, switch
from pellicle.cli.map import RUN, film_recipe
from pellicle.cli.messages import say, show
from pellicle.cli.series import TimeFrom
from pellicle.cli.session import GOOD, check_folder, start
from pellicle.errors import DataError, UsageError

if TYPE_CHECKING:
    from pellicle.mapping.live_series import LiveFit, LiveSeries

_PAUSE = 0.005
"""Seconds between looks at the folder."""
STATE = "watch.json"
"""File in the folder of results with the scene and the first date of a watch."""


def watch(
    folder: Annotated[str, Parameter(help="Folder in which an instrument writes a file for each spectrum.")],
    *,
    recipe: Annotated[str, Parameter(help="TOML file that describes the film, with a free thickness.")],
    time_from: TimeFrom = None,
    idle: Annotated[
        float | None, flag(RUN, "End when no file has come for so many seconds (only by Ctrl-C).")
    ] = None,
    port: Annotated[int, flag(RUN, "Port of the page on this machine (0: a free one).")] = 0,
    no_page: Annotated[bool, switch(RUN, "Serve no page.")] = False,
    cube: Annotated[CubeFlags | None, Parameter(name="*")] = None,
    out: Annotated[str | None, flag(OUTPUT, "Folder for the table, with which a watch goes on.")] = None,
    json: Annotated[bool, switch(OUTPUT, "Print one JSON object a line.")] = False,
) -> int:
    """Fit spectra as their files arrive in a folder: a line for each, a table, and a page that is redrawn.

    A file is fitted once it is closed, and those that are there at first, too. A spectrum whose order of
    interference is open takes the one that continues the film before it; a jump is found. A file that cannot
    be read is said in one line. Ctrl-C ends the watch: the same command goes on with --out, and pellicle
    series joins all spectra to one fit.

    Example: pellicle watch measured --recipe film.toml --time-from mtime --out growth
    """
    described = film_recipe(recipe, "describes a surface, and a watch needs the recipe of a film")
    source, scene = _checked(folder, idle, out), described.scene(fitted=True)
    start()
    from pellicle.data.arrivals import Arrivals
    from pellicle.mapping.live_series import LiveSeries
    from pellicle.mapping.locks import held

    live = LiveSeries(scene, time_from, **(cube or CubeFlags()).arguments(described))
    table = None if out is None else _Table(Path(out), source, live)
    with nullcontext() if table is None else held(table.folder):
        if table is not None:
            table.open()
        besides = [Path(recipe), *([Path(time_from)] if time_from else [])]
        known = {name: fit.size for name, fit in live.fits.items()}
        arrivals = Arrivals(source, known, besides)
        if not no_page:
            from pellicle.explorer.live_page import LivePage

            say(f"page: {LivePage(live, f'Watch of {source.resolve().name}').serve(port)}")
        say(f"{folder}: watched; Ctrl-C ends it")
        try:
            _follow(arrivals, live, source, table, idle, json)
        except KeyboardInterrupt:
            say("")
        files = "1 file" if live.done == 1 else f"{live.done} files"
        told = f"{files}, {live.failed} of them not fitted" if live.failed else f"{files} fitted"
        say(told + (f"; the same command goes on with {out}" if out else ""))
    return GOOD


def _checked(folder: str, idle: float | None, out: str | None) -> Path:
    """The folder to watch. Raises DataError or UsageError for what cannot be watched."""
    source = Path(folder)
    if not source.is_dir():
        raise DataError(f"{folder}: is no folder; name the one in which the instrument writes its files")
    if idle is not None and not idle > 0:
        raise UsageError(f"--idle must be above zero, got {idle:g}")
    if out is not None:
        check_folder(out)
        if Path(out).resolve() == source.resolve():
            raise UsageError("--out must be another folder than the one of the data")
    return source


def _follow(
    arrivals: Any, live: LiveSeries, source: Path, table: _Table | None, idle: float | None, json: bool
) -> None:
    """Fit files as they are finished, until none has come for `idle` seconds."""
    from pellicle.reporting.live_series import line, to_json

    last = time.monotonic()
    while idle is None or time.monotonic() - last < idle:
        for path in arrivals.finished():
            if path.name in live.fits:
                say(f"{path.name}: was written again, and is fitted again")
            fit = live.fit(path)
            if table is not None:
                table.add(fit)
            about = fit, live.parameters, live.unit
            show(to_json(*about, source) if json else line(*about))
            last = time.monotonic()
        time.sleep(_PAUSE)


class _Table:
    """The table of a watch in its folder, a row for each file, and what an earlier run left there."""

    def __init__(self, folder: Path, source: Path, live: LiveSeries):
        from pellicle.data.fingerprint import fingerprint
        from pellicle.files import MARKER, new_folder, write_text
        from pellicle.reporting.json_record import indented, versions
        from pellicle.reporting.live_series import CSV, SCHEMA

        self.folder, self.live, self.path = new_folder(folder), live, folder / CSV
        self.identity = fingerprint(str(source.resolve()), live.scene, live.reading)
        if not (folder / MARKER).exists():
            begun = {"schema": SCHEMA, "status": "running", "versions": versions()}
            write_text(folder / MARKER, indented(begun))
        self.waiting: list[LiveFit] = []  # files that failed before one had a time with its unit

    def open(self) -> None:
        """Take over the fits of an earlier run. Raises UsageError for those of another scene."""
        from pellicle.reporting.live_series import read

        state = self.folder / STATE
        if not state.exists() or not self.path.exists():
            return
        known = loads(state.read_text(encoding="utf-8"))
        if known.get("identity") != self.identity:
            raise UsageError(
                f"{self.folder}: is of another folder, scene or way of reading; choose another `out`"
            )
        text = self.path.read_text(encoding="utf-8")
        fits, unit = read(text, self.live.parameters, self.path)
        with self.path.open("rb+") as file:  # a row without its end is of a machine that lost its power
            file.truncate(len(text[: text.rfind("\n") + 1].encode()))
        self.live.origin, self.live.unit = float(known["origin"]), unit
        self.live.restore(fits)
        say(f"{len(fits)} files were fitted by an earlier run; they are in {self.path}")

    def add(self, fit: LiveFit) -> None:
        """Append the row of a fit."""
        from pellicle.files import not_written, write_text
        from pellicle.reporting.json_record import indented
        from pellicle.reporting.live_series import head, row
        from pellicle.reporting.plain_text import csv_rows

        self.waiting.append(fit)
        if not self.live.unit:
            return
        try:
            if not self.path.exists():
                about = {"identity": self.identity, "origin": self.live.origin}
                write_text(self.folder / STATE, indented(about), overwrite=True)
                write_text(self.path, csv_rows(head(self.live.parameters, self.live.unit), []))
            with self.path.open("a", encoding="utf-8", newline="") as file:
                file.write("".join(row(one, self.live.parameters) for one in self.waiting))
                file.flush()
                os.fsync(file.fileno())
        except OSError as error:
            raise not_written(self.path, error) from None
        self.waiting.clear()
