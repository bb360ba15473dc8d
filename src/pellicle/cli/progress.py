"""Progress of long work on stderr: one line of stage, steps and time left, or the log of `--verbose`.

Not by rich, whose bars have no place for whether JAX compiles, and whose rate would include the compilation.
"""

from __future__ import annotations

import logging
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from shutil import get_terminal_size
from typing import Any

from pellicle.cli.session import as_flags

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

    clock, compilation, level = _Clock(), _Compilation(), LOG.level
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(clock)
    monitoring.register_event_duration_secs_listener(compilation)
    LOG.addHandler(handler)
    LOG.setLevel(logging.INFO)
    try:
        yield
    finally:
        LOG.info("time: %.2f s, %s", clock.seconds, compilation)
        LOG.setLevel(level)
        LOG.removeHandler(handler)
        monitoring.unregister_event_duration_listener(compilation)


class _Clock(logging.Formatter):
    """Formats a record as one line: the seconds since the start, then the message."""

    def __init__(self):
        super().__init__()
        self.began = time.perf_counter()

    @property
    def seconds(self) -> float:
        return time.perf_counter() - self.began

    def format(self, record: logging.LogRecord) -> str:
        return f"{self.seconds:6.2f} s  {as_flags(record.getMessage())}"


class _Compilation:
    """Counts the programs that JAX compiles or loads, and the seconds that it takes."""

    def __init__(self):
        self.seconds, self.programs = 0.0, 0

    def __call__(self, event: str, duration_secs: float, **_: Any) -> None:
        if event.startswith(_COMPILE):
            self.seconds += duration_secs
            self.programs += event == _COMPILED

    def __str__(self) -> str:
        return f"{self.seconds:.2f} s of them to compile or load {self.programs} programs"


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
