"""The wall of a plan unrolled: targets, control, tapes, welds."""

import numpy as np
from matplotlib.figure import Figure

from tankcal.pipeline.plot_style import (
    FAINT,
    GREY,
    INK,
    RED,
    WIDTH,
    rasterize_many,
    set_margins,
    styled,
)
from tankcal.planning.model import TAPED
from tankcal.planning.patterns import full_turn
from tankcal.planning.places import joints_m, place_of, reference_rad
from tankcal.report.planning.rows import lost_points

GREEN, OCHRE = "#2e7d5b", "#b9770e"
SMALL = 6.5
MOST_LABELS = 60  # lines of targets that are all numbered
NEAR_M = 1.0  # from the wall: marks further off have no place on it
DASHES = {"distances": "-", "height_differences": ":", "plumb_lines": "--"}
BEHIND = {"facecolor": "white", "edgecolor": "none", "alpha": 0.75, "pad": 0.6}


@styled
def wall(paper):
    """The wall unrolled from the reference weld: targets by line and row, control, tapes."""
    plan, lost = paper.plan, lost_points(paper.prediction)
    figure, ax = unrolled(paper, named=True)
    targets = plan.targets
    seen = np.array([name not in lost for name in targets.names])
    ax.plot(targets.arc_m[seen], targets.height_m[seen], ".", color=INK, markersize=3,
            zorder=3, label=paper.word("legend.targets"),
            **rasterize_many(targets.names))  # fmt: skip
    _control(ax, paper)
    _marks(ax, paper, lost)
    for table in TAPED:
        _ties(ax, paper, table)
    _unseen(ax, paper, lost)
    _names(ax, targets)
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.2), ncols=5, frameon=False,
              fontsize=7.5, columnspacing=1.2)  # fmt: skip
    set_margins(figure, left=0.5, right=0.35, bottom=0.85, top=0.3)
    return figure


def unrolled(paper, high=2.8, named=False):
    """A figure with the unrolled wall: its courses and welds, arc by height; (figure, axes).

    named  True: welds have names for a legend
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


def _control(ax, paper):
    places = [place_of(paper.plan, one.xyz_m) for one in paper.plan.known]
    places = [one for one in places if abs(one.off_m) < NEAR_M]
    if places:
        ax.plot(
            [one.arc_m for one in places], [one.height_m for one in places], "s", color=GREEN,
            markersize=5.5, markerfacecolor="none", label=paper.word("legend.control"),
        )  # fmt: skip


def marks_of(plan):
    """{name: (3,)} of the points that are no targets, no ends of tapes and no set-ups."""
    ends = {end for one in plan.ties for end in (one.start, one.end)}
    ends |= {one.name for one in plan.setups}
    return {name: xyz for name, xyz in plan.extra.items() if name not in ends}


def _marks(ax, paper, lost):
    """Marks beside the wall, with their names."""
    places = {name: place_of(paper.plan, xyz) for name, xyz in marks_of(paper.plan).items()}
    near = {name: one for name, one in places.items() if abs(one.off_m) < NEAR_M}
    label = paper.word("legend.marks")
    for name, one in near.items():
        if name not in lost:
            ax.plot(one.arc_m, one.height_m, "+", color=GREY, markersize=5, label=label)
            label = None
        text(ax, one.arc_m, one.height_m, f"  {name}", ha="left", va="center")


def _ties(ax, paper, table):
    """Tapes, levelled heights or plumb lines, with their ends and names."""
    plan, points = paper.plan, paper.plan.points
    around, label = 2 * np.pi * plan.shell.radius_m, paper.word(f"legend.{table}")
    look = {"linestyle": DASHES[table], "color": OCHRE, "linewidth": 1, "markersize": 3}
    for one in plan.ties:
        if one.table != table:
            continue
        start, end = (place_of(plan, points[name]) for name in (one.start, one.end))
        across = (end.arc_m - start.arc_m + around / 2) % around - around / 2
        for shift in (0.0, around if start.arc_m + across < 0 else -around):
            x = np.array([start.arc_m, start.arc_m + across]) + shift
            if x.max() < 0 or x.min() > around:
                continue
            ax.plot(x, [start.height_m, end.height_m], marker=".", label=label, **look)
            label = None
            if own_name(plan, one):
                middle = np.clip(x.mean(), 0, around), (start.height_m + end.height_m) / 2
                text(ax, *middle, one.name, color=OCHRE, ha="center", va="center", bbox=BEHIND,
                     zorder=2.5, clip_on=True)  # fmt: skip


def own_name(plan, tie):
    """Whether a tie has marks of its own; the names of targets say where one between them is."""
    return bool({tie.start, tie.end} - set(plan.targets.names))


def _unseen(ax, paper, lost):
    """Points that the planned survey does not determine."""
    places = [place_of(paper.plan, xyz) for name, xyz in paper.plan.points.items() if name in lost]
    places = [one for one in places if abs(one.off_m) < NEAR_M]
    if places:
        ax.plot(
            [one.arc_m for one in places], [one.height_m for one in places], "x", color=RED,
            markersize=4.5, zorder=4, label=paper.word("legend.unseen"),
        )  # fmt: skip


def _names(ax, targets):
    """Numbers of the lines above the wall, of the rows at its right."""
    lines = dict(zip(targets.generatrix, targets.arc_m.tolist(), strict=True))
    every = -(-len(lines) // MOST_LABELS)
    top, right = ax.get_ylim()[1], ax.get_xlim()[1]
    for name, arc in [*lines.items()][::every]:
        text(ax, arc, top, name, va="bottom", ha="center")
    for name, height in dict(zip(targets.section, targets.height_m, strict=True)).items():
        text(ax, right, height, f" {name}", va="center", ha="left")


def text(ax, x, y, words, **more):
    """A small text, never read as a formula."""
    ax.text(x, y, words, **{"fontsize": SMALL, "color": GREY, "parse_math": False} | more)
