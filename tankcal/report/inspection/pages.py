"""Report of an inspection and its workbook: sections on the wall and on the bottom.

Sections on the wall and its welds precede those on the bottom, and the result, subject, checks and
limits follow. The workbook has numbers as numbers.
"""

from math import ceil

import numpy as np
from matplotlib.figure import Figure

from tankcal.report import blocks
from tankcal.report.camera.figures import line_style, styled
from tankcal.report.comparison.paper import FILE_COLUMNS
from tankcal.report.inspection.tables import (
    CHECKS,
    COURSES,
    EDGES,
    GAPS,
    GENERATRICES,
    LEVELS,
    LIMITS,
    MOST_GAPS,
    PLACES,
    PLANES,
    POINTS,
    READING,
    READINGS,
    SHEET_OF_CHECKS,
    UNVERIFIED,
    course_rows,
    epoch_name,
    gap_rows,
    generatrix_rows,
    is_low,
    level_rows,
    limit_mm,
    limit_of_level,
    limit_rows,
    place_rows,
    plane_rows,
    point_rows,
    reading_rows,
    select_largest_gaps,
    sheet_rows,
    verdict_of,
    worst_place,
)
from tankcal.report.plots import figures as plots
from tankcal.report.plots.style import (
    FAINT,
    GREY,
    INK,
    PALE,
    RED,
    WIDTH,
    round_factor,
    set_margins,
)
from tankcal.report.saved_document import bearable, shortened
from tankcal.report.tables import Column
from tankcal.report.workbook.book import workbook_head
from tankcal.report.workbook.sections import (
    FIRST_LINE,
    Sentences,
    SheetContent,
    cell_table,
    write_workbook,
)
from tankcal.text.digits import NOTHING

KINDS = ("peaking", "banding")
MOST_LEVELS = 6  # largest number of levels in the figure
MOST_PROFILES = 3  # largest number of profiles in the figure, for each kind of weld
BOARD_TICKS_MM = (-400, -200, 0, 200, 400)
REACH = 0.28  # drawn size of the largest deviation, as a share of the radius
FARTHEST = 1.36  # half the width of a panel, in radii


def departures(paper):
    """Blocks with the map of deviations along the generatrices and their U."""
    inspection = paper.record
    rows = generatrix_rows(inspection)
    if not rows:
        return []
    median, largest = summarise_U_mm(inspection)
    worst = max(rows, key=lambda row: abs(row["plumb"]))
    values = {
        "median": paper.number(median, "image mm", decimals=1),
        "largest": paper.number(largest, "image mm", decimals=1),
    }
    paragraph = paper.paragraph(
        "departures", generatrices=len(inspection["generatrices"]["azimuth_deg"]),
        heights=len(inspection["generatrices"]["height_m"]),
        departure=paper.number(worst["plumb"], "image mm", decimals=1),
        U=paper.number(worst["U"], "image mm", decimals=1),
        height=paper.number(worst["height_m"], "m", decimals=2),
        azimuth=paper.azimuth(worst["azimuth_deg"]),
    )  # fmt: skip
    is_drawn = has_map(inspection)
    return [
        paper.heading("departures"),
        *([paper.figure(draw_departures(paper), "departures", **values)] if is_drawn else []),
        paragraph,
    ]


def levels(paper):
    """Blocks with a figure of some levels about the nominal circle, and the table of all levels."""
    rows = level_rows(paper.record)
    if not rows:
        return []
    factor = paper.number(choose_enlargement(paper.record), decimals=0)
    return [
        paper.heading("levels"),
        paper.figure(draw_levels(paper), "levels", factor=factor),
        blocks.with_next(paper.paragraph("levels")),
        paper.show(LEVELS, rows),
    ]


def courses(paper):
    """Blocks with the table of deviations of each course."""
    rows = course_rows(paper.record)
    if all(value is None for row in rows for key, value in row.items() if key != "course"):
        return []
    text = paper.word("texts.courses")
    if any(kind in row for row in rows for kind in KINDS):
        text = f"{text} {paper.word('texts.courses_gaps')}"
    return [
        paper.heading("courses"),
        blocks.with_next(blocks.paragraph(text)),
        paper.show(COURSES, rows),
    ]


