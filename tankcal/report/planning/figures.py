"""Figures of a plan: the unrolled wall, the site from above, and the prediction."""

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle

from tankcal.planning.model import TAPED, Box
from tankcal.planning.places import full_turn, group_by_ends, joints_m, place_of, reference_rad
from tankcal.report.planning.rows import lost_points
from tankcal.report.plots.style import (
    FAINT,
    GREY,
    INK,
    PALE,
    RED,
    WIDTH,
    rasterize_many,
    round_factor,
    set_margins,
    styled,
)

GREEN, OCHRE = "#2e7d5b", "#b9770e"
SMALL = 6.5
MOST_LABELS = 60  # largest number of lines of targets that are all numbered
NEAR_M = 1.0  # largest distance from the wall of a mark that is drawn on it
DASHES = {"distances": "-", "height_differences": ":", "plumb_lines": "--"}
BEHIND = {"facecolor": "white", "edgecolor": "none", "alpha": 0.75, "pad": 0.6}


@styled
def wall(paper):
    """The wall unrolled from the reference weld: targets by line and row, control, tapes."""
    plan, lost = paper.plan, lost_points(paper.prediction)
    figure, ax = unrolled_wall(paper, named=True)
    targets = plan.targets
    seen = np.array([name not in lost for name in targets.names])
    ax.plot(targets.arc_m[seen], targets.height_m[seen], ".", color=INK, markersize=3,
            zorder=3, label=paper.word("legend.targets"),
            **rasterize_many(targets.names))  # fmt: skip
    look = {"color": GREEN, "markersize": 5.5, "markerfacecolor": "none"}
    positions = [known.xyz_m for known in paper.plan.known]
    _mark_near(ax, paper, positions, "s", label=paper.word("legend.control"), **look)
    _draw_marks_on_wall(ax, paper, lost)
    for table in TAPED:
        _draw_ties_on_wall(ax, paper, table)
    _unseen(ax, paper, lost)
    _names(ax, targets)
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.2), ncols=5, frameon=False,
              fontsize=7.5, columnspacing=1.2)  # fmt: skip
    set_margins(figure, left=0.5, right=0.35, bottom=0.85, top=0.3)
    return figure


def unrolled_wall(paper, high=2.8, named=False):
    """Draw the unrolled wall with courses and welds, arc by height.

    Parameters
    ----------
    paper : PlanPaper
    high : float, optional
        Height of the figure, inches.
    named : bool, optional
        Whether welds have names for a legend.

    Returns
    -------
    figure : Figure
    ax : Axes
    """
    plan, joints = paper.plan, joints_m(paper.plan)
    around = 2 * np.pi * plan.shell.radius_m
    figure = Figure(figsize=(WIDTH, high))
    ax = figure.subplots()
    ax.hlines(joints, 0, around, color=FAINT, linewidth=0.6)
    turns = full_turn(np.array(plan.targets.welds_rad) - reference_rad(plan))
    for arcs, style, name in (
        (turns[turns > 0] * plan.shell.radius_m, {"color": FAINT, "linewidth": 0.6}, "welds"),
        ([0, around], {"color": GREY, "linewidth": 1.8}, "weld"),
    ):
        label = paper.word(f"legend.{name}") if named and len(arcs) else None
        ax.vlines(arcs, joints[0], joints[-1], label=label, **style)
    ax.set(xlim=(-0.02 * around, 1.02 * around), ylim=(joints[0], joints[-1]))
    ax.set_xlabel(paper.word("axes.arc"))
    ax.set_ylabel(paper.word("axes.height_above_bottom"))
    return figure, ax


def _mark_near(ax, paper, positions, mark, **look):
    """Draw marks at the positions (3,) near the wall."""
    places = [place_of(paper.plan, xyz) for xyz in positions]
    places = [place for place in places if abs(place.off_m) < NEAR_M]
    if places:
        arcs, heights = zip(*((place.arc_m, place.height_m) for place in places), strict=True)
        ax.plot(arcs, heights, mark, **look)


def marks_of(plan):
    """Return {name: (3,)} of the points that are neither targets, tape ends nor set-ups."""
    others = {end for tie in plan.ties for end in (tie.start, tie.end)}
    others |= {setup.name for setup in plan.setups}
    return {name: xyz for name, xyz in plan.extra.items() if name not in others}


