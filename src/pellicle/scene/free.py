"""Free parameters, which stand in a pytree in place of numbers, and pytrees as keys by their content."""

import math
from collections import OrderedDict
from collections.abc import Callable, Iterable
from functools import lru_cache, wraps
from typing import Any, NamedTuple, TypeGuard, TypeVar, final

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Float

from pellicle.errors import UsageError
from pellicle.scene import expressions
from pellicle.scene.priors import Normal, Prior

MOST_FREE = 64
"""Most parameters a fit may have free: 21 took 30 s and 121 did not end within 5 minutes (two cores)."""

VARIES = SLOWLY, FREELY, SHARED, MONOTONIC = "slowly", "freely", "shared", "monotonic"
"""Changes of a parameter in a series: steadily, from time to time, not at all, steadily in one direction."""


class Tie(NamedTuple):
    """Expression of labels of free numbers that a tied number follows; its text is None where anonymous."""

    tree: expressions.Expression
    text: str | None = None

    @property
    def labels(self) -> set[Any]:
        """Labels of the free numbers that it takes."""
        return set(expressions.names(self.tree))


@final
class Free(eqx.Module):
    """Parameter to be fitted, in place of a number.

    **Arguments:** `lower` and `upper` bounds, `start` value (the middle of the bounds if None) and `prior`
    (uniform between the bounds if None), all in the parameter's own unit. `limits` marks default bounds,
    which nobody chose for this sample: a fit of spectra may widen them up to these limits (lower, upper) of
    physics, and a best value on one of them is a remark, not the status `at-bound`. `varies`: how the
    parameter changes in a series, one of `VARIES`; None for the usual way. `first`, `last`: what is known of
    it at the first and at the last time of a series: a number, which only selects the order of interference
    nearest to it, or a `Normal`, which also counts as a measurement.

    **Raises:** ValueError where bounds are reversed or infinite, or the start or the prior is outside them,
    or they are outside the limits, or for another word of `varies`.

    >>> Free(10, 3000).start
    1505.0
    """

    lower: float = eqx.field(static=True)
    upper: float = eqx.field(static=True)
    start: float = eqx.field(static=True)
    limits: tuple[float, float] | None = eqx.field(static=True)
    prior: Prior | None
    varies: str | None = eqx.field(static=True)
    first: Normal | float | None = eqx.field(static=True)
    last: Normal | float | None = eqx.field(static=True)
    label: Any = eqx.field(static=True)
    """By which ties know it; None where none does."""
    tie: Tie | None = eqx.field(static=True)
    """Of a tied number, which has the bounds of its expression and is no parameter; None else."""

    def __init__(
        self,
        lower: float,
        upper: float,
        *,
        start: float | None = None,
        prior: Prior | None = None,
        limits: tuple[float, float] | None = None,
        varies: str | None = None,
        first: Normal | float | None = None,
        last: Normal | float | None = None,
    ):
        given = {"lower": lower, "upper": upper, "start": start}
        for name, value in given.items():
            if value is not None and not isinstance(value, int | float | np.number):
                raise UsageError(f"`{name}` of a free parameter must be a number, not {value!r}")
        if not lower < upper:
            raise ValueError(f"bounds are reversed or equal: lower {lower:g} is not below upper {upper:g}")
        if not (math.isfinite(lower) and math.isfinite(upper)):
            raise ValueError("a free parameter needs two finite bounds: give lower and upper")
        start = 0.5 * (lower + upper) if start is None else start
        if not lower <= start <= upper:
            raise ValueError(f"the start value {start:g} is outside its bounds {lower:g} to {upper:g}")
        if prior is not None:
            prior.check(lower, upper)
        if limits is not None and not limits[0] <= lower < upper <= limits[1]:
            raise ValueError(f"the bounds {lower:g} to {upper:g} are outside {limits[0]:g} to {limits[1]:g}")
        self.lower, self.upper, self.start, self.prior = float(lower), float(upper), float(start), prior
        if varies is not None and varies not in VARIES:
            raise ValueError(f"`varies` must be one of {', '.join(VARIES)}, not {varies!r}")
        for name, end in (("first", first), ("last", last)):
            mean = end.mean if isinstance(end, Normal) else end
            if mean is not None and not lower <= mean <= upper:
                raise ValueError(f"`{name}` is {mean:g}, outside the bounds {lower:g} to {upper:g}")
        self.limits, self.varies, self.label, self.tie = limits, varies, None, None
        self.first, self.last = first, last