def welds(paper):
    """Blocks on peaking and banding: profiles with the largest gaps, and the table of gaps.

    The list is empty if no gap is determined, because the remarks on the checks state the reason.
    """
    inspection = paper.record
    if all(gap["gap_mm"] is None for gap in inspection["gaps"]):
        return []
    rows = [row for kind in KINDS for row in select_largest_gaps(inspection, kind)]
    is_drawn = any(select_profiles(inspection, kind) for kind in KINDS)
    known = sum(gap["gap_mm"] is not None for gap in inspection["gaps"])
    text = paper.word("texts.gaps", known=known, all=len(inspection["gaps"]))
    if known > len(rows):
        text = f"{text} {paper.word('texts.largest_gaps', most=MOST_GAPS)}"
    return [
        paper.heading("welds"),
        *([paper.figure(draw_welds(paper), "welds")] if is_drawn else []),
        blocks.paragraph(text),
        *([paper.show(GAPS, rows, across=2 if len(rows) > MOST_GAPS else None)] if rows else []),
    ]


# ---- figures


def draw_departures(paper):
    """Draw the unrolled wall with its deviations, and joints at the heights of horizontal welds."""
    wall = paper.record["generatrices"]
    order = np.argsort(np.array(wall["azimuth_deg"]) % 360)
    azimuth = (np.array(wall["azimuth_deg"]) % 360)[order]
    departure = np.array(wall["departure_mm"])[:, order]
    height = np.array(wall["height_m"])
    joints = sorted({gap["height_m"] for gap in paper.record["gaps"] if gap["kind"] == "banding"})
    joints = [joint for joint in joints if height[0] < joint < height[-1]]
    places = np.meshgrid(azimuth, height)
    closed = np.concatenate([azimuth[-1:] - 360, azimuth, azimuth[:1] + 360])
    return plots.field_map(
        closed,
        height,
        1e-3 * departure[:, [-1, *range(len(azimuth)), 0]],
        [axis.ravel() for axis in places],
        [height[0], *joints, height[-1]],
        lambda key: paper.word(f"axes.{key}"),
    )


def select_levels(inspection):
    """Select the lowest, the worst and the highest level, and others equally spaced."""
    levels = [level for level in inspection["levels"] if level["departure_mm"]]
    if len(levels) <= MOST_LEVELS:
        return levels
    worst = max(range(len(levels)), key=lambda place: max(map(abs, levels[place]["departure_mm"])))
    low = next((place for place, level in enumerate(levels) if is_low(inspection, level)), 0)
    chosen = {low, worst, len(levels) - 1}
    for place in np.linspace(0, len(levels) - 1, MOST_LEVELS).round().astype(int):
        if len(chosen) < MOST_LEVELS:
            chosen.add(int(place))
    return [levels[place] for place in sorted(chosen)]


def choose_enlargement(inspection):
    """Factor by which deviations of the levels are enlarged in the figure."""
    levels = select_levels(inspection)
    largest_mm = max(max(map(abs, level["departure_mm"])) for level in levels)
    radius_mm = 1e3 * levels[0]["mean_radius_m"]
    return round_factor(REACH * radius_mm / largest_mm) if largest_mm else 1


@styled
def draw_levels(paper):
    """Draw levels about the circle of the nominal radius, enlarged, with U and limits."""
    inspection = paper.record
    shown = select_levels(inspection)
    factor = choose_enlargement(inspection)
    across = min(3, len(shown))
    down = ceil(len(shown) / across)
    high = 5.9 / 3 * down
    figure = Figure(figsize=(WIDTH, high))
    axes = figure.subplots(down, across, squeeze=False).ravel()
    for ax, level in zip(axes, shown, strict=False):
        _draw_level(paper, ax, level, factor)
    for ax in axes:
        ax.axis("off")
    figure.subplots_adjust(left=0, right=1, bottom=0, top=1, wspace=0, hspace=0)
    return figure