def _draw_marks_on_wall(ax, paper, lost):
    """Draw the marks beside the wall, with their names."""
    places = {name: place_of(paper.plan, xyz) for name, xyz in marks_of(paper.plan).items()}
    near = {name: place for name, place in places.items() if abs(place.off_m) < NEAR_M}
    label = paper.word("legend.marks")
    for name, place in near.items():
        if name not in lost:
            ax.plot(place.arc_m, place.height_m, "+", color=GREY, markersize=5, label=label)
            label = None
        add_text(ax, place.arc_m, place.height_m, f"  {name}", ha="left", va="center")


def _draw_ties_on_wall(ax, paper, table):
    """Draw tapes, levelled heights or plumb lines, with their ends and names."""
    plan, points = paper.plan, paper.plan.points
    around, label = 2 * np.pi * plan.shell.radius_m, paper.word(f"legend.{table}")
    look = {"linestyle": DASHES[table], "color": OCHRE, "linewidth": 1, "markersize": 3}
    for tie in plan.ties:
        if tie.table != table:
            continue
        start, end = (place_of(plan, points[name]) for name in (tie.start, tie.end))
        # The shorter way round the tank; a tie across the reference weld is drawn at both edges.
        across = (end.arc_m - start.arc_m + around / 2) % around - around / 2
        for shift in (0.0, around if start.arc_m + across < 0 else -around):
            x = np.array([start.arc_m, start.arc_m + across]) + shift
            if x.max() < 0 or x.min() > around:
                continue
            ax.plot(x, [start.height_m, end.height_m], marker=".", label=label, **look)
            label = None
            if has_own_marks(plan, tie):
                middle = np.clip(x.mean(), 0, around), (start.height_m + end.height_m) / 2
                add_text(ax, *middle, tie.name, color=OCHRE, ha="center", va="center", bbox=BEHIND,
                     zorder=2.5, clip_on=True)  # fmt: skip


def has_own_marks(plan, tie):
    """Whether an end of a tie is no target; a tie between targets needs no name of its own."""
    return bool({tie.start, tie.end} - set(plan.targets.names))


def _unseen(ax, paper, lost):
    """Draw the points that the planned survey does not determine."""
    positions = [xyz for name, xyz in paper.plan.points.items() if name in lost]
    look = {"color": RED, "markersize": 4.5, "zorder": 4}
    _mark_near(ax, paper, positions, "x", label=paper.word("legend.unseen"), **look)


