"""Progress of long work, reported to whoever asked."""

from collections.abc import Callable

Progress = Callable[[str, int, int], None]
"""Called with the name of a stage, how much is done and how much there is."""


def quiet(stage: str, done: int, total: int) -> None:
    """A no-op progress callback."""