def _draw_level(paper, ax, level, factor):
    """Draw a level in a panel, its deviations enlarged by a factor."""
    order = np.argsort(np.array(level["azimuth_deg"]) % 360)
    turn = np.radians(np.array(level["azimuth_deg"])[order])
    turn = np.append(turn, turn[0] + 2 * np.pi)
    enlarged = factor / (1e3 * level["mean_radius_m"])
    departure, U = (
        enlarged * np.array(level[key])[[*order, order[0]]] for key in ("departure_mm", "U_mm")
    )
    circle = np.linspace(0, 2 * np.pi, 361)
    inner, outer = _polar_curve(turn, departure - U), _polar_curve(turn, departure + U)
    ax.fill(*np.concatenate([inner, outer[:, ::-1]], axis=1), color=PALE, alpha=0.5, linewidth=0)
    ax.plot(*_polar_curve(circle, 0 * circle), color=FAINT, linewidth=0.6)
    ax.plot(*_polar_curve(turn, departure), color=INK, linewidth=0.9)
    ax.plot(*_polar_curve(turn, departure)[:, :-1], ".", color=INK, markersize=2.4)
    limit = limit_of_level(paper.record, level)
    lines = [
        paper.word("texts.course", course=level["course"]),
        paper.number(level["height_m"], "m", decimals=2),
    ]
    if limit is not None:
        lines.append(f"≤ {paper.plain(limit, 'mm')}")
        if enlarged * limit < FARTHEST - 1.02:
            for side in (-1, 1):
                line = _polar_curve(circle, side * enlarged * limit + 0 * circle)
                ax.plot(*line, color=RED, linewidth=0.8, linestyle="--")
    worst = worst_place(level["departure_mm"])
    at = np.radians(level["azimuth_deg"][worst])
    ax.plot(
        *_polar_curve(at, enlarged * level["departure_mm"][worst]), "o", color=RED, markersize=4,
        markerfacecolor="none",
    )  # fmt: skip
    ax.text(0, 0, "\n".join(lines), ha="center", va="center", fontsize=8, parse_math=False)
    ax.plot([0, 0], [1.26, FARTHEST - 0.03], color=GREY, linewidth=0.8)  # azimuth 0
    ax.set(aspect="equal", xlim=(-FARTHEST, FARTHEST), ylim=(-FARTHEST, FARTHEST))


def _polar_curve(azimuth, departure):
    """Coordinates (2, n) of a curve about the unit circle, with azimuths clockwise from the top."""
    return np.array([(1 + departure) * np.sin(azimuth), (1 + departure) * np.cos(azimuth)])


@styled
def draw_welds(paper):
    """Draw profiles of the boards with the largest gaps: a row of panels for each kind of weld."""
    rows = {kind: select_profiles(paper.record, kind) for kind in ("peaking", "banding")}
    rows = {kind: gaps for kind, gaps in rows.items() if gaps}
    across = max(map(len, rows.values()))
    figure = Figure(figsize=(WIDTH, 1.85 * len(rows) + 0.25))
    axes = figure.subplots(len(rows), across, squeeze=False, sharex=True)
    for number, (kind, gaps) in enumerate(rows.items()):
        limit = limit_mm(paper.record, kind)
        for place, ax in enumerate(axes[number]):
            ax.axis("on" if place < len(gaps) else "off")
            if place < len(gaps):
                _draw_profile(paper, ax, gaps[place], limit)
        _share_scale(axes[number][: len(gaps)])
        axes[number][0].set_ylabel(paper.word(f"axes.{kind}"))
    counts = [len(gaps) for gaps in rows.values()]
    for place in range(across):
        lowest = max(number for number, count in enumerate(counts) if place < count)
        ax = axes[lowest][place]
        ax.set_xlabel(paper.word("axes.board"))
        ax.set_xticks(BOARD_TICKS_MM)
        ax.tick_params(labelbottom=True)
    set_margins(figure, left=0.6, right=0.1, bottom=0.42, top=0.24, hspace=0.3, wspace=0.12)
    return figure


