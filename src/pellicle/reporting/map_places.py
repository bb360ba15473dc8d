"""Places of pixels of a map in words: along the edge, in a patch, in rows, scattered."""

from typing import Any

import numpy as np

from pellicle.reporting.map_axes import Axis, MapAxes

MOST = 0.8
"""Share of the pixels that a description must cover."""
MOST_PIXELS = 2_000_000
"""Pixels beyond which the edge is sought on every second, third, ... pixel of each row and column."""
FEW = 3
"""Most pixels, patches or runs that are listed one by one."""
CLUSTERED = 0.15
"""Least excess of neighbours with the same property over that of pixels at random, 0 to 1."""
FILLED = 0.4
"""Least share of others within the rectangle that encloses them, for pixels all around it."""
COVERED = 0.25
"""Share of the band along the edge from which pixels lie along the edge rather than in a patch at it."""
WHOLE = 0.95
"""Share from which a description is not called mostly true."""
DEEP = 0.2
"""Largest depth of that band, as a share of the distance from the edge to the middle."""


def place(marked: np.ndarray, known: np.ndarray, axes: MapAxes) -> str:
    """Describe where pixels are.

    **Arguments:**

    - `marked`: True for the pixels, at least one, in the shape of the map.
    - `known`: True for pixels among which they are: those with data.

    **Returns:** words such as "along the edge" or "in one patch of 84 pixels around x = 1.2, y = 3.4 mm".
    """
    marked, known = axes.frames(marked), axes.frames(known)
    if axes.series is None or len(marked) == 1:
        return _in_frame(marked[0], known[0], axes)
    each = marked.reshape(len(marked), -1).sum(axis=1)
    share = each / np.maximum(known.reshape(len(marked), -1).sum(axis=1), 1)
    whole = _runs(share > 0.5)
    if sum(each[a:b].sum() for a, b in whole) >= MOST * each.sum():
        return "in all pixels at " + _spans(whole, axes.series)
    first, last = np.flatnonzero(each)[[0, -1]]
    when = ""
    if last - first + 1 <= 0.5 * len(marked):
        when = f"at {axes.series.span(*axes.series.values[[first, last]])}, "
    often = marked.sum(axis=0)
    return when + _in_frame(often >= max(0.5 * often.max(), 1), np.any(known, axis=0), axes, counted=False)


def _in_frame(marked: np.ndarray, known: np.ndarray, axes: MapAxes, counted: bool = True) -> str:
    """Describe where pixels of one image, one set of sites or one line are."""
    count = int(marked.sum())
    if count <= FEW and axes.kind != "line":
        return "at " + " and at ".join(axes.place(*index) for index in np.argwhere(marked).tolist())
    if axes.kind == "line":
        return _on_line(marked, axes.x)
    if axes.kind == "sites":
        return _at_sites(marked, known, axes)
    if count == known.sum():
        return "everywhere"
    if around := _around(marked, axes):
        return _edge(marked, known) or around
    return _rows(marked, known, axes) or _edge(marked, known) or _patches(marked, known, axes, counted)


