"""Sketch of the tank for the certificate: zero, reference height, levels, courses.

The sketch is not to scale; all dimensions are values of the record. Lengths on the page are inches.
"""

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Circle, FancyBboxPatch, Rectangle

from tankcal.report.plots.style import GREY, INK, PALE, RED, WIDTH, styled
from tankcal.report.tables.facts import dip_point

_LEFT, _RIGHT = 2.0, 4.0  # sides of the tank on the page
_BOTTOM = 0.5  # bottom of the tank on the page
_LEAST_HEIGHT, _MOST_HEIGHT = 1.1, 1.6  # limits of the height of the tank on the page
_OF_COURSE = 0.15  # smallest drawn height of a course
_ABOVE = 0.36  # space for the gauge above the tank
_ROUNDING = 0.3  # radius of the ends of a horizontal tank
_SMALL = 7.5  # font size of labels, points
_NEAR_WALL = 0.93  # largest distance of the gauge from the axis, relative to the radius
_WITH_DIP_POINT = ("vertical", "horizontal")  # kinds of tank with a declared dip point
_ARROW = {"arrowstyle": "<->", "color": GREY, "linewidth": 0.7, "shrinkA": 0, "shrinkB": 0}


def has_sketch(record):
    """Return whether a sketch exists for the kind of tank."""
    return record["job"]["tank"]["kind"] in _DRAWINGS


def sketch(paper):
    """Draw the tank from the side (matplotlib Figure)."""
    return _DRAWINGS[paper.record["job"]["tank"]["kind"]](paper)


def _page(height, below=0.0):
    """Return an empty figure for a tank of `height`, which extends `below` its bottom line."""
    figure = Figure(figsize=(WIDTH, below + _BOTTOM + height + _ABOVE))
    ax = figure.add_axes((0, 0, 1, 1))
    ax.set(xlim=(0, WIDTH), ylim=(-below, _BOTTOM + height + _ABOVE), aspect="equal")
    ax.axis("off")
    return figure, ax


@styled
def _upright(paper):
    """Draw a vertical tank."""
    record = paper.record
    courses = record["courses"]
    tank = record["job"]["tank"]
    shape = tank["nominal_height_m"] / tank["nominal_diameter_m"] * (_RIGHT - _LEFT)
    height = max(_LEAST_HEIGHT, min(_MOST_HEIGHT, shape), _OF_COURSE * len(courses))
    head_m = {size["code"]: size["value"] for size in record.get("top") or ()}.get("top_depth", 0.0)
    per_m = height / (courses[-1]["top_m"] + head_m)
    rise = per_m * _rise_m(record)
    below = max(-rise, 0.0)
    figure, ax = _page(height, below)
    _ground(ax, open_below=below > 0)
    top, middle = _BOTTOM + height - per_m * head_m, (_LEFT + _RIGHT) / 2
    x = [_LEFT, _LEFT, middle, _RIGHT, _RIGHT]
    ax.plot(x, [top, _BOTTOM, _BOTTOM + rise, _BOTTOM, top], color=INK, linewidth=1.4)
    if head_m:
        _closed_top(ax, top, per_m * head_m, record["top"])
    else:
        _open_top(ax, top)
    for course in courses:
        _course(ax, paper, course, per_m)
    _highest_level(ax, paper, per_m)
    _critical_zone(ax, paper, per_m)
    _gauge(ax, paper, _dip_x(record), _BOTTOM + height, _zero_y(record, per_m), below)
    _measure(ax, _LEFT - 0.35, _BOTTOM, top, _dimension_label(paper, "shell", courses[-1]["top_m"]))
    nominal = _dimension_label(paper, "diameter", tank["nominal_diameter_m"])
    _draw_dimension(ax, nominal, below=below)
    return figure


def _rise_m(record):
    """Height of the centre of a shaped bottom above its edge, where the courses begin, m."""
    sizes = {size["code"]: size["value"] for size in record["bottom"] or ()}
    return -sizes.get("bottom_depth", 0.0)