def select_profiles(inspection, kind):
    """Select the largest gaps that have a saved profile."""
    gaps = select_largest_gaps(inspection, kind, len(inspection["gaps"]))
    return [gap for gap in gaps if gap["along_mm"]][:MOST_PROFILES]


def _draw_profile(paper, ax, profile, limit):
    """Draw the gap along a board in a panel, with U and the limit."""
    along, gaps_mm = np.array(profile["along_mm"]), np.array(profile["profile_mm"])
    U = profile["U_mm"]
    if U is not None:
        ax.fill_between(along, gaps_mm - U, gaps_mm + U, color=PALE, alpha=0.5, linewidth=0)
    ax.plot(along, gaps_mm, color=INK)
    ax.axhline(0, color=GREY, linewidth=0.6)
    ax.axvline(0, color=FAINT, linewidth=0.6)
    if limit is not None:
        for side in (-limit, limit):
            ax.axhline(side, color=RED, linewidth=0.9, linestyle="--")
    course = paper.word("texts.course", course=profile["course"])
    title = f"{course}, {paper.azimuth(profile['azimuth_deg'])}"
    ax.set_title(title, loc="left", fontsize=8, pad=2, parse_math=False)
    ax.grid(True)


def _share_scale(axes):
    """Give neighbouring panels a common scale, with numbers at the first panel only."""
    most = max(abs(end) for ax in axes for end in ax.get_ylim())
    for place, ax in enumerate(axes):
        ax.set_ylim(-most, most)
        ax.tick_params(labelleft=place == 0)


def has_map(inspection):
    """Whether there are enough heights (two) and azimuths (three) for a map of deviations."""
    wall = inspection["generatrices"]
    return wall is not None and len(wall["height_m"]) >= 2 and len(wall["azimuth_deg"]) >= 3


def summarise_U_mm(inspection):
    """Median and largest U of the deviations along the generatrices, mm."""
    U = np.concatenate([np.array(row) for row in inspection["generatrices"]["U_mm"]])
    # U is 0 at the feet of the generatrices, which the deviations are counted from.
    U = U[U > 0] if (U > 0).any() else U
    return float(np.median(U)), float(np.max(U))


# Largest number of points, and of letters of a name, for a table in two columns of the page.
FEW_POINTS, SHORT_NAME = 32, 8
MOST_EPOCHS, MOST_EDGE_PROFILES = 8, 6  # largest number of curves and of profiles in a figure
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
    return sorted(inspection["edges"], key=lambda profile: -depth[id(profile)])[:MOST_EDGE_PROFILES]


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


SHOWN = ("table", "columns_table", "figure")
SHORT = 12  # largest number of rows of a table that page.typ keeps on one page

# Verdicts, the most severe first.
ORDER = ("failed", "guard_band_beyond", "guard_band", "not_determined", "no_limit", "passed")
# Tables of each sheet after the checks, with the function of their rows.
SHEETS = {
    "generatrices": ((GENERATRICES, generatrix_rows),),
    "levels": ((LEVELS, level_rows), (COURSES, course_rows), (PLACES, place_rows)),
    "welds": ((GAPS, gap_rows),),
    "settlement": ((PLANES, plane_rows), (POINTS, point_rows)),
    "edges": ((EDGES, EDGES.rows), (READINGS, reading_rows)),
}


def pages(paper, folder=None):
    """List the blocks of an InspectionPaper; `folder` has the files attached to the PDF."""
    return keep_end_together(
        [
            *paper.head(folder),
            *result(paper),
            *subject(paper),
            *checks(paper),
            *limits(paper),
            *reading(paper),
            *departures(paper),
            *levels(paper),
            *courses(paper),
            *welds(paper),
            *settlements(paper),
            *edges(paper),
            *points(paper),
        ]
    )