def labelled(free: Free, label: Any) -> Free:
    """Return a free number with a label."""
    other = object.__new__(Free)
    for name, own in (vars(free) | {"label": label}).items():
        object.__setattr__(other, name, own)
    return other


def tied(lower: float, upper: float, start: float, tie: Tie) -> Free:
    """Return a tied number, whose bounds may be one. Raises UsageError for bounds that are not finite."""
    if not (math.isfinite(lower) and math.isfinite(upper)):
        raise UsageError("is not finite within its bounds")
    given: dict[str, Any] = dict.fromkeys(("prior", "limits", "varies", "first", "last", "label"))
    given["tie"], other = tie, object.__new__(Free)
    for name, own in {"lower": lower, "upper": upper, "start": start, **given}.items():
        object.__setattr__(other, name, own)
    return other


def check_free_count(count: int, least: int = 1) -> None:
    """Raise UsageError unless `count`, the number of free parameters, is `least` to `MOST_FREE`."""
    if count < least:
        raise UsageError(
            "nothing is free to fit: give bounds, as in `thickness=Free(10, 3000)`, or in a recipe"
            " thickness = { lower = 10, upper = 3000 }"
        )
    if count > MOST_FREE:
        raise UsageError(f"{count} parameters are free, more than the {MOST_FREE} that a fit takes: fix some")


def is_free(leaf: Any) -> TypeGuard[Free]:
    """Return True for a `Free`, which a traversal of a pytree must take as one leaf."""
    return type(leaf) is Free  # final; isinstance asks an abstract class


def free_leaves(tree: Any) -> list[tuple[Any, Free]]:
    """Return (path, Free) of every free parameter in a pytree, in the pytree's order.

    A tied number counts only in a part of a scene that lacks a number to which it is tied.
    """
    leaves = jax.tree_util.tree_leaves_with_path(tree, is_leaf=is_free)
    labels = {leaf.label for _, leaf in leaves if is_free(leaf)}
    return [(path, leaf) for path, leaf in leaves if is_free(leaf) and not _follows(leaf, labels)]


def _follows(leaf: Any, labels: set[Any]) -> bool:
    """True for a number tied to free ones of these labels."""
    return is_free(leaf) and leaf.tie is not None and leaf.tie.labels <= labels


def insert(tree: Any, values: Iterable[Any]) -> Any:
    """Replace the free parameters of a pytree by `values`, in the order of `free_leaves`, and what is tied
    to them by the values of their expressions.

    Where the values are `Free`, these get the labels of those that they replace, and ties their bounds.
    """
    leaves, structure = jax.tree_util.tree_flatten(tree, is_leaf=is_free)
    numbers, known = iter(values), dict[Any, Any]()
    labels = {leaf.label for leaf in leaves if is_free(leaf)}
    for i, leaf in enumerate(leaves):
        if not is_free(leaf) or _follows(leaf, labels):
            continue
        new = next(numbers)
        if leaf.label is not None:
            new = known[leaf.label] = labelled(new, leaf.label) if is_free(new) else new
        leaves[i] = new
    for i, leaf in enumerate(leaves):
        if is_free(leaf) and leaf.tie is not None and leaf.tie.labels <= known.keys():
            leaves[i] = _followed(leaf, leaf.tie, known)
    return jax.tree_util.tree_unflatten(structure, leaves)


