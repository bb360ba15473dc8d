"""`--verbose`: log messages of the library on stderr, with times."""

from __future__ import annotations

import logging
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from pellicle.cli.messages import as_flags

LOG = logging.getLogger("pellicle")
_COMPILE, _COMPILED = "/jax/core/compile/", "/jax/core/compile/backend_compile_duration"
"""JAX's prefix of the durations of tracing, lowering and compiling, and its name of the last one."""


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
