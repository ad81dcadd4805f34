"""Sketch of the three zeros for the certificate: dip plate, table and gauge.

The sketch is not to scale: the zeros are drawn in their order, at equal distances. Lengths on the
page are inches.
"""

from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from tankcal.report.plots.style import GREY, INK, PALE, RED, WIDTH, styled

_HEIGHT, _TOP = 1.7, 1.25  # of the page, and of the drawn roof
_LEFT, _RIGHT, _PIPE = 0.5, 2.6, 1.7  # walls of the tank, middle of the still pipe
_STEP = 0.24  # between two drawn zeros
_TEXT = 3.05  # left edge of the labels
_SMALL = 8
_COLOURS = {"dip_plate": INK, "table": GREY, "gauge": RED}


@styled
def sketch(paper):
    """Draw tank, gauge, zeros and reference height (matplotlib Figure)."""
    gauge = paper.record
    figure = Figure(figsize=(WIDTH, _HEIGHT))
    ax = figure.add_axes((0, 0, 1, 1))
    ax.set(xlim=(0, WIDTH), ylim=(0, _HEIGHT), aspect="equal")
    ax.axis("off")
    ax.plot([_LEFT, _LEFT, _RIGHT, _RIGHT], [_TOP, 0.2, 0.2, _TOP], color=INK, linewidth=1.4)
    ax.plot([_LEFT, _RIGHT], [_TOP, _TOP], color=INK, linewidth=0.8)
    ax.add_patch(Rectangle((_LEFT, 0.2), _RIGHT - _LEFT, 0.75, color=PALE, alpha=0.35, linewidth=0))
    _draw_gauge(ax, gauge["gauge"]["supported_by"])
    known = [zero for zero in gauge["zeros"][:3] if zero["z_mm"] is not None]
    heights = _heights(known)
    for zero, y in zip(known, heights, strict=True):
        colour = _COLOURS[zero["code"]]
        ax.plot([_LEFT + 0.1, _TEXT - 0.08], [y, y], color=colour, linewidth=1.0,
                linestyle="-" if zero["code"] == "dip_plate" else (0, (5, 2)))  # fmt: skip
        ax.text(_TEXT, y, _label(paper, zero), va="center", fontsize=_SMALL, color=colour)
    _draw_reference(ax, paper, heights[known.index(gauge["zeros"][0])])
    return figure


def _heights(zeros):
    """Height of each zero on the page, by its order; equal zeros are drawn apart."""
    order = sorted(range(len(zeros)), key=lambda place: (zeros[place]["z_mm"], place))
    return [0.34 + _STEP * order.index(place) for place in range(len(zeros))]


def _label(paper, zero):
    """Name of a zero with its z and U."""
    name = paper.words["zeros"][zero["code"]]
    if zero["code"] == "dip_plate":
        return f"{name}: z = 0"
    height = paper.text_with_u(zero["z_mm"], zero["U_mm"])
    return f"{name}: z = {height}"


def _draw_gauge(ax, support):
    """Gauge on the roof; a still pipe down to the bottom, or ends above it."""
    foot = 0.2 if support == "bottom" else 0.9
    for side in (-0.06, 0.06):
        ax.plot([_PIPE + side] * 2, [foot, _TOP + 0.12], color=GREY, linewidth=0.8)
    ax.add_patch(Rectangle((_PIPE - 0.13, _TOP + 0.12), 0.26, 0.18, facecolor="white",
                           edgecolor=INK, linewidth=0.9))  # fmt: skip


def _draw_reference(ax, paper, y_plate):
    """Reference point on the roof, and the reference height above the dip plate."""
    zero = next((z for z in paper.record["zeros"] if z["code"] == "reference"), None)
    x = 0.85
    ax.add_patch(Rectangle((x - 0.07, _TOP), 0.14, 0.1, facecolor="white", edgecolor=INK,
                           linewidth=0.9))  # fmt: skip
    ax.plot([x - 0.16, x + 0.16], [y_plate, y_plate], color=INK, linewidth=2.2)
    if zero is None:
        return
    top = _TOP + 0.1
    ax.annotate("", (x, y_plate), (x, top), arrowprops={"arrowstyle": "<->", "color": GREY,
                "linewidth": 0.7, "shrinkA": 0, "shrinkB": 0})  # fmt: skip
    ax.plot([x + 0.07, _TEXT - 0.08], [top, top], color=GREY, linewidth=0.5)
    name, height = paper.words["zeros"]["reference"], paper.reference_height()
    text = f"{name}: H = {height}"
    ax.text(_TEXT, top, text, va="center", fontsize=_SMALL, color=GREY)
