"""Messages and progress on stderr, results on stdout; Python arguments in messages become flags.

The library names arguments in backticks, as a Python caller writes them: `` `scale="slow"` ``. The
command line prints the flag: `--scale slow`. Other text in backticks is not changed.

Progress is not by rich, whose bars have no place for whether JAX compiles, and whose rate would include the
compilation.
"""

from __future__ import annotations

import ast
import logging
import os
import re
import shlex
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from functools import cache
from shutil import get_terminal_size
from typing import TYPE_CHECKING, Any

from pellicle.cli.flags import Flags

if TYPE_CHECKING:
    from pellicle.fitting.result import Fit


_OTHER_NAMES = {"folder": "--out", "path": "--out", "space": "--signal"}
"""Flags of arguments that have another name."""
_COMMAND_ARGUMENTS = (
    *("depth", "joint", "no_browser", "numbers", "port", "posterior", "recipe", "repeats", "strip"),
    *("allow", "among", "budget", "family", "idle", "next", "no_page", "roughness_map", "thickness_map"),
    *("angles", "noise_degrees", "polarisations", "signals", "time_from", "to"),
)
"""Flags that one command has outside the groups of `pellicle.cli.flags`."""
_NEGATIVES = {"folded=False": "--no-folded", "resume=False": "--no-resume"}

_QUOTED = re.compile(r"`([^`]+)`")


@cache
def flag_names() -> dict[str, str]:
    """The flag of each argument that a message may name: that of a command, of the same name."""
    groups = [Flags]
    for group in groups:
        groups += group.__subclasses__()
    names = {name for group in groups for name in getattr(group, "__dataclass_fields__", ())}
    names.update(_COMMAND_ARGUMENTS)
    return {name: f"--{name.replace('_', '-')}" for name in names} | _OTHER_NAMES


def as_flags(text: str) -> str:
    """Replace arguments in backticks by flags.

    `` `thickness` `` becomes `--thickness`, `` `angle=70` `` `--angle 70`, `` `range=(400, 900)` `` and
    `` `thickness=Free(10, 3000)` `` bounds (`--range 400:900`), `` `columns=["wavelength", "R"]` `` a list
    (`--columns wavelength,R`), and `` `folded=True` `` a flag without a value.
    """
    return _QUOTED.sub(lambda quoted: _flags(quoted[1]) or quoted[0], text)


def _flags(code: str) -> str | None:
    """The flags of the arguments in `code`, None where one of them has no flag."""
    call = f"f({code})"
    try:
        parsed = ast.parse(call, mode="eval").body
    except SyntaxError:
        return None
    if not isinstance(parsed, ast.Call):
        return None
    words: list[str | None] = [flag_names().get(getattr(name, "id", "")) for name in parsed.args]
    for keyword in parsed.keywords:
        flag, value = flag_names().get(keyword.arg or ""), _word(keyword.value, call)
        stated = None if flag is None or value is None else f"{flag} {value}".rstrip()
        words.append(_NEGATIVES.get(f"{keyword.arg}={ast.unparse(keyword.value)}", stated))
    return None if None in words else " ".join(map(str, words))


def _word(value: ast.expr, source: str) -> str | None:
    """A value as it is typed after its flag: empty for True, None where no flag says it."""
    match value:
        case ast.Constant(value=True):
            return ""
        case ast.Constant(value=False | None):
            return None
        case ast.Constant(value=str(text)):
            return shlex.quote(text)
        case (
            ast.Call(func=ast.Name(id="Free"), args=items, keywords=[])
            | ast.Tuple(elts=items)
            | ast.List(items)
        ):
            words = [_word(item, source) for item in items]
            between = "," if isinstance(value, ast.List) else ":"
            return None if None in words else between.join(map(str, words))
        case ast.Call():
            return None
    return ast.get_source_segment(source, value)


def with_flags(fit: Fit) -> Fit:
    """A copy of a fit whose verdict and warnings name flags."""
    return replace(fit, verdict=as_flags(fit.verdict), warnings=tuple(map(as_flags, fit.warnings)))


def say(*sentences: str) -> None:
    """Print to stderr; arguments in backticks become flags. A closed pipe is no error."""
    for sentence in sentences:
        with suppress(BrokenPipeError):
            print(as_flags(sentence), file=sys.stderr)


def show(result: str | dict[str, Any], files_follow: bool = False, end: str = "\n") -> None:
    """Print a result to stdout, a JSON record on one line.

    Where the pipe is closed, as by `| head`, this ends the command, unless files are still to be written.
    """
    if not isinstance(result, str):
        from pellicle.reporting.json_record import one_line

        result = one_line(result)
    try:
        print(result, end=end, flush=True)
    except BrokenPipeError:
        if not files_follow:
            raise
        abandon_stdout()


def abandon_stdout() -> None:
    """Discard what stdout cannot take, which Python would try to write once more when it ends."""
    with suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


LOG = logging.getLogger("pellicle")
_COMPILE, _COMPILED = "/jax/core/compile/", "/jax/core/compile/backend_compile_duration"
"""JAX's prefix of the durations of tracing, lowering and compiling, and its name of the last one."""
COMPILING = "compiling (only in the first run of a kind of scene)"
_LOWERED = "/jax/core/compile/jaxpr_to_mlir_module_duration"
"""JAX's name of the duration that ends right before it compiles a program; `_COMPILED` ends right after."""
_SHORTEST = 5.0
"""Seconds left that are worth a word."""
_AT_MOST = ("sample",)
"""Stages that often end before their last step."""