def _followed(leaf: Free, tie: Tie, known: dict[Any, Any]) -> Any:
    """The value of a tie where its labels have values, or a tied number with the bounds of theirs."""
    if not any(is_free(known[label]) for label in tie.labels):
        return expressions.value(tie.tree, known.__getitem__)
    if tie.text is None:
        return leaf
    own = {label: x if is_free(x) else tied(x, x, x, tie) for label, x in known.items()}
    ends = expressions.interval(tie.tree, lambda label: (own[label].lower, own[label].upper))
    return tied(*ends, expressions.value(tie.tree, lambda label: own[label].start), tie)


def without_bounds(tree: Any) -> Any:
    """Return the pytree with free numbers, and tied ones, that know neither bounds nor names."""
    free = [leaf for _, leaf in free_leaves(tree)]
    labels = {x.label: i for i, x in enumerate(free) if x.label is not None}
    leaves, structure = jax.tree_util.tree_flatten(tree, is_leaf=is_free)

    def bare(x: Any) -> Any:
        if not is_free(x):
            return x
        if x.tie is not None and x.tie.labels <= labels.keys():
            tree = expressions.replaced(x.tie.tree, lambda label: ("name", labels[label]))
            return tied(0.0, 1.0, 0.5, Tie(tree))
        own = Free(0.0, 1.0, start=0.5)
        return own if x.label is None else labelled(own, labels[x.label])

    return jax.tree_util.tree_unflatten(structure, [bare(x) for x in leaves])


def check_parts(tree: object) -> None:
    """Run the checks of every module of a part of a scene, itself included, but of free parameters."""
    if isinstance(tree, tuple):
        parts = [*tree]
    elif isinstance(tree, eqx.Module) and not is_free(tree):
        getattr(tree, "__check_init__", lambda: None)()
        parts = [*vars(tree).values()]
    else:
        parts = []
    for part in parts:
        check_parts(part)


def start_values(tree: Any) -> Float[np.ndarray, " parameters"]:
    """Return the start value of each free parameter."""
    return np.array([free.start for _, free in free_leaves(tree)])


KEPT = 32
"""Results that a function keeps: a scene at some hundred wavelengths takes some ten kB."""

Result = TypeVar("Result")


_CONTENTS: OrderedDict[int, "Content"] = OrderedDict()


def constant(tree: Result) -> Result:
    """Mark a pytree as one that nobody changes, so that its content is read once."""
    _CONTENTS[id(tree)] = Content(tree)  # it keeps the tree, and with it the number
    if len(_CONTENTS) > 8 * KEPT:
        _CONTENTS.popitem(last=False)
    return tree


class Content:
    """A pytree of numbers and arrays that equals another one of the same structure and numbers."""

    def __init__(self, tree: Any):
        self.tree = tree
        leaves, structure = jax.tree_util.tree_flatten(tree)
        self._key = structure, tuple(_content(leaf) for leaf in leaves)
        self._hash = hash(self._key)

    def __hash__(self) -> int:
        return self._hash

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Content) and self._hash == other._hash and self._key == other._key


def _content(leaf: Any) -> Any:
    if isinstance(leaf, np.ndarray | np.generic | jax.Array):
        array = np.asarray(leaf)
        return type(leaf), array.dtype.str, array.shape, array.tobytes()
    return type(leaf), leaf


def remembered(function: Callable[..., Result]) -> Callable[..., Result]:
    """Keep the last results of a function of pytrees, by the content of its arguments.

    Equal scenes and grids are then prepared once. The function must be pure, and nobody may change what it
    returns. The content of a `constant` argument is not read again.
    """

    @lru_cache(maxsize=KEPT)
    def computed(*arguments: Content) -> Result:
        result = function(*(own.tree for own in arguments))
        return constant(result) if isinstance(result, eqx.Module) else result

    @wraps(function)
    def call(*arguments: Any) -> Result:
        return computed(*(_CONTENTS.get(id(own)) or Content(own) for own in arguments))

    return call
