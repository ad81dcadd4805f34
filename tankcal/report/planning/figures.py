"""Figures of a prediction: U against dip, weak areas, rays of the points, effects of changes."""

import numpy as np
from matplotlib.figure import Figure

from tankcal.report.planning.sketches import unrolled_wall
from tankcal.report.plots.style import (
    GREY,
    INK,
    PALE,
    RED,
    WIDTH,
    rasterize_many,
    set_margins,
    styled,
)

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
    for ax, values in zip((left, right), _by_geometry(paper, some), strict=False):
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


def _by_geometry(paper, some):
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