def _names(ax, targets):
    """Write the numbers of the lines above the wall, and of the rows at its right."""
    lines = dict(zip(targets.generatrix, targets.arc_m.tolist(), strict=True))
    every = -(-len(lines) // MOST_LABELS)
    top, right = ax.get_ylim()[1], ax.get_xlim()[1]
    for name, arc in [*lines.items()][::every]:
        add_text(ax, arc, top, name, va="bottom", ha="center")
    for name, height in dict(zip(targets.section, targets.height_m, strict=True)).items():
        add_text(ax, right, height, f" {name}", va="center", ha="left")


def add_text(ax, x, y, words, **more):
    """Add a small text that is never parsed as a formula."""
    ax.text(x, y, words, **{"fontsize": SMALL, "color": GREY, "parse_math": False} | more)


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
        _draw_ties_on_plan(ax, paper, table)
    _bases(ax, paper)
    _draw_marks_on_plan(ax, paper)
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


def _draw_ties_on_plan(ax, paper, table):
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


def _draw_marks_on_plan(ax, paper):
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


MOST = 32  # bars in a figure
LABELS, GAP = 2.4, 0.12  # inches: least width of the names of bars; space beside the longest name
COLOURS = {"add": INK, "repeat": PALE, "drop": RED}


@styled
def uncertainty(paper):
    """U of every row against the dip, in m3 and relative to the volume, with the limit if any."""
    table, limits = paper.prediction.table, paper.plan.limits
    some = table.volume_m3 > 0.02 * table.volume_m3[-1]  # near the bottom U over volume diverges
    figure = Figure(figsize=(WIDTH, 2.4))
    left, right = figure.subplots(1, 2)
    for ax, values in zip((left, right), _U_by_geometry(paper, some), strict=False):
        ax.plot(*values, color=GREY, linestyle="--", label=paper.word("legend.by_geometry"))
    left.plot(table.height_m, table.U_m3, color=INK)
    left.set_ylabel(paper.word("axes.U_m3"))
    share = 100 * table.U_m3[some] / table.volume_m3[some]
    right.plot(table.height_m[some], share, color=INK)
    right.set_ylabel(paper.word("axes.relative_u"))
    if limits.relative_u is not None and limits.quantity == "top":
        right.axhline(100 * limits.relative_u, color=RED, linewidth=0.9)
    for ax in (left, right):
        ax.set_xlabel(paper.word("axes.dip"))
        ax.set_xlim(0, table.height_m[-1])
        ax.set_ylim(bottom=0)
        ax.grid(True)
    if left.get_legend_handles_labels()[0]:
        left.legend(loc="best", frameon=False)
    set_margins(figure, left=0.6, right=0.12, bottom=0.42, top=0.08, wspace=0.3)
    return figure


def _U_by_geometry(paper, some):
    """Return ((dips, U), (dips, U over volume in percent)) by geometry only; () without liquid."""
    liquid = getattr(paper.prediction.result, "liquid", None)
    if liquid is None:
        return ()
    before, dips = liquid.tables["geometry"], paper.prediction.table.height_m
    return (dips, before.U_m3), (dips[some], 100 * before.U_m3[some] / before.volume_m3[some])


@styled
def weak_areas(paper):
    """The unrolled wall: targets coloured by largest sd; weak and undetermined ones marked."""
    targets, points = paper.plan.targets, _points_of_targets(paper)
    sd_mm = np.array([1000 * point.sd_m.max() for point in points])
    known = np.isfinite(sd_mm)
    figure, ax = unrolled_wall(paper, 2.9)
    shown = ax.scatter(
        targets.arc_m[known], targets.height_m[known], c=sd_mm[known], s=18, cmap="viridis_r",
        zorder=3, **rasterize_many(points),
    )  # fmt: skip
    for name, mark in (("weak", "o"), ("undetermined", "x")):
        marked = np.array([bool(getattr(point, name)) for point in points])
        if marked.any():
            fill = {"markerfacecolor": "none"} if mark == "o" else {}
            ax.plot(
                targets.arc_m[marked], targets.height_m[marked], mark, color=RED, markersize=7,
                label=paper.word(f"legend.{name}"), **fill, zorder=4,
            )  # fmt: skip
    if ax.get_legend_handles_labels()[0]:
        ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.2), ncols=2, frameon=False)
    bar = figure.colorbar(shown, ax=ax, pad=0.02, aspect=30)
    bar.set_label(paper.word("axes.largest_sd"))
    figure.subplots_adjust(left=0.075, right=1.04, bottom=0.26, top=0.97)
    return figure


@styled
def rays(paper):
    """Number of targets by number of rays; numbers of rays below the limit are red."""
    counts = np.bincount([point.rays for point in _points_of_targets(paper)])
    few = np.arange(len(counts)) < max(paper.fewest_rays, 1)
    figure = Figure(figsize=(WIDTH, 1.9))
    ax = figure.subplots()
    ax.bar(range(len(counts)), counts, color=np.where(few, RED, INK), width=0.7)
    ax.set_xticks(range(len(counts)))
    ax.set_xlabel(paper.word("axes.rays"))
    ax.set_ylabel(paper.word("axes.targets"))
    ax.grid(True, axis="y")
    ax.set_axisbelow(True)
    set_margins(figure, left=0.6, right=0.12, bottom=0.42, top=0.08)
    return figure


def _points_of_targets(paper):
    return paper.prediction.points[: len(paper.plan.targets.names)]


@styled
def changes(paper):
    """Bars of the change of U over volume, in ppm, by the largest possible effects of changes."""
    possible = [effect for effect in paper.effects if not effect.why]
    shown = sorted(possible, key=lambda effect: -abs(effect.difference))[:MOST]
    shown = sorted(shown, key=lambda effect: effect.difference)
    figure = Figure(figsize=(WIDTH, 0.9 + 0.17 * len(shown)))
    ax = figure.subplots()
    places = range(len(shown))
    values = [1e6 * effect.difference for effect in shown]
    ax.barh(places, values, color=[COLOURS[effect.change.action] for effect in shown])
    names = [paper.describe_change(effect.change) for effect in shown]
    ax.set_yticks(places, names, parse_math=False)
    ax.invert_yaxis()
    ax.axvline(0.0, color=GREY, linewidth=0.5)
    ax.set_xlabel(paper.word("axes.change_of_u"))
    ax.grid(True, axis="x")
    ax.set_axisbelow(True)
    wide = [label.get_window_extent().width / figure.dpi for label in ax.get_yticklabels()]
    left = max(LABELS, max(wide, default=0.0) + GAP)
    set_margins(figure, left=left, right=0.12, bottom=0.45, top=0.08)
    return figure
