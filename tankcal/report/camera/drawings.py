"""What the figures of the camera's papers share: style, colours, matrices as colours."""

import re
from functools import partial
from math import ceil, floor, log10

import numpy as np

from tankcal.pipeline import plot_style
from tankcal.pipeline.plot_style import INK, RED

COLOURS = (INK, RED, "#3b7d4f", "#b8860b", "#6a4c93", "#1b998b", "#8a5a44", "#555555")
DASHES = ("-", "--", ":")
styled = partial(plot_style.styled, **{"mathtext.fontset": "stix"})


def line_style(number):
    """Colour and dash of the line of that number: different for the first 24."""
    return {
        "color": COLOURS[number % len(COLOURS)],
        "linestyle": DASHES[number // len(COLOURS) % len(DASHES)],
    }


def over_whole_decades(ax):
    """A logarithmic axis of less than a decade made one, or two: its ticks are powers of ten."""
    low, high = ax.get_xlim()
    if ax.get_xscale() == "log" and high < 10 * low:
        ax.set_xlim(10.0 ** floor(log10(low)), 10.0 ** ceil(log10(high)))


def mathematical(text):
    """Words of ours for a figure: letters with an index, as "K₁", set as mathematics."""
    return re.sub(
        "([A-Za-z])([₀-₉])",
        lambda found: rf"$\mathrm{{{found[1]}}}_{{{ord(found[2]) - ord('₀')}}}$",
        text,
    )


def matrix(ax, values, texts, labels, heads, parse_math=False, **scale):
    """A matrix as colours with its texts; cells of NaN stay empty.

    values        (rows, columns)        texts  [rows][columns]
    labels, heads of rows and columns    scale  cmap, vmin, vmax or norm
    parse_math    whether these may hold mathematics: never with a text of a user
    Returns the picture, for a colour bar.
    """
    shown = ax.imshow(values, aspect="auto", **scale)
    for i, row in enumerate(texts):
        for k, text in enumerate(row):
            if text:
                ink = "white" if _dark(shown.to_rgba(values[i][k])) else "black"
                ax.text(k, i, text, ha="center", va="center", fontsize=7, color=ink)
    ax.set_xticks(range(len(heads)), heads, parse_math=parse_math)
    ax.set_yticks(range(len(labels)), labels, parse_math=parse_math)
    ax.tick_params(length=0, labeltop=True, labelbottom=False)
    ax.set_frame_on(False)
    return shown


def _dark(colour):
    """Whether white writing is read better on a colour (r, g, b, a)."""
    return float(np.dot(colour[:3], [0.299, 0.587, 0.114])) < 0.55