def _closed_top(ax, y, rise, details):
    """Draw the head on top: two straight lines for a cone, an arch for other heads."""
    is_cone = any(size["code"] == "top_form" and size["value"] == "cone" for size in details)
    share = (
        np.array([-1.0, 0.0, 1.0]) if is_cone else np.sin(np.linspace(-1.0, 1.0, 41) * np.pi / 2)
    )
    height = 1 - np.abs(share) if is_cone else np.sqrt(np.maximum(1 - share**2, 0.0))
    middle, half = (_LEFT + _RIGHT) / 2, (_RIGHT - _LEFT) / 2
    ax.plot(middle + half * share, y + rise * height, color=INK, linewidth=1.4)
    ax.plot([_LEFT, _RIGHT], [y, y], color=PALE, linewidth=0.6)


def _dip_x(record):
    """Return x of the gauge on the page; the dip point is drawn to the right of the axis."""
    point = dip_point(record)
    if point is None:
        return _RIGHT - 0.3
    middle, half = (_LEFT + _RIGHT) / 2, (_RIGHT - _LEFT) / 2
    return middle + min(point.share, _NEAR_WALL) * half


def _zero_y(record, per_m):
    """Return y of the zero on the page: the bottom or the dip plate."""
    datum = record["job"]["datum"]
    if record["capacity"]["zero"] != "dip_plate":
        return _BOTTOM
    return _BOTTOM + per_m * (datum["dip_plate_z_m"] - datum["bottom_z_m"])


def _ground(ax, open_below=False):
    ends = [_LEFT - 0.35, _RIGHT + 0.35]
    parts = [(ends[0], _LEFT), (_RIGHT, ends[1])] if open_below else [ends]
    for part in parts:
        ax.plot(part, [_BOTTOM - 0.03] * 2, color=GREY, linewidth=0.6)


def _open_top(ax, y):
    """Draw break lines at the top of the shell, since the roof is not known."""
    for x in (_LEFT, _RIGHT):
        ax.plot([x - 0.08, x - 0.03, x + 0.03, x + 0.08], [y, y + 0.05, y - 0.05, y],
                color=INK, linewidth=0.8)  # fmt: skip


def _course(ax, paper, course, per_m):
    """Draw the lower edge of a course and its label."""
    low, high = (_BOTTOM + per_m * course[key] for key in ("bottom_m", "top_m"))
    ax.plot([_LEFT, _RIGHT], [low, low], color=PALE, linewidth=0.6)
    values = {
        "course": course["course"],
        "height": paper.number(course["height_m"], "m", decimals=3),
        "thickness": paper.number(course["thickness_m"], "mm", decimals=2),
    }
    name = "course" if course["thickness_m"] else "course_bare"
    _text(ax, _RIGHT + 0.12, (low + high) / 2, paper.word(f"sketch.{name}", **values), "left")


def _highest_level(ax, paper, per_m):
    """Draw the highest level of the table as a dashed line."""
    record = paper.record
    top_m = record["capacity"]["height_m"][-1]
    y = _zero_y(record, per_m) + per_m * top_m
    ax.plot([_LEFT, _RIGHT], [y, y], color=RED, linewidth=0.8, linestyle=(0, (4, 2)))
    label = paper.word("sketch.top", value=paper.height(top_m))
    _text(ax, _LEFT + 0.12, y - 0.1, label, "left", RED, over_lines=True)


def _critical_zone(ax, paper, per_m):
    """Hatch the critical zone, in which a floating roof neither rests nor floats."""
    sizes = {size["code"]: size["value"] for size in paper.record["roof"] or ()}
    for position in ("critical", "high"):
        low, high = (sizes.get(f"roof_{position}_{end}") for end in ("bottom", "top"))
        if low is not None and high is not None:
            _draw_zone(ax, paper, per_m, low, high)


def _draw_zone(ax, paper, per_m, low, high):
    """Hatch a critical zone between two dips, m."""
    zero = _zero_y(paper.record, per_m)
    extent = (_RIGHT - _LEFT, per_m * (high - low))
    style = {"facecolor": "none", "edgecolor": GREY, "hatch": "////", "linewidth": 0.4}
    ax.add_patch(Rectangle((_LEFT, zero + per_m * low), *extent, **style))
    label = paper.word("sketch.critical", low=paper.height(low), high=paper.height(high))
    _text(ax, _LEFT + 0.06, zero + per_m * high + 0.07, label, "left", over_lines=True)


