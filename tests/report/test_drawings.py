"""Names beside the marks of a drawing, measured by the renderer; curves over a bottom."""

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from tankcal.report.plots.figures import bottom_rows, capacity_curves
from tankcal.report.plots.style import STYLE
from tankcal.report.survey.figures import Label, write_labels


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


@pytest.mark.slow
@pytest.mark.parametrize("count", [12, 24, 60])
def test_no_name_covers_another_or_a_mark(count):
    boxes, marks, left_out, frame = written(count)
    assert len(boxes) + left_out == count
    for n, box in enumerate(boxes):
        assert not any(box.overlaps(other) for other in boxes[:n])
        assert not any(box.contains(*mark) for mark in marks)
        assert frame.x0 <= box.x0 < box.x1 <= frame.x1


@pytest.mark.slow
def test_few_names_all_find_room_and_many_are_thinned():
    assert written(24)[2] == 0
    assert written(400, radius=0.5)[2] > 0


# ---- litres per centimetre


def test_cone_has_its_own_curve():
    """Below courses whose cut differs by 0.2 %, which a common axis would hide."""
    height_m = np.arange(0, 9.5, 0.01)
    shell = np.where(height_m < 5, 132.7, 132.5)
    area_m2 = np.where(height_m < 0.345, 132.7 * (height_m / 0.35) ** 2, shell)
    assert bottom_rows(area_m2) == 35
    cone, above, _ = capacity_curves(height_m, area_m2, 1e-3 * height_m).axes
    assert cone.get_ylim()[0] == 0
    assert np.ptp(above.get_ylim()) < 10  # L/cm: the step of 2 L/cm is seen


@pytest.mark.parametrize(
    "area_m2",
    [
        np.full(50, 132.7),
        np.linspace(132.0, 133.0, 50),
        np.sin(np.linspace(0.01, 3.1, 50)),  # lying
    ],
)
def test_a_shell_alone_has_one_curve(area_m2):
    assert bottom_rows(area_m2) == 0
    assert len(capacity_curves(np.arange(50.0), area_m2, np.ones(50)).axes) == 2
