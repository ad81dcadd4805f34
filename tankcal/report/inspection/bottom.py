"""Sections on the bottom: settlement of each epoch and between epochs, edge, with figures."""

from math import ceil

import numpy as np
from matplotlib.figure import Figure

from tankcal.report import blocks
from tankcal.report.camera.figures import line_style, styled
from tankcal.report.inspection.paper import epoch_name
from tankcal.report.inspection.tables import CHECKS, EDGES, POINTS, READING
from tankcal.report.plots.style import FAINT, GREY, INK, RED, WIDTH, set_margins
from tankcal.report.saved_document import bearable
from tankcal.report.tables import Column

# Largest number of points, and of letters of a name, for a table in two columns of the page.
FEW_POINTS, SHORT_NAME = 32, 8
MOST_EPOCHS, MOST_PROFILES = 8, 6  # largest number of curves and of profiles in a figure
HIGH = 2.2  # height of the figure of epochs below its legend, in
LETTERS_OF_A_LINE = 96  # letters in a line of a legend, in which a mark counts as letters
_TURN = (-6, 366)  # range of azimuths in figures, deg
USED = Column("used", decimals=0)
SETTLEMENT = ("settlement_cosine", "settlement_all", "settlement_subset", "settlement_curvature",
              "settlement_de_beer")  # fmt: skip


def settlements(paper):
    """Blocks on each epoch, then on the differences, after a figure with all epochs."""
    items = paper.record["settlements"]
    if not items:
        return []
    has_several = len(items) > 1
    # A figure with a reading beside it estimates a true value.
    has_estimates = any(check["reading"] is not None for check in paper.record["checks"])
    return [
        paper.heading("settlement"),
        *([paper.figure(draw_epochs(paper), "epochs")] if has_several else []),
        paper.paragraph("settlement"),
        *([paper.paragraph("estimates")] if has_estimates else []),
        *(block for item in items for block in settlement_blocks(paper, item)),
    ]


def settlement_blocks(paper, item):
    """Blocks on an epoch or a difference: figure, plane, and table of verdicts."""
    name, epoch = bearable(epoch_name(item)), bearable(item["epoch"])
    if item["since"] is None:
        heading = paper.word("headings.epoch", epoch=epoch)
        introduction = paper.word("texts.epoch_as_built")
    else:
        since = bearable(item["since"])
        heading = paper.word("headings.difference", epoch=epoch, since=since)
        introduction = paper.word("texts.epoch_difference", since=since)
    return [
        blocks.heading(heading, 2),
        paper.figure(draw_settlement(paper, item), "settlement_figure", epoch=name),
        blocks.paragraph(f"{introduction} {_plane(paper, item)} {_limits(paper, item)}"),
        *_verdicts(paper, item),
    ]


def _plane(paper, item):
    """Sentence on the plane, with U if known, and the share of the variance that it explains."""
    mm, two = "image mm", {"decimals": 2}
    values = {
        "b": paper.number(item["b_mm"], mm, **two),
        "azimuth": paper.azimuth(item["highest_azimuth_deg"]),
        "tilt": f"{paper.number(item['tilt_mm_per_m'], **two)}\N{NO-BREAK SPACE}mm/m",
        "share": paper.number(item["R2"], decimals=4),
        "a": paper.number(item["a_mm"], mm, **two),
        "p": paper.number(item["p_mm"], mm, **two),
        "q": paper.number(item["q_mm"], mm, **two),
    }
    if item["U_b_mm"] is None:
        return paper.word("texts.plane_without_u", **values)
    return paper.word("texts.plane", U=paper.number(item["U_b_mm"], mm, **two), **values)


