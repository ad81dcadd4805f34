"""Style, colours and common elements of figures."""

import re
from functools import partial
from math import ceil, floor, log10

import numpy as np

from tankcal.report.plots import style as plot_style
from tankcal.report.plots.style import INK, RED

COLOURS = (INK, RED, "#3b7d4f", "#b8860b", "#6a4c93", "#1b998b", "#8a5a44", "#555555")
DASHES = ("-", "--", ":")
LUMA = (0.299, 0.587, 0.114)  # weights of red, green and blue in the brightness: ITU-R BT.601
DARK = 0.55  # brightness below which white text is easier to read than black
styled = partial(plot_style.styled, **{"mathtext.fontset": "stix"})


def line_style(number):
    """Colour and dash of a line; the first 24 numbers have different styles."""
    return {
        "color": COLOURS[number % len(COLOURS)],
        "linestyle": DASHES[number // len(COLOURS) % len(DASHES)],
    }


def widen_to_decades(ax):
    """Extend a logarithmic x axis of less than a decade to powers of ten, which have ticks."""
    low, high = ax.get_xlim()
    if ax.get_xscale() == "log" and high < 10 * low:
        ax.set_xlim(10.0 ** floor(log10(low)), 10.0 ** ceil(log10(high)))


def typeset_indices(text):
    """Text of tankcal in which letters with an index, such as "K₁", are set as mathematics."""
    return re.sub(
        "([A-Za-z])([₀-₉])",
        lambda match: rf"$\mathrm{{{match[1]}}}_{{{ord(match[2]) - ord('₀')}}}$",
        text,
    )


def draw_matrix(ax, values, texts, labels, heads, parse_math=False, **scale):
    """Draw a matrix as colours with a text in each cell.

    Parameters
    ----------
    ax : matplotlib.axes.Axes
        Axes of the figure.
    values : ndarray, shape (rows, columns)
        Values; nan for an empty cell.
    texts : list of list of str
        Text of each cell.
    labels, heads : list of str
        Names of rows and of columns.
    parse_math : bool, optional
        Whether names may contain mathematics; False for texts of a user.
    **scale
        cmap, and vmin and vmax or norm.

    Returns
    -------
    matplotlib.image.AxesImage
        Image for a colour bar.
    """
    image = ax.imshow(values, aspect="auto", **scale)
    for i, row in enumerate(texts):
        for k, text in enumerate(row):
            if text:
                brightness = float(np.dot(image.to_rgba(values[i][k])[:3], LUMA))
                ink = "white" if brightness < DARK else "black"
                ax.text(k, i, text, ha="center", va="center", fontsize=7, color=ink)
    ax.set_xticks(range(len(heads)), heads, parse_math=parse_math)
    ax.set_yticks(range(len(labels)), labels, parse_math=parse_math)
    ax.tick_params(length=0, labeltop=True, labelbottom=False)
    ax.set_frame_on(False)
    return image
