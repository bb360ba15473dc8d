"""Layers of a stack as rows of arrays, for a loop over them.

The size of a program must not grow by all formulas of a layer for each layer. So indices that are equal are
evaluated and stored once, and rows are gathered from them; phases are one array.
"""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from pellicle.optics.anisotropy import Index, Principal
from pellicle.optics.gradient import Gradient
from pellicle.optics.pair import Number, Pair, imag, is_real, namespace, real, to_complex
from pellicle.optics.repeats import Repeats, places


@Sequence.register  # pyright: ignore[reportAttributeAccessIssue]
class StackedLayers(eqx.Module):
    """Refractive indices of homogeneous layers, a sequence in which equal ones are stored once.

    **Arguments:** `distinct`, an index with arrays (indices, ...); `order`, the position in it of each layer.
    """

    distinct: Number
    order: tuple[int, ...] = eqx.field(static=True)

    def __len__(self) -> int:
        return len(self.order)

    def __getitem__(self, which: Any) -> Any:
        if isinstance(which, slice):
            return StackedLayers(self.distinct, self.order[which])
        at = self.order[which]
        return jax.tree.map(lambda x: x[at], self.distinct)


def stacked(layers: Sequence[Number], like: Any) -> StackedLayers:
    """Return indices of layers in rows, in the precision of `like`; what is one object is one row."""
    keys = [tuple(map(id, jax.tree.leaves(layer))) for layer in layers]
    first = {key: at for at, key in reversed([*enumerate(keys)])}
    position = {key: row for row, key in enumerate(dict.fromkeys(keys))}
    distinct = [layers[first[key]] for key in position]
    shape = jnp.broadcast_shapes(*map(jnp.shape, jax.tree.leaves(distinct)))
    xp = namespace(distinct, like)
    parts = ([xp.broadcast_to(part(x), shape) for x in distinct] for part in (real, imag))
    re, im = (stack_numbers(part, like) for part in parts)
    joined = re if all(map(is_real, distinct)) else Pair(re, im)
    return StackedLayers(joined, tuple(position[key] for key in keys))


def stack_numbers(numbers: Sequence[Any], like: Any) -> Any:
    """Return numbers of any shapes as an array (numbers, ...), in the precision of `like` or a higher one."""
    dtype, xp = jnp.result_type(*numbers, like), namespace(*numbers)
    return xp.stack([x.astype(dtype) for x in xp.broadcast_arrays(*numbers)])


class LayerRows(NamedTuple):
    """Layers of a stack, those of a graded one its slices; each array has the shape (layers, ...)."""

    points: tuple[Any, ...]  # complex or `Principal` index, three at Gauss points where a layer is graded
    depth: Any  # k₀ times the thickness
    rough: Any  # k₀σ of each face, one more than layers; None where all are smooth
    runs: tuple[tuple[int, int], ...] = ()  # (repeats, rows) from the first row on; () is each row once


