"""Samples of a joint fit: their names, and the numbers that several of them share."""

from collections.abc import Sequence
from typing import Any, NamedTuple

from pellicle.errors import UsageError


class Sample(NamedTuple):
    """The sample of a scene among several: its name, and names of its numbers that it shares with others.

    `common` has the owner of each medium (a layer's name, or "substrate") with the words that tell it from
    another medium of an owner of that name: none where all samples have the same.
    """

    name: str
    shared: tuple[str, ...] = ()
    common: tuple[tuple[str, str], ...] = ()

    def called(self, aliases: Sequence[str], own: str = "") -> str:
        """The name of a number in a fit: the first of its `aliases` that is shared, else its `own` name or,
        without one, the last of them below the name of the sample."""
        shared = next((x for x in aliases if x in self.shared), "")
        return shared or own or f"{self.name}.{aliases[-1]}"

    def of(self, owner: str = "") -> str:
        """The words behind an effect on the medium of an owner, or on this sample alone."""
        return dict(self.common)[owner] if owner else f" of {self.name}"


def as_sample(given: Any) -> Sample | None:
    """Return a sample by its name. Raises UsageError for what is no name."""
    if given is None or isinstance(given, Sample):
        return given
    if not isinstance(given, str) or not given.strip() or "." in given:
        raise UsageError(f"a sample has a name without dots, as in sample='thin', not {given!r}")
    return Sample(given)