def keep_end_together(page_blocks):
    """Keep the last table on one page with the table or figure before it.

    A few rows alone would leave the last page nearly empty. Long tables are not kept together.
    """
    shown = [i for i, block in enumerate(page_blocks) if block.data["kind"] in SHOWN]
    if len(shown) < 2:
        return page_blocks
    first, last = shown[-2:]
    page_blocks = list(page_blocks)
    if SHORT < len(page_blocks[last].data.get("rows", ())) <= 2 * SHORT:
        page_blocks[last] = blocks.whole(page_blocks[last])
    before = page_blocks[first].data
    if len(before.get("rows", ())) <= SHORT * before.get("across", 1):
        page_blocks[first:last] = map(blocks.with_next, page_blocks[first:last])
    return page_blocks


def result(paper):
    """Frame with the number of checks of each verdict; there is no verdict of all checks."""
    return [
        blocks.result(paper.word("labels.result"), counts(paper), rule_text(paper)),
        paper.paragraph("not_of_certificate"),
    ]


def rule_text(paper):
    """Sentence with the rule, and whether it was read in the standard itself."""
    rule = paper.record["rule"]
    if not rule:
        return paper.word("texts.no_rule")
    verified = paper.word(f"verified.{rule['verified']}")
    return paper.word("texts.by_rule", rule=bearable(rule["name"]), verified=verified)


def counts(paper):
    """Text with the number of checks of each verdict: "1 beyond the limit, 8 within it"."""
    verdicts = [verdict_of(check) for check in paper.record["checks"]]
    counted = [
        paper.word(f"counted.{code}_{'one' if verdicts.count(code) == 1 else 'many'}",
                   count=verdicts.count(code))
        for code in ORDER
        if code in verdicts
    ]  # fmt: skip
    return "; ".join(counted) or paper.word("texts.no_checks")


def subject(paper):
    """Blocks on the tank, its survey and the rule."""
    tank, rule = paper.record["tank"], paper.record["rule"]
    files = [{"file": shortened(tank["file"]), "sha256": tank["sha256"]}]
    return [
        paper.heading("subject"),
        paper.facts([*_tank(paper, tank), *_survey(paper, tank)]),
        *([paper.table("files", files, FILE_COLUMNS)] if tank["sha256"] else []),
        *([paper.facts(_rule(paper, rule))] if rule else []),
    ]


def _tank(paper, tank):
    """Facts about the tank."""
    diameter = paper.number(tank["nominal_diameter_m"], "m", decimals=3)
    if diameter is not None:
        source = paper.words["nominal_sources"].get(tank["nominal_source"], tank["nominal_source"])
        diameter = f"{diameter} ({source})"
    return [
        ("tank", bearable(tank["id"])),
        ("job", bearable(tank["name"])),
        ("nominal_diameter", diameter),
        ("shell_height", paper.number(tank["height_m"], "m", decimals=3)),
    ]


def _survey(paper, tank):
    """Facts about the survey."""
    source = paper.words["sources_of_inspections"].get(tank["source"], tank["source"])
    methods = [paper.words["methods"].get(method, bearable(method)) for method in tank["methods"]]
    side = tank["survey_side"]
    return [
        ("survey_date", paper.day(paper.date() or None) or paper.word("texts.not_known")),
        ("methods", ", ".join(methods)),
        ("surface", side and paper.words["surfaces"].get(side, side)),
        ("state", side and paper.words["states"].get(tank["state"], tank["state"])),
        ("made_of", source if tank["sha256"] else f"{source}: {shortened(tank['file'])}"),
    ]


def _rule(paper, rule):
    """Facts about the rule."""
    return [
        ("rule", bearable(rule["name"])),
        ("rule_file", shortened(rule["file"])),
        ("rule_source", bearable(rule["source"])),
        ("rule_verified", paper.word(f"verified.{rule['verified']}")),
        ("rule_remark", bearable(rule["remark"])),
    ]


# ---- the checks


