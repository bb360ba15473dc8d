"""Labels of a crowded figure: no two overlap, none covers a point, and all lie inside the axes."""

import numpy as np
import pytest

from pellicle.reporting.label_placement import Label, place_labels
from pellicle.reporting.matplotlib_figure import new_figure


def boxes(notes, scale=1.0):
    return [note.get_window_extent() for note in notes]


def overlapping(one, other):
    return min(one.x1, other.x1) > max(one.x0, other.x0) and min(one.y1, other.y1) > max(one.y0, other.y0)


@pytest.fixture(params=[0, 1, 2])
def crowd(request):
    """Thirty points, most of them in one crowd as methods of like cost are, and their labels."""
    rng = np.random.default_rng(request.param)
    x, y = 10.0 ** (rng.normal(0, 0.25, 30)), 10.0 ** (rng.uniform(-6, 0, 30))
    x[:3] *= 30.0  # at the right edge
    figure = new_figure(8.0, 5.0)
    axes = figure.subplots()
    axes.loglog(x, y, "o", markersize=5)
    axes.margins(x=0.14, y=0.1)
    figure.draw_without_rendering()
    names = [f"uniform-64 at {k} angles" for k in range(30)]
    labels = [Label(*row, "#000000") for row in zip(names, x, y, strict=True)]
    return figure, axes, labels


def test_labels_overlap_neither_each_other_nor_points(crowd):
    figure, axes, labels = crowd
    notes = place_labels(axes, labels)
    figure.draw_without_rendering()
    assert [note.get_text() for note in notes] == [label.text for label in labels]
    # the text's own box: the window extent of an annotation includes its leader
    found = [super(type(note), note).get_window_extent() for note in notes]
    pairs = [(i, j) for i in range(30) for j in range(i) if overlapping(found[i], found[j])]
    assert not pairs
    points = axes.transData.transform([(label.x, label.y) for label in labels])
    for i, box in enumerate(found):
        covered = [k for k, point in enumerate(points) if box.contains(*point)]
        assert not covered, (labels[i], covered)
    frame = axes.get_window_extent()
    assert all(frame.contains(box.x0, box.y0) and frame.contains(box.x1, box.y1) for box in found)


def test_a_lonely_label_stands_at_the_right_without_a_leader():
    figure = new_figure(4.0, 3.0)
    axes = figure.subplots()
    axes.plot([0.0, 1.0], [0.0, 1.0], "none")
    (note,) = place_labels(axes, [Label("alone", 0.5, 0.5, "#000000")])
    assert note.arrow_patch is None
    assert note.get_window_extent().x0 > axes.transData.transform((0.5, 0.5))[0]
