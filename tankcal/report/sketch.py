"""The sketch of the tank on its certificate: zero, reference height, levels, courses.

Not to scale; every measure in it is a value of the record. Lengths of the page are inches.
"""

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Circle, FancyBboxPatch, Rectangle

from tankcal.pipeline.plot_style import GREY, INK, PALE, RED, WIDTH, styled
from tankcal.report.dip_point import dip_point

_LEFT, _RIGHT = 2.0, 4.0  # of the tank on the page
_BOTTOM = 0.5
_LEAST_HEIGHT, _MOST_HEIGHT = 1.1, 1.6
_OF_COURSE = 0.15  # least height of a course that is named
_ABOVE = 0.36  # room for the gauge above the tank
_ROUNDING = 0.3  # of the ends of a lying tank
_SMALL = 7.5
_NEAR_WALL = 0.93  # of the radius: a gauge at the wall is drawn beside it
_WITH_DIP_POINT = ("vertical", "horizontal")  # kinds whose dip point can be declared
_ARROW = {"arrowstyle": "<->", "color": GREY, "linewidth": 0.7, "shrinkA": 0, "shrinkB": 0}


def has_sketch(record):
    """Whether the tank is of a kind that is drawn."""
    return record["job"]["tank"]["kind"] in _DRAWINGS


def sketch(paper):
    """The tank seen from the side, as a matplotlib Figure."""
    return _DRAWINGS[paper.record["job"]["tank"]["kind"]](paper)


def _page(height, below=0.0):
    """An empty page for a tank so high, a part of which hangs `below` its bottom line."""
    figure = Figure(figsize=(WIDTH, below + _BOTTOM + height + _ABOVE))
    ax = figure.add_axes((0, 0, 1, 1))
    ax.set(xlim=(0, WIDTH), ylim=(-below, _BOTTOM + height + _ABOVE), aspect="equal")
    ax.axis("off")
    return figure, ax


@styled
def _upright(paper):
    record = paper.record
    courses = record["courses"]
    tank = record["job"]["tank"]
    shape = tank["nominal_height_m"] / tank["nominal_diameter_m"] * (_RIGHT - _LEFT)
    height = max(_LEAST_HEIGHT, min(_MOST_HEIGHT, shape), _OF_COURSE * len(courses))
    head_m = _head_m(record)
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
    _level_of(ax, paper, per_m)
    _critical_zone(ax, paper, per_m)
    _gauge(ax, paper, _dip_x(record), _BOTTOM + height, _zero_y(record, per_m), below)
    _measure(ax, _LEFT - 0.35, _BOTTOM, top, _of(paper, "shell", courses[-1]["top_m"]))
    nominal = _of(paper, "diameter", tank["nominal_diameter_m"])
    _across(ax, nominal, below=below)
    return figure


def _rise_m(record):
    """How far the centre of a shaped bottom lies above its edge; the courses begin at the edge."""
    found = {one["code"]: one["value"] for one in record["bottom"] or ()}
    return -found.get("bottom_depth", 0.0)


def _head_m(record):
    """How far a head on top rises over the shell; 0 without one."""
    return {one["code"]: one["value"] for one in record.get("top") or ()}.get("top_depth", 0.0)


def _closed_top(ax, y, rise, details):
    """The head on top: two straight lines for a cone, an arch for all others."""
    is_cone = any(one["code"] == "top_form" and one["value"] == "cone" for one in details)
    share = (
        np.array([-1.0, 0.0, 1.0]) if is_cone else np.sin(np.linspace(-1.0, 1.0, 41) * np.pi / 2)
    )
    over = 1 - np.abs(share) if is_cone else np.sqrt(np.maximum(1 - share**2, 0.0))
    middle, half = (_LEFT + _RIGHT) / 2, (_RIGHT - _LEFT) / 2
    ax.plot(middle + half * share, y + rise * over, color=INK, linewidth=1.4)
    ax.plot([_LEFT, _RIGHT], [y, y], color=PALE, linewidth=0.6)


def _dip_x(record):
    """Where the gauge stands: the dip point is seen to the right of the axis of the tank."""
    found = dip_point(record)
    if found is None:
        return _RIGHT - 0.3
    middle, half = (_LEFT + _RIGHT) / 2, (_RIGHT - _LEFT) / 2
    return middle + min(found.share, _NEAR_WALL) * half


def _zero_y(record, per_m):
    """Where the zero of the dips lies on the page: the bottom, or the dip plate."""
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
    """The roof is not known: two waves say that the drawing ends there."""
    for x in (_LEFT, _RIGHT):
        ax.plot([x - 0.08, x - 0.03, x + 0.03, x + 0.08], [y, y + 0.05, y - 0.05, y],
                color=INK, linewidth=0.8)  # fmt: skip


def _course(ax, paper, course, per_m):
    low, high = (_BOTTOM + per_m * course[key] for key in ("bottom_m", "top_m"))
    ax.plot([_LEFT, _RIGHT], [low, low], color=PALE, linewidth=0.6)
    values = {
        "course": course["course"],
        "height": paper.number(course["height_m"], "m", decimals=3),
        "thickness": paper.number(course["thickness_m"], "mm", decimals=2),
    }
    name = "course" if course["thickness_m"] else "course_bare"
    _text(ax, _RIGHT + 0.12, (low + high) / 2, paper.word(f"sketch.{name}", **values), "left")


