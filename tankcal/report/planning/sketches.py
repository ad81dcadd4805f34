"""Sketch of the unrolled wall of a plan: targets, control, tapes, welds."""

import numpy as np
from matplotlib.figure import Figure

from tankcal.planning.model import TAPED
from tankcal.planning.places import full_turn, joints_m, place_of, reference_rad
from tankcal.report.planning.rows import lost_points
from tankcal.report.plots.style import (
    FAINT,
    GREY,
    INK,
    RED,
    WIDTH,
    rasterize_many,
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
    _marks(ax, paper, lost)
    for table in TAPED:
        _ties(ax, paper, table)
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


def _marks(ax, paper, lost):
    """Draw the marks beside the wall, with their names."""
    places = {name: place_of(paper.plan, xyz) for name, xyz in marks_of(paper.plan).items()}
    near = {name: place for name, place in places.items() if abs(place.off_m) < NEAR_M}
    label = paper.word("legend.marks")
    for name, place in near.items():
        if name not in lost:
            ax.plot(place.arc_m, place.height_m, "+", color=GREY, markersize=5, label=label)
            label = None
        add_text(ax, place.arc_m, place.height_m, f"  {name}", ha="left", va="center")


def _ties(ax, paper, table):
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
