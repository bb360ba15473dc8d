"""`--verbose`: on stderr each step that the library logs, when it was, and where the time went."""

from __future__ import annotations

import logging
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from pellicle.cli.messages import as_flags

LOG = logging.getLogger("pellicle")
_MAKING, _DONE = "/jax/core/compile/", "/jax/core/compile/backend_compile_duration"
"""What JAX calls the times of tracing, lowering and compiling a program, and of the last of these."""


@contextmanager
def aloud() -> Iterator[None]:
    """While it lasts, what the library logs is written to stderr with the seconds since it began."""
    import jax.monitoring as monitoring

    clock, making, level = _Clock(), _Making(), LOG.level
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(clock)
    monitoring.register_event_duration_secs_listener(making)
    LOG.addHandler(handler)
    LOG.setLevel(logging.INFO)
    try:
        yield
    finally:
        LOG.info("time: %.2f s in all, %s", clock.seconds, making)
        LOG.setLevel(level)
        LOG.removeHandler(handler)
        monitoring.unregister_event_duration_listener(making)


class _Clock(logging.Formatter):
    """A record as one line: the seconds since the start, then the sentence."""

    def __init__(self):
        super().__init__()
        self.began = time.perf_counter()

    @property
    def seconds(self) -> float:
        return time.perf_counter() - self.began

    def format(self, record: logging.LogRecord) -> str:
        return f"{self.seconds:6.2f} s  {as_flags(record.getMessage())}"


class _Making:
    """Counts the programs that JAX made ready, and the seconds that it took."""

    def __init__(self):
        self.seconds, self.programs = 0.0, 0

    def __call__(self, event: str, duration_secs: float, **_: Any) -> None:
        if event.startswith(_MAKING):
            self.seconds += duration_secs
            self.programs += event == _DONE

    def __str__(self) -> str:
        return f"{self.seconds:.2f} s of it to trace and compile {self.programs} programs, or to load them"
