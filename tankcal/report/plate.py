"""Drawing of the identification plate of a tank, with the entries that a rule requires."""

from textwrap import wrap

from matplotlib.figure import Figure
from matplotlib.patches import Circle, FancyBboxPatch

from tankcal.report.plots.style import GREY, INK, WIDTH, styled

# Lengths on the page, inches.
_PLATE, _MARGIN, _LINE, _HOLE = 4.4, 0.3, 0.24, 0.07
_LETTERS = 34  # longest line of a value


@styled
def draw_plate(lines):
    """Draw a plate with a label and a value on each line (matplotlib Figure).

    Parameters
    ----------
    lines : sequence of (str, str)
        Label and value; an empty value is a line to write on.
    """
    rows = [(label, wrap(text, _LETTERS) or [""]) for label, text in lines]
    height = 2 * _MARGIN + _LINE * sum(len(texts) for _, texts in rows)
    figure = Figure(figsize=(WIDTH, height + 0.2))
    ax = figure.add_axes((0, 0, 1, 1))
    ax.set(xlim=(0, WIDTH), ylim=(0, height + 0.2), aspect="equal")
    ax.axis("off")
    left, bottom = (WIDTH - _PLATE) / 2, 0.1
    rounded = "round,pad=0,rounding_size=0.1"
    style = {"facecolor": "none", "edgecolor": INK, "linewidth": 1.4}
    ax.add_patch(FancyBboxPatch((left, bottom), _PLATE, height, boxstyle=rounded, **style))
    for x in (left + 0.16, left + _PLATE - 0.16):
        for y in (bottom + 0.16, bottom + height - 0.16):
            ax.add_patch(Circle((x, y), _HOLE, facecolor="none", edgecolor=GREY, linewidth=0.8))
    y, middle = bottom + height - _MARGIN - _LINE / 2, left + 0.44 * _PLATE
    style = {"va": "center", "parse_math": False}
    for label, texts in rows:
        ax.text(middle - 0.1, y, label, ha="right", fontsize=7.5, color=GREY, **style)
        for text in texts:
            ax.text(middle, y, text, ha="left", fontsize=9.5, color="black", **style)
            if not text:
                end = left + _PLATE - _MARGIN
                ax.plot([middle, end], [y - 0.08] * 2, color=GREY, linewidth=0.5)
            y -= _LINE
    return figure
