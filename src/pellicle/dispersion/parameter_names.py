"""Names of numbers inside a dispersion: `A`, `B1`, `fraction`, `host.E0`, `term2.gamma`, `ordinary.n`."""

from __future__ import annotations

from typing import Any, NamedTuple

from pellicle.dispersion.anisotropic import Anisotropic
from pellicle.dispersion.base import AbstractDispersion

_BRANCHES = ("host", "inclusion", "first", "second")


class ParameterLocation(NamedTuple):
    """A number's full name in its dispersion, its last part, the field that holds it, and whose it is."""

    name: str
    key: str
    field: str
    owner: Any

    @property
    def unit(self) -> str:
        """The unit that the model gives it, empty for none."""
        if isinstance(self.owner, Anisotropic):
            return "deg"
        return getattr(self.owner, "units", {}).get(self.field, "")


def locate_parameter(tree: Any, path: tuple) -> ParameterLocation:
    """Location of the leaf at `path` (as of `jax.tree_util`) in a dispersion.

    The numbers of a tuple are counted from 1 (`B1`); a mixture's components and, where there are
    several, the terms of a sum go in front.
    """
    node: Any = tree
    owner: Any = tree
    field, count, words = "", "", []
    for depth, step in enumerate(path):
        if hasattr(step, "name"):
            owner, field, count = node, step.name, ""
            node = getattr(node, field)
            if isinstance(owner, Anisotropic):
                field = owner.names[field]
                if isinstance(getattr(owner, step.name), AbstractDispersion):
                    words.append(field)
            elif field in _BRANCHES:
                words.append(field)
            continue
        index = step.idx if hasattr(step, "idx") else step.key
        if depth == len(path) - 1:
            count = str(index + 1)
        elif len(node) > 1:
            words.append(f"term{index + 1}")
        node = node[index]
    return ParameterLocation(".".join([*words, field + count]), field + count, field, owner)