@contextmanager
def log_to_stderr() -> Iterator[None]:
    """Write the library's log messages to stderr, with the seconds since the start of the block."""
    import jax.monitoring as monitoring

    clock, level = _Clock(), LOG.level
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(clock)
    monitoring.register_event_duration_secs_listener(clock.listen)
    LOG.addHandler(handler)
    LOG.setLevel(logging.INFO)
    try:
        yield
    finally:
        LOG.info("%s", clock)
        LOG.setLevel(level)
        LOG.removeHandler(handler)
        monitoring.unregister_event_duration_listener(clock.listen)


class _Clock(logging.Formatter):
    """Formats a record as one line, the seconds since the start and the message; as a listener it counts the
    programs that JAX compiles or loads, and the seconds that it takes."""

    def __init__(self):
        super().__init__()
        self.began, self.compiling, self.programs = time.perf_counter(), 0.0, 0

    def format(self, record: logging.LogRecord) -> str:
        return f"{time.perf_counter() - self.began:6.2f} s  {as_flags(record.getMessage())}"

    def listen(self, event: str, duration_secs: float, **_: Any) -> None:
        if event.startswith(_COMPILE):
            self.compiling += duration_secs
            self.programs += event == _COMPILED

    def __str__(self) -> str:
        spent = f"{self.compiling:.2f} s of them to compile or load {self.programs} programs"
        return f"time: {time.perf_counter() - self.began:.2f} s, {spent}"


class TimeLeft:
    """Estimate of the time that a stage still takes.

    The first step of a stage is left out: it includes the compilation.
    """

    def __init__(self):
        self.stage, self.first, self.began = "", 0, 0.0

    def __call__(self, stage: str, done: int, total: int) -> float:
        """Seconds that are left, 0 while nothing is known."""
        now = time.monotonic()
        if stage != self.stage or done <= self.first or not self.first:
            self.stage, self.first, self.began = stage, done, now
            return 0.0
        return (now - self.began) / (done - self.first) * (total - done)


class Progress:
    """Progress line on stderr, overwritten at each step; silent without a terminal and with --verbose."""

    def __init__(self, label: str):
        self.label, self.steps, self.shown, self.compiling = label, "", False, False
        self.left = TimeLeft()
        self.visible = sys.stderr.isatty() and not LOG.isEnabledFor(logging.INFO)
        if self.visible:
            import jax.monitoring as monitoring

            monitoring.register_event_duration_secs_listener(self._compilation)

    def __call__(self, stage: str, done: int, total: int) -> None:
        left = duration(self.left(stage, done, total))
        bound = stage in _AT_MOST and done < total
        self.steps = f"{stage} {done} of at most {total}" if bound else f"{stage} {done}/{total}"
        self.steps += f", {'at most ' * bound}{left} left" if left else ""
        self._show()

    def __enter__(self) -> Progress:
        return self

    def __exit__(self, *_: object) -> None:
        """Remove the line, and stop listening to JAX."""
        self.clear()
        if self.visible:
            import jax.monitoring as monitoring

            monitoring.unregister_event_duration_listener(self._compilation)
        self.visible = False

    def clear(self) -> None:
        """Remove the line."""
        if self.shown:
            print("\r\033[K", end="", file=sys.stderr, flush=True)
        self.shown = False

    def _compilation(self, event: str, duration_secs: float, **_: Any) -> None:
        if event in (_LOWERED, _COMPILED):
            self.compiling = event == _LOWERED
            self._show()

    def _show(self) -> None:
        if self.visible:
            parts = [part for part in (self.steps, COMPILING * self.compiling) if part]
            line = f"{self.label}: {', '.join(parts)}"[: get_terminal_size().columns - 1]  # on one line
            print(f"\r{line}\033[K", end="", file=sys.stderr, flush=True)
            self.shown = True


class PixelProgress(Progress):
    """Progress line of a map: pixels, pixels per second and time left, counted from the first finished block,
    which includes the compilation."""

    def __init__(self, label: str):
        super().__init__(label)
        self.first: tuple[int, float] | None = None
        self.begun, self.done, self.total = -1, 0, 0

    def __call__(self, stage: str, done: int, total: int) -> None:
        """Show a step."""
        if stage != "pixels":
            self.steps = f"{stage}, {self._pixels()}" if self.total else stage
            return self._show()
        now, self.done, self.total = time.monotonic(), done, total
        if self.begun < 0:
            self.begun = done
        elif self.first is None:
            self.first = done, now
        self.steps = self._pixels()
        if self.first is not None and done > self.first[0]:
            rate = (done - self.first[0]) / max(now - self.first[1], 1e-3)
            left = duration((total - done) / rate)
            self.steps += f", {rate:.3g} pixels/s" + f", {left} left" * bool(left)
        return self._show()

    def _pixels(self) -> str:
        return f"pixels {self.done}/{self.total}"


def duration(seconds: float) -> str:
    """A time for a reader: `12 s`, `3 min`, `2.5 h`; empty where it is not worth a word."""
    if seconds < _SHORTEST:
        return ""
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"
