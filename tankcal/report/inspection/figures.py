"""The figures of the wall: departures unrolled, levels about their circle, profiles of welds."""

from math import ceil

import numpy as np
from matplotlib.figure import Figure

from tankcal.pipeline import plots
from tankcal.pipeline.plot_style import (
    FAINT,
    GREY,
    INK,
    PALE,
    RED,
    WIDTH,
    round_factor,
    set_margins,
)
from tankcal.report.camera.drawings import styled
from tankcal.report.inspection.tables import (
    is_low,
    largest_gaps,
    limit_mm,
    limit_of_level,
    worst_place,
)

MOST_LEVELS = 6
MOST_PROFILES = 3  # of each kind of weld
BOARD_TICKS_MM = (-400, -200, 0, 200, 400)
REACH = 0.28  # of the radius: so far the largest departure is drawn
FARTHEST = 1.36  # of the radius: half a panel


def departures(paper):
    """The wall unrolled: departures along the generatrices, joints where welds say them."""
    wall = paper.found["generatrices"]
    order = np.argsort(np.array(wall["azimuth_deg"]) % 360)
    azimuth = (np.array(wall["azimuth_deg"]) % 360)[order]
    departure = np.array(wall["departure_mm"])[:, order]
    height = np.array(wall["height_m"])
    joints = sorted({one["height_m"] for one in paper.found["gaps"] if one["kind"] == "banding"})
    joints = [one for one in joints if height[0] < one < height[-1]]
    places = np.meshgrid(azimuth, height)
    closed = np.concatenate([azimuth[-1:] - 360, azimuth, azimuth[:1] + 360])
    return plots.field_map(
        closed,
        height,
        1e-3 * departure[:, [-1, *range(len(azimuth)), 0]],
        [one.ravel() for one in places],
        [height[0], *joints, height[-1]],
        lambda key: paper.word(f"axes.{key}"),
    )


def shown_levels(found):
    """The levels that are drawn: the lowest, the worst, the highest, others evenly between."""
    levels = [one for one in found["levels"] if one["departure_mm"]]
    if len(levels) <= MOST_LEVELS:
        return levels
    worst = max(range(len(levels)), key=lambda place: max(map(abs, levels[place]["departure_mm"])))
    low = next((place for place, one in enumerate(levels) if is_low(found, one)), 0)
    chosen = {low, worst, len(levels) - 1}
    for place in np.linspace(0, len(levels) - 1, MOST_LEVELS).round().astype(int):
        if len(chosen) < MOST_LEVELS:
            chosen.add(int(place))
    return [levels[place] for place in sorted(chosen)]


def enlargement(found):
    """How many times larger than the tank the departures of `levels` are drawn."""
    levels = shown_levels(found)
    largest_mm = max(max(map(abs, one["departure_mm"])) for one in levels)
    radius_mm = 1e3 * levels[0]["mean_radius_m"]
    return round_factor(REACH * radius_mm / largest_mm) if largest_mm else 1


@styled
def levels(paper):
    """Levels about the circle of the nominal radius, enlarged, with U and what limits them."""
    found = paper.found
    shown = shown_levels(found)
    factor = enlargement(found)
    across = min(3, len(shown))
    down = ceil(len(shown) / across)
    high = 5.9 / 3 * down
    figure = Figure(figsize=(WIDTH, high))
    axes = figure.subplots(down, across, squeeze=False).ravel()
    for ax, level in zip(axes, shown, strict=False):
        _level(paper, ax, level, factor)
    for ax in axes:
        ax.axis("off")
    figure.subplots_adjust(left=0, right=1, bottom=0, top=1, wspace=0, hspace=0)
    return figure


