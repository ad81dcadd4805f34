"""Sections on the wall: map of deviations, levels, courses and gaps at welds, with figures."""

from math import ceil

import numpy as np
from matplotlib.figure import Figure

from tankcal.report import blocks
from tankcal.report.camera.figures import styled
from tankcal.report.inspection.tables import (
    COURSES,
    GAPS,
    LEVELS,
    MOST_GAPS,
    course_rows,
    generatrix_rows,
    is_low,
    level_rows,
    limit_mm,
    limit_of_level,
    select_largest_gaps,
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
