"""Sketch of a plan from above: tank, stations, set-ups, obstacles, tapes, marks."""

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle

from tankcal.planning.model import TAPED, Box
from tankcal.planning.places import group_by_ends, reference_rad
from tankcal.report.planning.sketches import (
    BEHIND,
    DASHES,
    GREEN,
    OCHRE,
    add_text,
    has_own_marks,
    marks_of,
)
from tankcal.report.plots.style import GREY, INK, PALE, WIDTH, round_factor, styled

HIGH = 4.6  # height of the figure, inches
STEEP = 0.5  # sine of an azimuth; nearer to the y axis, names of stations are above or below
FURTHEST = 2.4  # limit of the frame, in units of the extent of the survey
LONG = 4  # ratio of length to width from which the name of a box runs along it
SMALL_SHARE = 0.6  # of the radius of the tank; names of smaller obstacles are beside them
MOST_NAMES = 40  # largest number of marks that are all named


@styled
def stands(paper):
    """Draw the tank from above: stations, set-ups, obstacles, tapes, reference weld, y axis."""
    plan = paper.plan
    figure = Figure(figsize=(WIDTH, HIGH))
    ax = figure.add_axes((0.0, 0.08, 1.0, 0.92))
    ax.set_aspect("equal")
    ax.axis("off")
    _set_frame(ax, plan)
    _tank(ax, paper)
    _obstacles(ax, plan)
    for table in TAPED:
        _ties(ax, paper, table)
    _bases(ax, paper)
    _marks(ax, paper)
    _views(ax, paper)
    photos = {photo.station: photo.xyz_m for photo in plan.photos}
    setups = {setup.name: setup.xyz_m for setup in plan.setups}
    _stands(ax, plan, photos, "o", INK, paper.word("legend.stations"))
    _stands(ax, plan, setups, "^", GREEN, paper.word("legend.setups"))
    _rose(ax, paper)
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, 0.0), ncols=5, frameon=False,
              fontsize=7.5)  # fmt: skip
    return figure


def _set_frame(ax, plan):
    """Set the limits of the axes: tank, all measured points, and obstacles that are not far."""
    axis = plan.shell.axis_m
    measured = np.array([xyz[:2] for xyz in (*plan.points.values(), *_places(plan))])
    reach = 1.15 * max(np.linalg.norm(measured - axis, axis=1).max(), plan.shell.radius_m)
    reach += 0.15 * plan.shell.radius_m
    low, high = axis - reach, axis + reach
    for obstacle in plan.obstacles:
        least, most = _extent(obstacle)
        near = axis - FURTHEST * reach, axis + FURTHEST * reach
        low = np.minimum(low, np.clip(least - 0.05 * reach, *near))
        high = np.maximum(high, np.clip(most + 0.05 * reach, *near))
    # Widen the shorter side, so that the frame fills the figure at equal scales.
    wide, tall = high - low
    shape = WIDTH / (0.92 * HIGH)
    more = np.array([max(0.0, shape * tall - wide), max(0.0, wide / shape - tall)]) / 2
    (left, bottom), (right, top) = low - more, high + more
    ax.set(xlim=(left, right), ylim=(bottom, top))


def _places(plan):
    """Return the positions (3,) of all photographs and set-ups."""
    return [stand.xyz_m for stand in (*plan.photos, *plan.setups)]


def _extent(obstacle):
    """Lowest and highest x, y (2,) of an obstacle."""
    if isinstance(obstacle, Box):
        return obstacle.low_m[:2], obstacle.high_m[:2]
    return obstacle.axis_m - obstacle.radius_m, obstacle.axis_m + obstacle.radius_m


def _tank(ax, paper):
    plan = paper.plan
    shell = plan.shell
    ax.add_patch(Circle(shell.axis_m, shell.radius_m, facecolor="#eef2f6", edgecolor=INK))
    weld = reference_rad(plan)
    out = np.array([np.sin(weld), np.cos(weld)])
    inner, outer = (shell.axis_m + share * shell.radius_m * out for share in (0.92, 1.06))
    label = paper.word("legend.weld")
    ax.plot(*np.array([inner, outer]).T, color=GREY, linewidth=2.4, label=label)
    add_text(ax, *shell.axis_m, plan.job.tank.id, ha="center", va="center")


def _obstacles(ax, plan):
    for obstacle in plan.obstacles:
        look = {"facecolor": "#e3d9c6", "edgecolor": GREY, "linewidth": 0.5, "zorder": 0.5}
        low, high = _extent(obstacle)
        size, middle, turned = high - low, (low + high) / 2, 0
        is_small = size.max() < SMALL_SHARE * plan.shell.radius_m
        if isinstance(obstacle, Box):
            ax.add_patch(Rectangle(low, *size, **look))
            if size.max() > LONG * size.min() and not is_small:
                # The name is at the place (2,) along the box that is farthest from all stations.
                along = np.where(size == size.max(), [[0.25], [0.75], [0.5]], 0.5)
                places = low + along * size
                away = np.linalg.norm(places[:, None] - np.array(_places(plan))[:, :2], axis=2)
                middle = places[away.min(axis=1).argmax()]
                turned = 90 if size[1] > size[0] else 0
        else:
            ax.add_patch(Circle(obstacle.axis_m, obstacle.radius_m, **look))
        if is_small:
            _name_beside(ax, plan, middle, obstacle.name, 0.07, gap=size.min() / 2)
            continue
        frame = np.array([ax.get_xlim(), ax.get_ylim()])
        if (low < frame[:, 1]).all() and (high > frame[:, 0]).all():
            margin = 0.1 * np.ptp(frame, axis=1)
            x, y = np.clip(middle, frame[:, 0] + margin, frame[:, 1] - margin)
            add_text(ax, x, y, obstacle.name, ha="center", va="center", rotation=turned,
                     bbox=BEHIND, zorder=5)  # fmt: skip


