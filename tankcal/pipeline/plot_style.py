"""The one style of drawings, for notebooks and papers: colours, width, margins, round factors.

Lengths of the page are inches.
"""

import io
import logging
from functools import wraps
from math import ceil, floor, log10

import matplotlib
from matplotlib.figure import Figure

logging.getLogger("matplotlib").setLevel(logging.ERROR)  # no remark about its font cache on paper

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
MANY = 500  # points in a panel: from here on their picture is smaller than their outlines
_DPI_ON_SCREEN = 110


def styled(draw, **more):
    """A function that draws in the one style of notebooks and papers; `more` adds to that style."""

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


def round_factor(wanted):
    """The largest of 1, 2, 5 times a power of ten that is at most `wanted`, and at least 1.

    Parameters
    ----------
    wanted : float
        Above 0.

    Returns
    -------
    int

    Examples
    --------
    >>> round_factor(470.0), round_factor(0.3)
    (200, 1)
    """
    power = 10.0 ** floor(log10(wanted))
    return max(1, round(power * max(step for step in (1, 2, 5) if step * power <= wanted)))


def even_groups(items, most):
    """Split items into groups of nearly equal size: sections into figures, columns into tables.

    Parameters
    ----------
    items : sequence
    most : int
        Items in one group.

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
    """Very many points are drawn as a picture inside the figure."""
    return {"rasterized": len(points) > MANY}


def set_margins(figure, left, right, bottom, top, **spaces):
    """Margins of a figure in inches."""
    width, height = figure.get_size_inches()
    figure.subplots_adjust(
        left=left / width, right=1 - right / width, bottom=bottom / height, top=1 - top / height,
        **spaces,
    )  # fmt: skip
