"""The figures of the bottom: its settlement against the plane, epochs, profiles of its edge."""

from math import ceil

import numpy as np
from matplotlib.figure import Figure

from tankcal.pipeline.plot_style import FAINT, GREY, INK, RED, WIDTH, set_margins
from tankcal.report.camera.drawings import line_style, styled
from tankcal.report.inspection.paper import epoch_name
from tankcal.report.saved_paper import bearable

MOST_EPOCHS = 8
MOST_PROFILES = 6
HIGH = 2.2  # inches of the figure of epochs below its legend
LETTERS_OF_A_LINE = 96  # of a legend, its marks counted as letters
_TURN = (-6, 366)


@styled
def settlement(paper, one):
    """Elevations with the plane's cosine; below, what is out of plane, S_i with U, the limit."""
    points = one["points"]
    azimuth = np.array([point["azimuth_deg"] for point in points])
    of = {
        key: np.array([point[key] for point in points], dtype=float)
        for key in ("z_mm", "s_mm", "U_i_mm", "S_i_mm", "U_S_mm")
    }
    figure = Figure(figsize=(WIDTH, 3.5))
    above, below = figure.subplots(2, 1, sharex=True)
    turn = np.linspace(*_TURN, 373)
    plane = one["a_mm"] + one["p_mm"] * np.cos(np.radians(turn))
    plane += one["q_mm"] * np.sin(np.radians(turn))
    above.plot(turn, plane, color=FAINT, label=paper.word("legend.plane"))
    above.plot(azimuth, of["z_mm"], "o", color=INK, markersize=3, label=paper.word("legend.z"))
    below.plot(azimuth, of["U_i_mm"], "-", color=FAINT, marker=".", markersize=3,
               label=_indexed(paper.word("legend.U_i")))  # fmt: skip
    _curvatures(paper, below, azimuth, of, points)
    _limits(paper, below, azimuth, one)
    below.axhline(0, color=GREY, linewidth=0.6)
    above.set_ylabel(paper.word("axes.change" if one["since"] else "axes.elevation"))
    below.set_ylabel(_indexed(paper.word("axes.out_of_plane")))
    below.set_xlabel(paper.word("axes.azimuth"))
    for ax in (above, below):
        ax.set(xlim=_TURN, xticks=range(0, 361, 45))
        ax.grid(True)
    top = _legend(figure, above, below)
    set_margins(figure, left=0.65, right=0.1, bottom=0.42, top=top, hspace=0.1)
    return figure


def _limits(paper, ax, azimuth, one):
    """The limit of S at every point: where they are not even it is not the same."""
    limits = [point.get("limit_mm", one["limit_mm"]) for point in one["points"]]
    if not limits or None in limits:
        return
    azimuth = np.concatenate([azimuth[-1:] - 360, azimuth, azimuth[:1] + 360])
    closed = np.array([limits[-1], *limits, limits[0]])
    style = {"color": RED, "linewidth": 0.9, "linestyle": "--"}
    ax.plot(azimuth, closed, **style, label=paper.word("legend.limit"))
    ax.plot(azimuth, -closed, **style)


def _curvatures(paper, ax, azimuth, of, points):
    """S_i with U where it is known; points of the subset are full."""
    known = np.isfinite(of["S_i_mm"])
    if not known.any():
        return
    U = np.where(np.isfinite(of["U_S_mm"]), of["U_S_mm"], 0.0)
    ax.errorbar(azimuth[known], of["S_i_mm"][known], U[known], fmt="none", ecolor=INK,
                elinewidth=0.7, capsize=2)  # fmt: skip
    inside = np.array([point["in_subset"] for point in points])
    for name, chosen, face in (("S_subset", inside, INK), ("S_others", ~inside, "white")):
        if (chosen & known).any():
            ax.plot(azimuth[chosen & known], of["S_i_mm"][chosen & known], "o", color=INK,
                    markerfacecolor=face, markersize=4,
                    label=_indexed(paper.word(f"legend.{name}")))  # fmt: skip