def _ties(ax, paper, table):
    """Draw tapes, levelled heights or plumb lines, with the names of ties with marks."""
    plan, label = paper.plan, paper.word(f"legend.{table}")
    look = {"linestyle": DASHES[table], "color": OCHRE, "linewidth": 1.2, "zorder": 2}
    for tie in plan.ties:
        if tie.table != table:
            continue
        ends = np.array([plan.points[name][:2] for name in (tie.start, tie.end)])
        upright = np.ptp(ends, axis=0).max() < 0.5
        ax.plot(*ends.T, marker="x" if upright else ".", markersize=4, label=label, **look)
        label = None
        if has_own_marks(plan, tie):
            _name_beside(ax, plan, ends.mean(axis=0), tie.name, 0.07, OCHRE)


def _bases(ax, paper):
    """Draw lines between the stations of each base of a stadia."""
    plan, label = paper.plan, paper.word("legend.bases")
    for ends in group_by_ends(plan.bases):
        line = np.array([plan.points[name][:2] for name in ends])
        ax.plot(*line.T, linestyle="-.", color=OCHRE, linewidth=1.2, zorder=2, label=label)
        label = None


def _marks(ax, paper):
    """Draw the marks that are no targets, and the control points among them."""
    plan, known = paper.plan, {point.name for point in paper.plan.known}
    marks = marks_of(plan)
    for names, mark, colour, label in (
        ([name for name in marks if name not in known], "+", GREY, "marks"),
        ([name for name in marks if name in known], "s", GREEN, "control"),
    ):
        if names:
            places = np.array([marks[name][:2] for name in names])
            ax.plot(*places.T, mark, color=colour, markersize=4, markerfacecolor="none", zorder=3,
                    label=paper.word(f"legend.{label}"))  # fmt: skip
        for name in names[: MOST_NAMES if len(names) <= MOST_NAMES else 0]:
            _name_beside(ax, plan, marks[name][:2], name, 0.1)


def _views(ax, paper):
    """Draw short lines in the directions of the photographs."""
    label = paper.word("legend.views")
    for photo in paper.plan.photos:
        length = 0.3 * paper.plan.shell.radius_m
        end = photo.xyz_m[:2] - length * photo.rotation[2, :2]
        line = np.array([photo.xyz_m[:2], end]).T
        ax.plot(*line, color=PALE, linewidth=0.8, zorder=1, label=label)
        label = None


def _stands(ax, plan, places, mark, colour, label):
    """Draw positions with their names on the outer side; stacked positions share a mark."""
    at = {}
    for name, xyz in places.items():
        at.setdefault(tuple(np.round(xyz[:2], 2)), []).append(name)
    for place, names in at.items():
        ax.plot(*place, mark, color=colour, markersize=4, zorder=6, label=label,
                linestyle="none")  # fmt: skip
        label = None
        name = names[0] if len(names) == 1 else f"{names[0]} … {names[-1]}"
        _name_beside(ax, plan, np.array(place), name, 0.1)


def _name_beside(ax, plan, place, name, share, colour=GREY, gap=0.0):
    """Write a name beside a place (2,), away from the wall.

    The distance is a share of the radius of the tank plus a gap, m.
    """
    out = place - plan.shell.axis_m
    out = out / max(np.linalg.norm(out), 1e-9) * (1.0 if plan.shell.is_outside else -1.0)
    step = share * max(plan.shell.radius_m, 0.25 * np.ptp(ax.get_ylim())) + gap
    beside = "center" if abs(out[0]) < STEEP else "left" if out[0] > 0 else "right"
    add_text(ax, *(place + step * out), name, color=colour, ha=beside,
             va="center", bbox=BEHIND, zorder=5)  # fmt: skip


def _rose(ax, paper):
    """Draw an arrow along y, and a scale bar of a round length."""
    (left, right), (bottom, top) = ax.get_xlim(), ax.get_ylim()
    wide, tall = right - left, top - bottom
    foot, tip = (left + 0.05 * wide, top - 0.16 * tall), (left + 0.05 * wide, top - 0.05 * tall)
    ax.annotate("", tip, foot, arrowprops={"arrowstyle": "-|>", "color": GREY})
    add_text(ax, *tip, "y", ha="center", va="bottom")
    length = round_factor(max(1.0, wide / 6))
    start, low = left + 0.04 * wide, bottom + 0.04 * tall
    ax.plot([start, start + length], [low, low], "|-", color=GREY, linewidth=1.2, markersize=5)
    add_text(ax, start + length / 2, low, paper.plain(length, "m"), ha="center", va="bottom")