def _limits(paper, item):
    """Sentence on the limit of S for all points, and for every second point."""
    if item["limit_mm"] is None:
        return paper.word("texts.no_settlement_limit")
    values = {
        "points": len(item["points"]),
        "limit": paper.number(item["limit_mm"], "image mm", decimals=2),
        "arc": paper.number(item["arc_m"], "m", decimals=2),
    }
    if item["limit_half_mm"] is None:
        return paper.word("texts.limit_by_points", **values)
    half = paper.number(item["limit_half_mm"], "image mm", decimals=2)
    return paper.word("texts.limit_by_half", half=half, fewer=len(item["points"]) // 2, **values)


def _verdicts(paper, item):
    """Table of the verdicts of an epoch, each with its number of points."""
    name = epoch_name(item)
    checks = [
        entry
        for entry in paper.record["checks"]
        if entry["code"] in SETTLEMENT and entry["epoch"] == name
    ]
    if not checks:
        return []
    columns = [entry for entry in CHECKS.on_paper() if entry.key not in ("place", "probability")]
    of_reading = [READING] if any(entry["reading"] is not None for entry in checks) else []
    return [
        paper.table("settlement_verdicts", checks, [columns[0], USED, *of_reading, *columns[1:]],
                    epoch=name),
    ]  # fmt: skip


def points(paper):
    """Blocks with the points of all epochs and differences; the last section, with long tables."""
    items = paper.record["settlements"]
    if not items:
        return []
    tables = [
        paper.show(POINTS, item["points"], across=_column_count(item["points"]),
                   epoch=bearable(epoch_name(item)))
        for item in items
    ]  # fmt: skip
    return [paper.heading("points"), *tables]


def _column_count(points):
    """Number of columns of the page for a short table of points; None for a long table."""
    short = all(len(point["point"]) <= SHORT_NAME for point in points)
    return 2 if short and len(points) <= FEW_POINTS else None


def edges(paper):
    """Blocks with the profiles of the edge, and the table of their drops."""
    profiles = paper.record["edges"]
    if not profiles:
        return []
    return [
        paper.heading("edges"),
        paper.figure(draw_edges(paper), "edges_figure"),
        blocks.with_next(paper.paragraph("edges")),
        paper.show(EDGES, profiles),
    ]


# ---- figures


@styled
def draw_settlement(paper, item):
    """Draw elevations with the plane; below, residuals U_i, S_i with U, and the limit."""
    points = item["points"]
    azimuth = np.array([point["azimuth_deg"] for point in points])
    values = {
        key: np.array([point[key] for point in points], dtype=float)
        for key in ("z_mm", "s_mm", "U_i_mm", "S_i_mm", "U_S_mm")
    }
    figure = Figure(figsize=(WIDTH, 3.5))
    above, below = figure.subplots(2, 1, sharex=True)
    turn = np.linspace(*_TURN, 373)
    plane = item["a_mm"] + item["p_mm"] * np.cos(np.radians(turn))
    plane += item["q_mm"] * np.sin(np.radians(turn))
    above.plot(turn, plane, color=FAINT, label=paper.word("legend.plane"))
    above.plot(azimuth, values["z_mm"], "o", color=INK, markersize=3, label=paper.word("legend.z"))
    below.plot(azimuth, values["U_i_mm"], "-", color=FAINT, marker=".", markersize=3,
               label=_set_indices(paper.word("legend.U_i")))  # fmt: skip
    _draw_curvatures(paper, below, azimuth, values, points)
    _draw_limits(paper, below, azimuth, item)
    below.axhline(0, color=GREY, linewidth=0.6)
    above.set_ylabel(paper.word("axes.change" if item["since"] else "axes.elevation"))
    below.set_ylabel(_set_indices(paper.word("axes.out_of_plane")))
    below.set_xlabel(paper.word("axes.azimuth"))
    for ax in (above, below):
        ax.set(xlim=_TURN, xticks=range(0, 361, 45))
        ax.grid(True)
    top = _draw_legend(figure, above, below)
    set_margins(figure, left=0.65, right=0.1, bottom=0.42, top=top, hspace=0.1)
    return figure


def _draw_limits(paper, ax, azimuth, item):
    """Draw the limit of S at every point, which depends on the spacing of the points."""
    limits = [point.get("limit_mm", item["limit_mm"]) for point in item["points"]]
    if not limits or None in limits:
        return
    azimuth = np.concatenate([azimuth[-1:] - 360, azimuth, azimuth[:1] + 360])
    closed = np.array([limits[-1], *limits, limits[0]])
    style = {"color": RED, "linewidth": 0.9, "linestyle": "--"}
    ax.plot(azimuth, closed, **style, label=paper.word("legend.limit"))
    ax.plot(azimuth, -closed, **style)


def _draw_curvatures(paper, ax, azimuth, values, points):
    """Draw S_i, with U if known; points of the subset are filled."""
    known = np.isfinite(values["S_i_mm"])
    if not known.any():
        return
    U = np.where(np.isfinite(values["U_S_mm"]), values["U_S_mm"], 0.0)
    ax.errorbar(azimuth[known], values["S_i_mm"][known], U[known], fmt="none", ecolor=INK,
                elinewidth=0.7, capsize=2)  # fmt: skip
    inside = np.array([point["in_subset"] for point in points])
    for name, chosen, face in (("S_subset", inside, INK), ("S_others", ~inside, "white")):
        if (chosen & known).any():
            ax.plot(azimuth[chosen & known], values["S_i_mm"][chosen & known], "o", color=INK,
                    markerfacecolor=face, markersize=4,
                    label=_set_indices(paper.word(f"legend.{name}")))  # fmt: skip


@styled
def draw_epochs(paper):
    """Draw the residuals U_i of all epochs and differences against the azimuth."""
    shown = paper.record["settlements"][:MOST_EPOCHS]
    figure = Figure(figsize=(WIDTH, HIGH))
    ax = figure.subplots()
    for number, item in enumerate(shown):
        azimuth = [point["azimuth_deg"] for point in item["points"]]
        out = [point["U_i_mm"] for point in item["points"]]
        name = paper.word("legend.epoch", epoch=bearable(epoch_name(item)))
        ax.plot(azimuth, out, **line_style(number), marker=".", markersize=4, label=name)
    ax.axhline(0, color=GREY, linewidth=0.6)
    ax.set(xlim=_TURN, xticks=range(0, 361, 45), xlabel=paper.word("axes.azimuth"))
    ax.set_ylabel(_set_indices(paper.word("axes.out")))
    ax.grid(True)
    top = _draw_legend(figure, ax, has_user_names=True)
    figure.set_figheight(HIGH + top)
    set_margins(figure, left=0.65, right=0.1, bottom=0.42, top=top)
    return figure


@styled
def draw_edges(paper):
    """Draw profiles of the edge, the deepest first: readings, break-over point and limit."""
    shown = _edges_by_depth(paper.record)
    across = min(3, len(shown))
    down = ceil(len(shown) / across)
    figure = Figure(figsize=(WIDTH, 1.75 * down + 0.45))
    axes = figure.subplots(down, across, squeeze=False, sharex=True, sharey=True).ravel()
    for ax, profile in zip(axes, shown, strict=False):
        _draw_edge(paper, ax, profile)
    for place, ax in enumerate(axes):
        ax.axis("on" if place < len(shown) else "off")
        if place % across == 0:
            ax.set_ylabel(paper.word("axes.edge"))
        if place >= len(shown) - across:
            ax.set_xlabel(paper.word("axes.radius"))
            ax.tick_params(labelbottom=True)
    set_margins(figure, left=0.65, right=0.1, bottom=0.42, top=0.24, hspace=0.32, wspace=0.1)
    return figure


def _edges_by_depth(inspection):
    """Select the profiles of the figure, the deepest first, without a break-over point last."""
    depth = {
        id(profile): -1e9 if profile["drop_mm"] is None else profile["drop_mm"]
        for profile in inspection["edges"]
    }
    return sorted(inspection["edges"], key=lambda profile: -depth[id(profile)])[:MOST_PROFILES]


def _draw_edge(paper, ax, profile):
    """Draw a profile of the edge in a panel."""
    radius, z = np.array(profile["radius_m"]), np.array(profile["z_mm"])
    order = np.argsort(radius)
    radius, z = radius[order], z[order]
    ax.plot(radius, z, color=INK, marker=".", markersize=3.5)
    if profile["break_radius_m"] is not None:
        start = profile["break_radius_m"]
        level = float(np.interp(start, radius, z))
        shell = start + (profile["width_m"] or 0.0)
        ax.axvline(start, color=FAINT, linewidth=0.7)
        ax.plot([start, shell], [level, level], color=GREY, linewidth=0.6)
        if profile["limit_mm"] is not None:
            lowest = level - profile["limit_mm"]
            ax.plot([start, shell], [lowest, lowest], color=RED, linewidth=0.9, linestyle="--")
    title = paper.azimuth(profile["azimuth_deg"])
    ax.set_title(title, loc="left", fontsize=8, pad=2, parse_math=False)
    ax.grid(True)


def _draw_legend(figure, *axes, has_user_names=False):
    """Draw the legend above, and return its height, in; names of users are no mathematics."""
    handles, labels = [], []
    for ax in axes:
        handles_of_ax, labels_of_ax = ax.get_legend_handles_labels()
        handles += handles_of_ax
        labels += labels_of_ax
    longest = max(map(len, labels)) + 6
    columns = max(1, min(LETTERS_OF_A_LINE // longest, len(labels)))
    legend = figure.legend(
        handles, labels, loc="upper right", ncols=columns, fontsize=7.5, frameon=False,
        columnspacing=1.2, handlelength=1.6,
    )  # fmt: skip
    for text in legend.get_texts():
        text.set_parse_math(not has_user_names)
    return 0.14 * ceil(len(labels) / columns) + 0.14


def _set_indices(text):
    """Text for a figure in which U_i and S_i are set as mathematics."""
    return text.replace("U_i", "$U_i$").replace("S_i", "$S_i$")