def _level_of(ax, paper, per_m):
    """The highest level of the table, as a dashed line."""
    record = paper.record
    top_m = record["capacity"]["height_m"][-1]
    y = _zero_y(record, per_m) + per_m * top_m
    ax.plot([_LEFT, _RIGHT], [y, y], color=RED, linewidth=0.8, linestyle=(0, (4, 2)))
    label = paper.word("sketch.top", value=paper.height(top_m))
    _text(ax, _LEFT + 0.12, y - 0.1, label, "left", RED, over_lines=True)


def _critical_zone(ax, paper, per_m):
    """Heights between which a floating roof is neither standing nor floating."""
    found = {one["code"]: one["value"] for one in paper.record["roof"] or ()}
    low, high = (found.get(f"roof_critical_{end}") for end in ("bottom", "top"))
    if low is None or high is None:
        return
    zero = _zero_y(paper.record, per_m)
    size = (_RIGHT - _LEFT, per_m * (high - low))
    style = {"facecolor": "none", "edgecolor": GREY, "hatch": "////", "linewidth": 0.4}
    ax.add_patch(Rectangle((_LEFT, zero + per_m * low), *size, **style))
    label = paper.word("sketch.critical", low=paper.height(low), high=paper.height(high))
    _text(ax, _LEFT + 0.06, zero + per_m * high + 0.07, label, "left", over_lines=True)


def _gauge(ax, paper, x, top, zero, below=0.0):
    """The gauge: its zero below, and the reference height above the tank."""
    upper = top + 0.22
    record = paper.record
    known = dip_point(record) is not None or record["job"]["tank"]["kind"] not in _WITH_DIP_POINT
    line = "-" if known else (0, (5, 3))  # its place was not declared
    ax.plot([x, x], [zero, upper], color=GREY, linewidth=0.7, linestyle=line)
    ax.plot([x - 0.12, x + 0.12], [zero, zero], color=RED, linewidth=2.2)
    ax.plot([x - 0.06, x + 0.06], [upper, upper], color=GREY, linewidth=1.2)
    height_m = record["job"]["datum"]["reference_height_m"]
    label = paper.word("sketch.reference_height_open") if height_m is None else _of(
        paper, "reference_height", height_m)  # fmt: skip
    _text(ax, x + 0.12, upper, label, "left")
    named = paper.word(f"zeros.{record['capacity']['zero']}")
    y = zero if zero > _BOTTOM else _BOTTOM - below
    _text(ax, x + 0.16, y - 0.12, paper.word("sketch.zero", zero=named), "left", RED)


@styled
def _lying(paper):
    sizes = {one["code"]: one["value"] for one in paper.record["solid"]}
    length, high = _RIGHT + 0.5 - _LEFT, 1.0
    figure, ax = _page(high)
    _ground(ax)
    style = {"facecolor": "none", "edgecolor": INK, "linewidth": 1.4}
    rounded = f"round,pad=0,rounding_size={_ROUNDING}"
    corner = (_LEFT + 0.25, _BOTTOM)
    shape = FancyBboxPatch(corner, length - 0.5, high, boxstyle=rounded, **style)
    flat = sizes.get("end_a") == sizes.get("end_b") == "flat"
    ax.add_patch(Rectangle((_LEFT, _BOTTOM), length, high, **style) if flat else shape)
    end = 0.0 if flat else 0.25 + _ROUNDING
    x = _LEFT + end + dip_point(paper.record).share * (length - 2 * end)
    _gauge(ax, paper, x, _BOTTOM + high, _BOTTOM)
    inside = _of(paper, "inside_diameter", sizes["section_height"])
    _measure(ax, _LEFT - 0.35, _BOTTOM, _BOTTOM + high, inside)
    of_cylinder = _of(paper, "length", sizes["cylinder_length"])
    _across(ax, of_cylinder, _LEFT + end, _LEFT + length - end)
    return figure


@styled
def _round(paper):
    sizes = {one["code"]: one["value"] for one in paper.record["solid"]}
    high = 1.6
    figure, ax = _page(high)
    _ground(ax)
    middle = ((_LEFT + _RIGHT) / 2, _BOTTOM + high / 2)
    ax.add_patch(Circle(middle, high / 2, facecolor="none", edgecolor=INK, linewidth=1.4))
    _gauge(ax, paper, middle[0], _BOTTOM + high, _BOTTOM)
    inside = _of(paper, "inside_diameter", sizes["diameter"])
    _measure(ax, _LEFT - 0.35, _BOTTOM, _BOTTOM + high, inside)
    return figure


_DRAWINGS = {"vertical": _upright, "horizontal": _lying, "sphere": _round}


def _measure(ax, x, low, high, label):
    """A measure beside the tank: an arrow from low to high, its label to the left."""
    ax.annotate("", (x, high), (x, low), arrowprops=_ARROW)
    _text(ax, x - 0.08, (low + high) / 2, label, "right")


def _across(ax, label, left=_LEFT, right=_RIGHT, below=0.0):
    """A measure below the tank, from one of its sides to the other."""
    y = _BOTTOM - below - 0.24
    ax.annotate("", (right, y), (left, y), arrowprops=_ARROW)
    _text(ax, (left + right) / 2, y - 0.13, label, "center")


def _of(paper, name, value_m):
    return paper.word(f"sketch.{name}", value=paper.number(value_m, "m", decimals=3))


def _text(ax, x, y, text, side, colour="black", over_lines=False):
    """A label; one `over_lines` hides what would run through it: the gauge may stand anywhere."""
    hiding = {"facecolor": "white", "edgecolor": "none", "pad": 0.8} if over_lines else None
    style = {"fontsize": _SMALL, "color": colour, "bbox": hiding}
    ax.text(x, y, text, ha=side, va="center", parse_math=False, **style)