def checks(paper):
    """Blocks with the table of checks, the decision rule, and remarks on checks."""
    entries = paper.record["checks"]
    if not entries:
        return []
    sentences = remarks(paper)
    unread = any(check["limit"] is not None and not check["limit"]["verified"] for check in entries)
    return [
        paper.heading("checks"),
        paper.show(CHECKS, CHECKS.rows(paper.record)),
        *([paper.paragraph("unverified", mark=UNVERIFIED)] if unread else []),
        blocks.paragraph(_decision(paper)),
        *([paper.heading("remarks", 2), blocks.listing(sentences)] if sentences else []),
    ]


def remarks(paper):
    """Sentences with the remarks on checks; equal remarks on several checks are joined."""
    places_by_remark = {}
    for check in paper.record["checks"]:
        if check["remark"] is not None:
            remark = (paper.check_name(check["code"]), paper.remark(check))
            places_by_remark.setdefault(remark, []).append(paper.place(check))
    return [
        f"{name}{_place_in_brackets(places)}: {remark}"
        for (name, remark), places in places_by_remark.items()
    ]


def _place_in_brackets(places):
    """The place of a remark in brackets; "" for several places or no place."""
    return f" ({places[0]})" if len(places) == 1 and places != [NOTHING] else ""


def _decision(paper):
    """Sentence with the decision rule of this file and its coverage factors."""
    factors = sorted({round(check["k"], 2) for check in paper.record["checks"] if check["k"]})
    k = "; ".join(paper.number(factor, decimals=2) for factor in factors)
    decision = paper.record["decision"]
    rule = "" if decision == "guarded" else f"_{decision}"
    return paper.word(f"texts.decision{'' if k else '_without_k'}{rule}", k=k)


def limits(paper):
    """Blocks with the clause of each limit, and whether the limit was read there."""
    rows = limit_rows(paper)
    return [paper.heading("limits"), paper.show(LIMITS, rows)] if rows else []


def reading(paper):
    """Blocks with the limitations of an inspection, and its warnings."""
    inspection = paper.record
    sentences = [
        paper.word("texts.as_built" if inspection["as_built"] else "texts.as_built_unknown")
    ]
    if inspection["rule"] and not inspection["rule"]["verified"]:
        sentences.append(paper.word("texts.rule_not_read"))
    if inspection["generatrices"] is not None or inspection["levels"]:
        sentences.append(paper.word("texts.surface_of_radii"))
    sentences += paper.words["standing_limits"].values()
    sentences += [paper.warning(warning) for warning in inspection["warnings"]]
    return [paper.heading("reading"), blocks.listing(sentences)]


# ---- workbook


def write_sheets(paper, path):
    """Write the workbook of an InspectionPaper; equal inspections give equal bytes."""
    inspection, tank = paper.record, paper.record["tank"]
    head = workbook_head(
        inspection["tankcal"],
        tank=bearable(tank["id"]),
        date=tank["survey_date"],
        notice=inspection["notice"],
    )
    write_workbook(paper, path, "inspection", head, sheets)


def sheets(book):
    """Yield the content of each sheet, in order; tables without rows are omitted."""
    yield _checks_sheet(book, book.paper)
    for code, declared in SHEETS.items():
        tables = [
            cell_table(book, table, rows)
            for table, rows_of in declared
            if (rows := rows_of(book.paper.record))
        ]
        if tables:
            is_single = len(tables) == 1
            yield SheetContent(code, tables, is_filtered=is_single, repeats_headings=True)


def _checks_sheet(book, paper):
    """Return the result and its scope, all checks with their limits, remarks and warnings."""
    inspection = paper.record
    as_built = paper.word("texts.as_built" if inspection["as_built"] else "texts.as_built_unknown")
    scope = [rule_text(paper), paper.word("texts.not_of_certificate"), as_built]
    sections = [
        (Sentences([counts(paper)], look=FIRST_LINE), Sentences(scope)),
        cell_table(book, SHEET_OF_CHECKS, sheet_rows(paper)),
        Sentences([*remarks(paper), *map(paper.warning, inspection["warnings"])]),
    ]
    return SheetContent("checks", sections, tab="result", repeats_headings=True)
