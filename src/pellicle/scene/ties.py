"""Tied numbers of a scene: expressions of its other numbers, resolved by their names."""

from typing import Any, final

import equinox as eqx
import jax
import numpy as np

from pellicle.errors import UsageError, did_you_mean
from pellicle.scene import expressions
from pellicle.scene.expressions import Expression
from pellicle.scene.free import Tie, check_parts, free_leaves, is_free, labelled, tied
from pellicle.scene.names import full_name, layer_name, location_of, unit_of

_UNIT_WORDS = ("nm", "um", "mm", "cm", "deg", "eV", "percent")


@final
class Tied(eqx.Module):
    """A number that is an expression of other numbers of its scene, in place of a number.

    **Arguments:** `expression` of numbers, names, + - * / ** and parentheses. Names are those of the results
    of a fit: `thickness` and `n` of the only layer, `NAME.thickness` or `layer2.n` of one of several,
    `substrate.n`, `instrument.bandwidth`; a layer whose name is no word stands in quotes, as
    "2 * 'top-1'.thickness". Numbers have the unit of what they are added to.

    A tied number is not fitted: it follows the free numbers that it names, and so do derivatives and errors.
    Its bounds are the range of the expression over theirs (interval arithmetic).

    **Raises:** UsageError for anything else in the expression; in a `Scene` for an unknown name, a circle of
    ties, a unit that is not that of the number, and a range that the number cannot have.

    >>> Tied("2 * wetting.thickness + 1.5").expression
    '2 * wetting.thickness + 1.5'
    """

    expression: str = eqx.field(static=True)

    def __init__(self, expression: str):
        if not isinstance(expression, str):
            raise UsageError(f'a tied number is a text, as pl.Tied("2 * film.thickness"), not {expression!r}')
        expressions.parsed(expression)
        self.expression = expression.strip()


def bound(scene: Any, again: bool = False) -> Any:
    """Return a scene whose tied numbers know the free numbers that they name.

    With `again` those that do already are resolved anew, by their names. **Raises:** UsageError as `Tied`.
    """
    binding = _Binding(scene, again)
    return binding.result() if binding.loose else scene