def _around(marked: np.ndarray, axes: MapAxes) -> str:
    """All around one region, as outside a mask, or nothing."""
    border = np.concatenate([marked[0], marked[-1], marked[:, 0], marked[:, -1]])
    rows, columns = (np.flatnonzero(~np.all(marked, axis=i)) for i in (1, 0))
    if border.mean() < WHOLE or not rows.size:
        return ""
    box = marked[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    if box.mean() > 1 - FILLED or box.size > MOST * marked.size:
        return ""
    assert axes.y is not None
    x, y = (axis.span(*axis.values[at[[0, -1]]]) for axis, at in ((axes.x, columns), (axes.y, rows)))
    return f"all around {x}, {y}"


def _on_line(marked: np.ndarray, axis: Axis) -> str:
    runs = sorted(_runs(marked), key=lambda run: run[0] - run[1])[:FEW]
    if sum(b - a for a, b in runs) < MOST * marked.sum():
        return "in scattered pixels"
    return "at " + _spans(sorted(runs), axis)


def _at_sites(marked: np.ndarray, known: np.ndarray, axes: MapAxes) -> str:
    """Sites far from the centre of all, near it, or neither."""
    assert axes.y is not None
    x, y = axes.x.values, axes.y.values
    radius = np.hypot(x - (x.min() + x.max()) / 2, y - (y.min() + y.max()) / 2)
    order = np.flatnonzero(known)[np.argsort(radius[known])]
    size = min(int(np.ceil(1.25 * marked.sum())), len(order) // 2)
    for word, end in (("outer", order[::-1][:size]), ("inner", order[:size])):
        if size and marked[end].sum() >= MOST * marked.sum():
            return f"at the {word} sites"
    return "at scattered sites"


def _rows(marked: np.ndarray, known: np.ndarray, axes: MapAxes) -> str:
    """Whole rows or columns, or nothing; those at a border of the image are along an edge."""
    assert axes.y is not None
    top, bottom = ("top", "bottom") if axes.downward else ("bottom", "top")
    for along, word, axis, ends in (
        (1, "row", axes.y, (top, bottom)),
        (0, "column", axes.x, ("left", "right")),
    ):
        each = marked.sum(axis=along)
        runs = _runs(each > 0.5 * np.maximum(known.sum(axis=along), 1))
        covered = sum(each[a:b].sum() for a, b in runs) / marked.sum()
        if covered < MOST:
            continue
        mostly = _mostly(covered)
        if len(runs) > FEW:
            return f"{mostly}in {sum(b - a for a, b in runs)} {word}s"
        if len(runs) == 1:
            edges = [
                end for end, at in zip(ends, (runs[0][0] == 0, runs[0][1] == each.size), strict=True) if at
            ]
            if len(edges) == 1:
                return f"{mostly}along the {edges[0]} edge, {_spans(runs, axis)}"
        number = sum(b - a for a, b in runs)
        return (
            f"{mostly}in {'one' if number == 1 else number} {word}{'s' * (number > 1)}, {_spans(runs, axis)}"
        )
    return ""


def _edge(marked: np.ndarray, known: np.ndarray) -> str:
    """Along the border of the pixels with data, or nothing."""
    from scipy.ndimage import binary_fill_holes, distance_transform_edt  # slow to import

    step = int(np.ceil(np.sqrt(marked.size / MOST_PIXELS)))  # distances take 30 bytes a pixel
    marked, known = marked[::step, ::step], known[::step, ::step]
    if not marked.any():
        return ""
    inside = np.asarray(binary_fill_holes(known))
    depth = np.asarray(distance_transform_edt(np.pad(inside, 1)))[1:-1, 1:-1]
    for covered in (0.97, 0.85):
        reach = np.quantile(depth[marked], covered)
        band = inside & (depth <= reach)
        if reach <= max(2.0, DEEP * depth.max()) and (marked & band).sum() >= COVERED * band.sum():
            return _mostly(covered) + "along the edge"
    return ""


def _patches(marked: np.ndarray, known: np.ndarray, axes: MapAxes, counted: bool) -> str:
    """One patch, a few, many, or pixels scattered at random."""
    from scipy.ndimage import convolve, find_objects, label  # slow to import

    x_axis, y_axis = axes.x, axes.y
    assert y_axis is not None
    ring = np.ones((3, 3), np.uint8)
    ring[1, 1] = 0
    around = convolve(marked.astype(np.uint8), ring, mode="constant")[marked].sum()
    neighbours = convolve(known.astype(np.uint8), ring, mode="constant")[marked].sum()
    density = marked.sum() / known.sum()
    if around / max(neighbours, 1) - density < CLUSTERED * (1 - density):
        return "in scattered pixels"
    labelled: Any = label(marked, np.ones((3, 3)))
    labels, number = labelled
    sizes = np.bincount(labels.ravel())[1:]
    largest = np.argsort(-sizes)
    boxes = find_objects(labels)
    listed = next((n for n in range(1, FEW + 1) if sizes[largest[:n]].sum() >= MOST * marked.sum()), 0)
    if not listed:
        return f"in {number} patches of up to {sizes.max()} pixels"

    def described(which: int) -> str:
        rows, columns = boxes[which]
        size = f"of {sizes[which]} pixels " if counted else ""
        if sizes[which] >= 0.4 * (rows.stop - rows.start) * (columns.stop - columns.start):
            middle = [round(float(np.mean(i))) for i in np.nonzero(labels == which + 1)]
            return f"{size}around {axes.place(*middle)}"
        x = x_axis.span(*x_axis.values[[columns.start, columns.stop - 1]])
        return f"{size}at {x}, {y_axis.span(*y_axis.values[[rows.start, rows.stop - 1]])}"

    texts = [described(i) for i in largest[:listed].tolist()]
    mostly = _mostly(sizes[largest[:listed]].sum() / marked.sum())
    return mostly + (
        f"in one patch {texts[0]}" if listed == 1 else f"in {listed} patches, {' and '.join(texts)}"
    )


def _mostly(covered: float) -> str:
    return "" if covered >= WHOLE else "mostly "


def _runs(flags: np.ndarray) -> list[tuple[int, int]]:
    """Start and end of each run of True."""
    steps = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(np.int8), [0]])))
    return [(int(a), int(b)) for a, b in zip(steps[::2], steps[1::2], strict=True)]


def _spans(runs: list[tuple[int, int]], axis: Axis) -> str:
    return " and ".join(axis.span(axis.values[a], axis.values[b - 1]) for a, b in runs)