@styled
def epochs(paper):
    """What is out of plane in every epoch and difference, against the azimuth."""
    shown = paper.found["settlements"][:MOST_EPOCHS]
    figure = Figure(figsize=(WIDTH, HIGH))
    ax = figure.subplots()
    for number, one in enumerate(shown):
        azimuth = [point["azimuth_deg"] for point in one["points"]]
        out = [point["U_i_mm"] for point in one["points"]]
        name = paper.word("legend.epoch", epoch=bearable(epoch_name(one)))
        ax.plot(azimuth, out, **line_style(number), marker=".", markersize=4, label=name)
    ax.axhline(0, color=GREY, linewidth=0.6)
    ax.set(xlim=_TURN, xticks=range(0, 361, 45), xlabel=paper.word("axes.azimuth"))
    ax.set_ylabel(_indexed(paper.word("axes.out")))
    ax.grid(True)
    top = _legend(figure, ax, of_users=True)
    figure.set_figheight(HIGH + top)
    set_margins(figure, left=0.65, right=0.1, bottom=0.42, top=top)
    return figure


@styled
def edges(paper):
    """Profiles of the edge, the deepest first: readings, the break, what the limit allows."""
    shown = shown_edges(paper.found)
    across = min(3, len(shown))
    down = ceil(len(shown) / across)
    figure = Figure(figsize=(WIDTH, 1.75 * down + 0.45))
    axes = figure.subplots(down, across, squeeze=False, sharex=True, sharey=True).ravel()
    for ax, one in zip(axes, shown, strict=False):
        _edge(paper, ax, one)
    for place, ax in enumerate(axes):
        ax.axis("on" if place < len(shown) else "off")
        if place % across == 0:
            ax.set_ylabel(paper.word("axes.edge"))
        if place >= len(shown) - across:
            ax.set_xlabel(paper.word("axes.radius"))
            ax.tick_params(labelbottom=True)
    set_margins(figure, left=0.65, right=0.1, bottom=0.42, top=0.24, hspace=0.32, wspace=0.1)
    return figure


def shown_edges(found):
    """The profiles that are drawn, the deepest first; those without a break last."""
    depth = {id(one): -1e9 if one["drop_mm"] is None else one["drop_mm"] for one in found["edges"]}
    return sorted(found["edges"], key=lambda one: -depth[id(one)])[:MOST_PROFILES]


def _edge(paper, ax, one):
    radius, z = np.array(one["radius_m"]), np.array(one["z_mm"])
    order = np.argsort(radius)
    radius, z = radius[order], z[order]
    ax.plot(radius, z, color=INK, marker=".", markersize=3.5)
    if one["break_radius_m"] is not None:
        start = one["break_radius_m"]
        level = float(np.interp(start, radius, z))
        shell = start + (one["width_m"] or 0.0)
        ax.axvline(start, color=FAINT, linewidth=0.7)
        ax.plot([start, shell], [level, level], color=GREY, linewidth=0.6)
        if one["limit_mm"] is not None:
            lowest = level - one["limit_mm"]
            ax.plot([start, shell], [lowest, lowest], color=RED, linewidth=0.9, linestyle="--")
    title = paper.azimuth(one["azimuth_deg"])
    ax.set_title(title, loc="left", fontsize=8, pad=2, parse_math=False)
    ax.grid(True)


def _legend(figure, *axes, of_users=False):
    """The legend above; names of users in it are never mathematics. Returns its height, inches."""
    handles, labels = [], []
    for ax in axes:
        found = ax.get_legend_handles_labels()
        handles += found[0]
        labels += found[1]
    longest = max(map(len, labels)) + 6
    columns = max(1, min(LETTERS_OF_A_LINE // longest, len(labels)))
    legend = figure.legend(
        handles, labels, loc="upper right", ncols=columns, fontsize=7.5, frameon=False,
        columnspacing=1.2, handlelength=1.6,
    )  # fmt: skip
    for text in legend.get_texts():
        text.set_parse_math(not of_users)
    return 0.14 * ceil(len(labels) / columns) + 0.14


def _indexed(text):
    """Words of ours for a figure: U_i and S_i set as mathematics."""
    return text.replace("U_i", "$U_i$").replace("S_i", "$S_i$")