def _level(paper, ax, level, factor):
    order = np.argsort(np.array(level["azimuth_deg"]) % 360)
    turn = np.radians(np.array(level["azimuth_deg"])[order])
    turn = np.append(turn, turn[0] + 2 * np.pi)
    enlarged = factor / (1e3 * level["mean_radius_m"])
    departure, U = (
        enlarged * np.array(level[key])[[*order, order[0]]] for key in ("departure_mm", "U_mm")
    )
    circle = np.linspace(0, 2 * np.pi, 361)
    inner, outer = _around(turn, departure - U), _around(turn, departure + U)
    ax.fill(*np.concatenate([inner, outer[:, ::-1]], axis=1), color=PALE, alpha=0.5, linewidth=0)
    ax.plot(*_around(circle, 0 * circle), color=FAINT, linewidth=0.6)
    ax.plot(*_around(turn, departure), color=INK, linewidth=0.9)
    ax.plot(*_around(turn, departure)[:, :-1], ".", color=INK, markersize=2.4)
    limit = limit_of_level(paper.found, level)
    said = [
        paper.word("texts.course", course=level["course"]),
        paper.number(level["height_m"], "m", decimals=2),
    ]
    if limit is not None:
        said.append(f"≤ {paper.plain(limit, 'mm')}")
        if enlarged * limit < FARTHEST - 1.02:
            for side in (-1, 1):
                line = _around(circle, side * enlarged * limit + 0 * circle)
                ax.plot(*line, color=RED, linewidth=0.8, linestyle="--")
    worst = worst_place(level["departure_mm"])
    at = np.radians(level["azimuth_deg"][worst])
    ax.plot(
        *_around(at, enlarged * level["departure_mm"][worst]), "o", color=RED, markersize=4,
        markerfacecolor="none",
    )  # fmt: skip
    ax.text(0, 0, "\n".join(said), ha="center", va="center", fontsize=8, parse_math=False)
    ax.plot([0, 0], [1.26, FARTHEST - 0.03], color=GREY, linewidth=0.8)  # azimuth 0
    ax.set(aspect="equal", xlim=(-FARTHEST, FARTHEST), ylim=(-FARTHEST, FARTHEST))


def _around(azimuth, departure):
    return np.array([(1 + departure) * np.sin(azimuth), (1 + departure) * np.cos(azimuth)])


@styled
def welds(paper):
    """Profiles of the boards on the worst welds: a row of panels for each kind."""
    rows = {kind: profiles_of(paper.found, kind) for kind in ("peaking", "banding")}
    rows = {kind: gaps for kind, gaps in rows.items() if gaps}
    across = max(map(len, rows.values()))
    figure = Figure(figsize=(WIDTH, 1.85 * len(rows) + 0.25))
    axes = figure.subplots(len(rows), across, squeeze=False, sharex=True)
    for number, (kind, gaps) in enumerate(rows.items()):
        limit = limit_mm(paper.found, kind)
        for place, ax in enumerate(axes[number]):
            ax.axis("on" if place < len(gaps) else "off")
            if place < len(gaps):
                _profile(paper, ax, gaps[place], limit)
        _same_scale(axes[number][: len(gaps)])
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


def profiles_of(found, kind):
    """The gaps whose profiles are drawn: the largest that have one."""
    every = largest_gaps(found, kind, len(found["gaps"]))
    return [one for one in every if one["along_mm"]][:MOST_PROFILES]


def _profile(paper, ax, one, limit):
    along, gap = np.array(one["along_mm"]), np.array(one["profile_mm"])
    if one["U_mm"] is not None:
        ax.fill_between(along, gap - one["U_mm"], gap + one["U_mm"], color=PALE, alpha=0.5,
                        linewidth=0)  # fmt: skip
    ax.plot(along, gap, color=INK)
    ax.axhline(0, color=GREY, linewidth=0.6)
    ax.axvline(0, color=FAINT, linewidth=0.6)
    if limit is not None:
        for side in (-limit, limit):
            ax.axhline(side, color=RED, linewidth=0.9, linestyle="--")
    course = paper.word("texts.course", course=one["course"])
    title = f"{course}, {paper.azimuth(one['azimuth_deg'])}"
    ax.set_title(title, loc="left", fontsize=8, pad=2, parse_math=False)
    ax.grid(True)


def _same_scale(axes):
    """One scale for panels beside each other, numbers at the first alone."""
    most = max(abs(end) for ax in axes for end in ax.get_ylim())
    for place, ax in enumerate(axes):
        ax.set_ylim(-most, most)
        ax.tick_params(labelleft=place == 0)


def has_map(found):
    """Whether departures fill a map: two heights and three azimuths at least."""
    wall = found["generatrices"]
    return wall is not None and len(wall["height_m"]) >= 2 and len(wall["azimuth_deg"]) >= 3


def largest_U_mm(found):
    """The largest U of the departures along the generatrices, and the median of all."""
    every = np.concatenate([np.array(row) for row in found["generatrices"]["U_mm"]])
    every = every[every > 0] if (every > 0).any() else every  # at its foot each departs by nothing
    return float(np.median(every)), float(np.max(every))
