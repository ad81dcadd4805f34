"""Common style of drawings in notebooks and reports: colours, width, margins, round factors.

Page lengths are in inches.
"""

import io
import logging
from functools import wraps
from math import ceil, floor, log10

import matplotlib
from matplotlib.figure import Figure

# Keeps remarks on the font cache out of reports.
logging.getLogger("matplotlib").setLevel(logging.ERROR)

STYLE = {
    "font.family": ["STIXGeneral", "DejaVu Serif"],
    "font.size": 8.5,
    "axes.linewidth": 0.5,
    "axes.titley": 1.0,
    "axes.edgecolor": "#445566",
    "axes.unicode_minus": True,
    "xtick.major.width": 0.5,
    "ytick.major.width": 0.5,
    "grid.linewidth": 0.3,
    "grid.color": "#c3cad2",
    "lines.linewidth": 0.9,
}
INK, RED, PALE = "#1f4e79", "#b03a2e", "#9db8d2"
GREY, FAINT = "#445566", "#9aa5b1"
WIDTH = 6.5
MANY = 500  # points in a panel above which an image is smaller than vector outlines
_DPI_ON_SCREEN = 110


def styled(draw, **more):
    """Wrap a drawing function so that it uses `STYLE`, extended by `more`."""

    @wraps(draw)
    def drawing(*arguments, **options):
        with matplotlib.rc_context(STYLE | more):
            return draw(*arguments, **options)

    return drawing


class Drawing(Figure):
    """A matplotlib Figure that a notebook shows, whatever backend it has."""

    def _repr_png_(self):
        image = io.BytesIO()
        self.savefig(image, format="png", dpi=_DPI_ON_SCREEN)
        return image.getvalue()


def round_factor(limit):
    """Largest of 1, 2, 5 times a power of ten that is at most `limit`, and at least 1.

    Parameters
    ----------
    limit : float
        Positive.

    Returns
    -------
    int

    Examples
    --------
    >>> round_factor(470.0), round_factor(0.3)
    (200, 1)
    """
    power = 10.0 ** floor(log10(limit))
    return max(1, round(power * max(step for step in (1, 2, 5) if step * power <= limit)))


def even_groups(items, most):
    """Split items into groups of nearly equal size.

    Parameters
    ----------
    items : sequence
        For example sections of figures, or columns of tables.
    most : int
        Largest number of items in a group.

    Returns
    -------
    list of sequence

    Examples
    --------
    >>> even_groups("abcde", 4)
    ['abc', 'de']
    """
    count = max(1, ceil(len(items) / most))
    size = max(1, ceil(len(items) / count))
    return [items[i : i + size] for i in range(0, len(items), size)]


def rasterize_many(points):
    """Plot options that draw more than `MANY` points as an image inside a vector figure."""
    return {"rasterized": len(points) > MANY}


def set_margins(figure, left, right, bottom, top, **spaces):
    """Set the margins of a figure, in inches."""
    width, height = figure.get_size_inches()
    figure.subplots_adjust(
        left=left / width, right=1 - right / width, bottom=bottom / height, top=1 - top / height,
        **spaces,
    )  # fmt: skip