class _Binding:
    """Leaves of a scene by their names, some of them `loose`: positions of ties without numbers."""

    def __init__(self, scene: Any, again: bool):
        self.scene = scene
        leaf = lambda x: is_free(x) or type(x) is Tied  # noqa: E731
        pairs, self.structure = jax.tree_util.tree_flatten_with_path(scene, is_leaf=leaf)
        self.paths, self.leaves = [path for path, _ in pairs], [leaf for _, leaf in pairs]
        labels = [x.label for x in self.leaves if is_free(x) and x.label is not None]
        known = set(labels) if len(labels) == len(set(labels)) and not again else set()

        def is_loose(x: Any) -> bool:
            if not is_free(x):
                return type(x) is Tied
            return x.tie is not None and x.tie.text is not None and not x.tie.labels <= known

        self.loose = [i for i, x in enumerate(self.leaves) if is_loose(x)]
        self.resolved: dict[int, Any] = {}
        if not self.loose:
            return
        self.places: dict[str, int] = {}
        self.units: dict[str, str] = {}
        self.own: dict[int, str] = {}
        for i, (path, x) in enumerate(zip(self.paths, self.leaves, strict=True)):
            if path[0].name == "reference" and i in self.loose:
                self._add(i, path)  # it follows the sample, whose numbers do not name it
            if path[0].name in ("reference", "uncertainty") or (
                not hasattr(path[-1], "name") and len(path) < 3
            ):
                continue
            if is_free(x) or type(x) is Tied or (isinstance(x, int | float | np.number) and np.ndim(x) == 0):
                self._add(i, path)

    def _add(self, i: int, path: tuple) -> None:
        location = location_of(self.scene, path)
        name = full_name(self.scene, path, location.name)
        if path[0].name == "reference":
            self.units[name], self.own[i] = unit_of(location), name
            return
        aliases = [name]
        if path[0].name == "layers":
            aliases.append(f"{layer_name(self.scene, path[1].idx)}.{location.name}")
        for alias in aliases:
            self.places.setdefault(alias, i)
            self.units.setdefault(alias, unit_of(location))
        self.own[i] = name

    def result(self) -> Any:
        for i in self.loose:
            self._resolve(i, ())
        leaves = [self.resolved.get(i, x) for i, x in enumerate(self.leaves)]
        scene = jax.tree_util.tree_unflatten(self.structure, leaves)
        try:
            parts = scene.substrate, scene.ambient, scene.light, scene.instrument, scene.reference
            check_parts((*scene.layers, *parts))
        except ValueError as error:
            ranges = [
                f"{self.own[i]} = {self._text(i)!r} goes from {x.lower:g} to {x.upper:g}"
                for i in self.loose
                if is_free(x := leaves[i])
            ]
            raise UsageError(f"{error}; over the bounds of what it names, {', and '.join(ranges)}") from None
        return scene

    def _text(self, i: int) -> str:
        leaf = self.leaves[i]
        return leaf.expression if type(leaf) is Tied else leaf.tie.text

    def _resolve(self, i: int, chain: tuple[int, ...]) -> None:
        """Make a loose number one that is tied to labels of free numbers."""
        if i in chain:
            circle = [self.own[j] for j in (*chain[chain.index(i) :], i)]
            raise UsageError(f"tied numbers go in a circle: {' → '.join(circle)}: give one of them a number")
        if i in self.resolved:
            return
        name, text = self.own[i], self._text(i)
        named = expressions.parsed(text)
        for each in expressions.names(named):
            self._check_name(str(each), name, text)
        try:
            unit = expressions.unit(named, lambda x: self.units[x])
            if unit is not None and unit != expressions.unit(("name", name), lambda x: self.units[x]):
                own = _in(self.units[name] or "without unit")
                raise UsageError(
                    f"is {_in(expressions.spelled(unit))}, and {name} {own}"
                    " (a quotient of two numbers of one unit has none)"
                )
            tree = expressions.replaced(named, lambda x: self._operand(self.places[x], (*chain, i)))
            free = {x.label: x for x in (*self.leaves, *self.resolved.values()) if is_free(x) and x.label}
            ends = expressions.interval(tree, lambda label: (free[label].lower, free[label].upper))
            start = float(expressions.value(tree, lambda label: free[label].start))
            self.resolved[i] = tied(*ends, start, Tie(tree, text))
        except UsageError as error:
            if any(words in str(error) for words in ("circle", "is tied", "must be")):
                raise
            raise UsageError(f"{name} is tied to {text!r}, which {error}") from None

    def _check_name(self, word: str, name: str, text: str) -> None:
        if word in self.places:
            return
        if word in _UNIT_WORDS:
            raise UsageError(
                f"{name} is tied to {text!r}: numbers in an expression have no unit, leave out {word}"
            )
        known = sorted({self.own[i] for i in self.places.values()} - {name})
        raise UsageError(
            f"{name} must be a number or an expression of other numbers of the scene: {text!r} names"
            f" {word!r}, which it lacks{did_you_mean(word, self.places)}; it has {', '.join(known)}"
        )

    def _operand(self, i: int, chain: tuple[int, ...]) -> Expression:
        if i in self.loose:
            self._resolve(i, chain)
        leaf = self.resolved.get(i, self.leaves[i])
        if not is_free(leaf):
            return "number", float(leaf)
        if leaf.tie is not None:
            return leaf.tie.tree
        if leaf.label is None:
            taken = {x.label for x in (*self.leaves, *self.resolved.values()) if is_free(x)}
            label = self.own[i]
            while label in taken:
                label += "'"
            leaf = self.resolved[i] = labelled(leaf, label)
        return "name", leaf.label


def _in(unit: str) -> str:
    return unit if unit == "without unit" else f"in {unit}"


def tied_leaves(scene: Any) -> list[tuple[Any, Any]]:
    """Return (path, Free) of every tied number of a scene."""
    leaves = jax.tree_util.tree_leaves_with_path(scene, is_leaf=is_free)
    return [(path, x) for path, x in leaves if is_free(x) and x.tie is not None]


def touches_ties(scene: Any, part: Any) -> bool:
    """Return True where a part of a scene is tied to another part, or another part to it."""
    own = {free.label for _, free in free_leaves(part)} - {None}
    outside = [x.tie.labels for _, x in tied_leaves(scene)]
    return bool(tied_leaves(part)) or any(own & labels for labels in outside)
