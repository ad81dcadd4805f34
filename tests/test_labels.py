"""Names beside the marks of a drawing: measured by the renderer, none lies over another."""

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from tankcal.labels import Label, write_labels
from tankcal.plots import STYLE


def written(count, radius=1.0, text="1-{0:02d}, 2-{0:02d}, 3-{0:02d}, 4-{0:02d}, +4"):
    """(boxes of the names, marks in pixels, names left out) of a ring of marks."""
    import matplotlib

    turn = np.linspace(0, 2 * np.pi, count, endpoint=False)
    xy = radius * np.column_stack([np.sin(turn), np.cos(turn)])
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(6.5, 4.6))
        canvas = FigureCanvasAgg(figure)
        ax = figure.subplots()
        ax.set(xlim=(-1.5, 1.5), ylim=(-1.5, 1.5), aspect="equal")
        labels = [
            Label(*place, (text.format(n), f"1-{n:02d} +7"), 4.0, tuple(place))
            for n, place in enumerate(xy)
        ]
        left_out = write_labels(ax, labels, xy, size=6)
        canvas.draw()
        boxes = [one.get_window_extent(canvas.get_renderer()) for one in ax.texts]
        return boxes, ax.transData.transform(xy), left_out, ax.get_window_extent()


@pytest.mark.parametrize("count", [12, 24, 60])
def test_no_name_covers_another_or_a_mark(count):
    boxes, marks, left_out, frame = written(count)
    assert len(boxes) + left_out == count
    for n, box in enumerate(boxes):
        assert not any(box.overlaps(other) for other in boxes[:n])
        assert not any(box.contains(*mark) for mark in marks)
        assert frame.x0 <= box.x0 and box.x1 <= frame.x1


def test_few_names_all_find_room_and_many_are_thinned():
    assert written(24)[2] == 0
    assert written(400, radius=0.5)[2] > 0