def _gauge(ax, paper, x, top, zero, below=0.0):
    """Draw the gauge with its zero and the reference height."""
    upper = top + 0.22
    record = paper.record
    known = dip_point(record) is not None or record["job"]["tank"]["kind"] not in _WITH_DIP_POINT
    line = "-" if known else (0, (5, 3))  # dashed: no dip point is declared
    ax.plot([x, x], [zero, upper], color=GREY, linewidth=0.7, linestyle=line)
    ax.plot([x - 0.12, x + 0.12], [zero, zero], color=RED, linewidth=2.2)
    ax.plot([x - 0.06, x + 0.06], [upper, upper], color=GREY, linewidth=1.2)
    height_m = record["job"]["datum"]["reference_height_m"]
    label = paper.word("sketch.reference_height_open") if height_m is None else _dimension_label(
        paper, "reference_height", height_m)  # fmt: skip
    _text(ax, x + 0.12, upper, label, "left")
    named = paper.word(f"zeros.{record['capacity']['zero']}")
    y = zero if zero > _BOTTOM else _BOTTOM - below
    _text(ax, x + 0.16, y - 0.12, paper.word("sketch.zero", zero=named), "left", RED)


@styled
def _lying(paper):
    """Draw a horizontal tank."""
    sizes = {size["code"]: size["value"] for size in paper.record["solid"]}
    length, height = _RIGHT + 0.5 - _LEFT, 1.0
    figure, ax = _page(height)
    _ground(ax)
    style = {"facecolor": "none", "edgecolor": INK, "linewidth": 1.4}
    rounded = f"round,pad=0,rounding_size={_ROUNDING}"
    corner = (_LEFT + 0.25, _BOTTOM)
    shape = FancyBboxPatch(corner, length - 0.5, height, boxstyle=rounded, **style)
    flat = sizes.get("end_a") == sizes.get("end_b") == "flat"
    ax.add_patch(Rectangle((_LEFT, _BOTTOM), length, height, **style) if flat else shape)
    end = 0.0 if flat else 0.25 + _ROUNDING
    x = _LEFT + end + dip_point(paper.record).share * (length - 2 * end)
    _gauge(ax, paper, x, _BOTTOM + height, _BOTTOM)
    diameter_label = _dimension_label(paper, "inside_diameter", sizes["section_height"])
    _measure(ax, _LEFT - 0.35, _BOTTOM, _BOTTOM + height, diameter_label)
    length_label = _dimension_label(paper, "length", sizes["cylinder_length"])
    _draw_dimension(ax, length_label, _LEFT + end, _LEFT + length - end)
    return figure


@styled
def _round(paper):
    """Draw a sphere."""
    sizes = {size["code"]: size["value"] for size in paper.record["solid"]}
    height = 1.6
    figure, ax = _page(height)
    _ground(ax)
    middle = ((_LEFT + _RIGHT) / 2, _BOTTOM + height / 2)
    ax.add_patch(Circle(middle, height / 2, facecolor="none", edgecolor=INK, linewidth=1.4))
    _gauge(ax, paper, middle[0], _BOTTOM + height, _BOTTOM)
    diameter_label = _dimension_label(paper, "inside_diameter", sizes["diameter"])
    _measure(ax, _LEFT - 0.35, _BOTTOM, _BOTTOM + height, diameter_label)
    return figure


_DRAWINGS = {"vertical": _upright, "horizontal": _lying, "sphere": _round}


def _measure(ax, x, low, high, label):
    """Draw a vertical dimension beside the tank, with its label to the left."""
    ax.annotate("", (x, high), (x, low), arrowprops=_ARROW)
    _text(ax, x - 0.08, (low + high) / 2, label, "right")


def _draw_dimension(ax, label, left=_LEFT, right=_RIGHT, below=0.0):
    """Draw a horizontal dimension below the tank."""
    y = _BOTTOM - below - 0.24
    ax.annotate("", (right, y), (left, y), arrowprops=_ARROW)
    _text(ax, (left + right) / 2, y - 0.13, label, "center")


def _dimension_label(paper, name, value_m):
    """Return the label of a dimension."""
    return paper.word(f"sketch.{name}", value=paper.number(value_m, "m", decimals=3))


def _text(ax, x, y, text, side, colour="black", over_lines=False):
    """Draw a label; with `over_lines` its background hides the lines behind it."""
    hiding = {"facecolor": "white", "edgecolor": "none", "pad": 0.8} if over_lines else None
    style = {"fontsize": _SMALL, "color": colour, "bbox": hiding}
    ax.text(x, y, text, ha=side, va="center", parse_math=False, **style)