def layer_rows(
    media: tuple,
    layers: Any,  # a sequence of indices and gradients, or `StackedLayers`
    phases: Any,  # a sequence, or an array (layers, ...)
    roughness: Sequence[Any] | None,
) -> LayerRows:
    """Return the layers in the shape to which all arrays broadcast; `media` are those around them."""
    counts = slice_counts(layers)
    apart = not isinstance(layers, StackedLayers) and any(isinstance(x, Gradient | Principal) for x in layers)
    precision = jnp.result_type(float, *jax.tree.leaves((media, layers, phases, roughness)))
    like = jnp.finfo(precision).dtype
    if counts and not apart and not isinstance(layers, StackedLayers):
        layers = stacked(layers, like)
    if counts and isinstance(phases, Sequence):
        phases = stack_numbers(phases, like)
    graded = [x for x in layers if isinstance(x, Gradient)] if apart else []
    plain = [x for x in layers if not isinstance(x, Gradient)] if apart else []
    # arrays of a graded layer and of stacked ones have rows in front
    rowed = jax.tree.leaves((graded, () if apart else layers, phases if counts else ()))
    leaves = jax.tree.leaves((media, plain, roughness))
    shape = jnp.broadcast_shapes(*map(jnp.shape, leaves), *(jnp.shape(x)[1:] for x in rowed))
    dtype = jnp.promote_types(precision, jnp.complex64)
    xp = namespace(media, layers, phases, roughness)

    def in_rows(number: Number) -> Any:
        """A complex number for each row, (rows, ...)."""
        rows = to_complex(number).astype(dtype)
        lacking = (1,) * (len(shape) + 1 - rows.ndim)
        return xp.broadcast_to(rows.reshape(rows.shape[0], *lacking, *rows.shape[1:]), (len(rows), *shape))

    def joined(blocks: Sequence[Any]) -> Any:
        return xp.concatenate(blocks) if blocks else xp.zeros((0, *shape), dtype)

    def index_at(point: int) -> Any:
        if isinstance(layers, StackedLayers):
            # not the rows of the whole shape: XLA would compute those of constants while it compiles
            order = np.array(layers.order)
            return in_rows(jax.tree.map(lambda x: x[order], layers.distinct))
        if any(isinstance(layer, Principal) for layer in layers):
            axes = zip(*(x if isinstance(x, Principal) else (x, x, x) for x in layers), strict=True)
            return Principal(*(joined([full(x, shape, dtype)[None] for x in axis]) for axis in axes))
        each = [in_rows(x[point]) if isinstance(x, Gradient) else full(x, shape, dtype)[None] for x in layers]
        return joined(each)

    depth = real(in_rows(phases) if counts else joined([]))
    if max(counts, default=1) > 1:
        share = np.array(counts, depth.dtype).reshape(-1, *[1] * len(shape))
        depth = jnp.repeat(depth / share, np.array(counts), 0, total_repeat_length=sum(counts))
    points = tuple(map(index_at, range(3 if graded else 1)))
    indices = jax.tree.leaves([graded, plain], is_leaf=lambda x: isinstance(x, Pair))
    if graded and all(map(is_real, indices)):
        points = tuple(map(jnp.real, points))  # three times as fast
    if roughness is None:
        return LayerRows(points, depth, None)
    faces = [i for i, x in enumerate(roughness) if not (isinstance(x, float) and x == 0)]
    smooth = xp.zeros((1, *shape), depth.dtype)
    own = real(in_rows(stack_numbers([roughness[i] for i in faces], like))) if faces else smooth
    where = dict(zip(np.cumsum([0, *counts])[faces].tolist(), own, strict=False))
    rough = [where[i][None] if i in where else smooth for i in range(sum(counts) + 1)]
    return LayerRows(points, depth, xp.concatenate(rough))


def slice_counts(layers: Sequence[Any]) -> list[int]:
    """Return the number of rows of each layer: of a graded one its slices."""
    if isinstance(layers, StackedLayers):
        return [1] * len(layers)
    return [layer.slices if isinstance(layer, Gradient) else 1 for layer in layers]


def repeated(rows: LayerRows, repeats: Repeats, layers: Sequence[Any]) -> LayerRows:
    """Return rows of layers with their runs, or written out where they drift or a face is rough.

    The size of a program does not depend on the number of repeats.
    """
    counts = slice_counts(layers)
    ends = np.cumsum([0, *counts])[np.cumsum([0, *(n for _, n in repeats.runs)])]
    runs = [(count, range(*pair)) for (count, _), pair in zip(repeats.runs, pairwise(ends), strict=True)]
    if rows.rough is None and all(x is None for x in repeats.drift):
        return rows._replace(runs=tuple((count, len(own)) for count, own in runs))
    order = np.concatenate([np.tile(own, count) for count, own in runs])
    place = np.concatenate([np.repeat(places(count), len(own)) for count, own in runs])
    xp = namespace(rows, repeats.drift)
    drift = [xp.broadcast_to(0.0 if x is None else x, rows.depth.shape[1:]) for x in repeats.drift]
    change = xp.stack(drift)[np.repeat(np.arange(len(counts)), counts)]
    factor = 1 + change[order] * place.reshape(-1, *[1] * (change.ndim - 1))
    rough = None if rows.rough is None else xp.concatenate([rows.rough[:-1][order], rows.rough[-1:]])
    points = jax.tree.map(lambda x: x[order], rows.points)
    return LayerRows(points, rows.depth[order] * factor.astype(rows.depth.dtype), rough)


def full(number: Index, shape: tuple[int, ...], dtype: Any) -> Any:
    """Return an index as complex arrays of a shape."""
    if isinstance(number, Principal):
        return Principal(*(full(x, shape, dtype) for x in number))
    number = to_complex(number).astype(dtype)
    return namespace(number).broadcast_to(number, shape)
