"""Who takes part in a comparison: what is installed, compiled once before anything is timed."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from typing import Protocol, TypeVar, runtime_checkable

from pellicle.ladder.climb import Progress


@runtime_checkable
class Entrant(Protocol):
    """Something with a name; `missing` is a package that it needs and that is not installed."""

    @property
    def name(self) -> str: ...

    @property
    def missing(self) -> str | None: ...


Kind = TypeVar("Kind", bound=Entrant)


def entrants(
    given: Sequence[Kind], first: Callable[[Kind], object], left_out: dict[str, str], progress: Progress
) -> Iterator[tuple[Kind, float]]:
    """Each that can take part, with the seconds of its `first` use, compilation included.

    The others go into `left_out`, with why.
    """
    for done, one in enumerate(given):
        progress(f"compile {one.name}", done, len(given))
        if one.missing:
            left_out[one.name] = f"{one.missing} is not installed"
            continue
        began = time.perf_counter()
        first(one)
        yield one, time.perf_counter() - began
