"""The figures of a history: volumes, radii, E_n and inspections over the years."""

from datetime import date

import numpy as np
from matplotlib.dates import AutoDateLocator, ConciseDateFormatter, date2num
from matplotlib.figure import Figure

from tankcal.pipeline.plot_style import FAINT, GREY, INK, RED, WIDTH, set_margins
from tankcal.report.camera.drawings import COLOURS, line_style, styled

HIGH = 2.5  # inches
APART = 0.012  # of the time, between markers of one day
MOST_LINES = 24  # as many as line_style tells apart
YEAR = 365.25  # days


@styled
def volumes(paper):
    """Volume of each table less that of the newest at some dips, with U."""
    found = paper.found
    figure, ax = _over_years(paper, "axes.d_volume")
    days = _days(found)
    for number, dip in enumerate(found["dips_m"][:MOST_LINES]):
        rows = [one for one in found["volumes"] if one["height_m"] == dip]
        label = paper.height(dip)
        _line(ax, days, rows, number, len(found["dips_m"]), ("d_m3", "U_m3", 1.0), label)
    _end(figure, ax)
    return figure


@styled
def radii(paper):
    """Radius of each course less its mean over the years, with U."""
    found = paper.found
    figure, ax = _over_years(paper, "axes.d_radius")
    days = _days(found)
    courses = sorted({one["course"] for one in found["radii"]})
    for number, course in enumerate(courses[:MOST_LINES]):
        rows = [one for one in found["radii"] if one["course"] == course]
        mean = np.mean([one["radius_m"] for one in rows])
        rows = [one | {"off_m": one["radius_m"] - mean} for one in rows]
        label = paper.word("legend.course", course=str(course))
        _line(ax, days, rows, number, len(courses), ("off_m", "U_m", 1e3), label)
    _end(figure, ax)
    return figure


@styled
def normalised(paper):
    """E_n of each table against the one before: worst of rows and deliveries, and radii."""
    found = paper.found
    figure, ax = _over_years(paper, "axes.E_n")
    days = _days(found)
    largest = 0.0
    worst = [(days[one["new"]], one["worst_E_n"]) for one in found["changes"]
             if one["worst_E_n"] is not None]  # fmt: skip
    if worst:
        label = paper.word("legend.worst")
        ax.plot(*zip(*worst, strict=True), "s", color=INK, markersize=5, label=label)
        largest = max(abs(one) for _, one in worst)
    of_courses = [(days[one["new"]], radius["E_n"]) for one in found["changes"]
                  for radius in one["radii"] if radius["E_n"] is not None]  # fmt: skip
    if of_courses:
        label = paper.word("legend.of_radii")
        ax.plot(*zip(*of_courses, strict=True), "o", color=COLOURS[3], markersize=3, label=label)
        largest = max(largest, *(abs(one) for _, one in of_courses))
    for limit in (-1.0, 1.0):
        ax.axhline(limit, color=RED, linewidth=0.9, linestyle="--")
    ax.axhline(0, color=GREY, linewidth=0.6)
    ax.set_ylim(-max(1.25, 1.1 * largest), max(1.25, 1.1 * largest))
    _end(figure, ax)
    return figure


@styled
def checks(paper):
    """Figure over limit of each check of the inspections."""
    figure, ax = _over_years(paper, "axes.share_of_limit")
    for number, (code, rows) in enumerate(limited_checks(paper.found).items()):
        days = [_day(one["date"]) for one in rows]
        values = [abs(one["value"]) / one["limit"] for one in rows]
        U = [(one["U"] or 0.0) / one["limit"] for one in rows]
        label = paper.words["checks"].get(code, code)
        ax.errorbar(days, values, U, marker="o", markersize=3, capsize=2, label=label,
                    **line_style(number))  # fmt: skip
    ax.axhline(1.0, color=RED, linewidth=0.9, linestyle="--")
    ax.set_ylim(bottom=0.0)
    _end(figure, ax)
    return figure


def limited_checks(found):
    """{code: rows with their dates} of checks with a value and a limit."""
    rows = {}
    for inspection in found["inspections"]:
        for one in inspection["checks"]:
            if inspection["date"] and one["value"] is not None and one["limit"]:
                rows.setdefault(one["code"], []).append(one | {"date": inspection["date"]})
    return rows


def _line(ax, days, rows, number, count, keys, label):
    """One line with bars of U, moved aside a little, so that bars of one day do not hide others."""
    value, U, factor = keys
    times = np.array([days[one["certificate"]] for one in rows])
    times = times + _apart(days) * (number - (count - 1) / 2) / max(count, 1) * 2
    values = np.array([factor * one[value] for one in rows])
    bars = np.array([np.nan if one[U] is None else factor * one[U] for one in rows])
    style = line_style(number)
    ax.plot(times, values, marker="o", markersize=2.5, label=label, **style)
    known = np.isfinite(bars)
    if known.any():
        ax.errorbar(times[known], values[known], bars[known], fmt="none", capsize=1.5,
                    linewidth=0.6, color=style["color"])  # fmt: skip


def _apart(days):
    """Days by which lines are moved aside at most: less than the least time between two tables."""
    times = np.unique(list(days.values()))
    span = times[-1] - times[0] or YEAR
    return min(APART * span, 0.3 * float(np.diff(times).min(initial=span)))


def _days(found):
    return {one["certificate"]: _day(one["date"]) for one in found["certificates"]}


def _day(iso):
    return float(date2num(date.fromisoformat(iso)))


def _over_years(paper, name):
    """A figure over the days of certificates and dated inspections."""
    figure = Figure(figsize=(WIDTH, HIGH))
    ax = figure.subplots()
    found = paper.found
    days = list(_days(found).values())
    days += [_day(one["date"]) for one in found["inspections"] if one["date"]]
    room = 0.06 * (max(days) - min(days)) or YEAR
    ax.set_xlim(min(days) - room, max(days) + room)
    locator = AutoDateLocator(minticks=3, maxticks=9)
    formatter = ConciseDateFormatter(locator, show_offset=False)
    formatter.formats = ["%Y", "%Y-%m", "%Y-%m-%d", "%H:%M", "%H:%M", "%S"]
    formatter.zero_formats = ["%Y", "%Y", "%Y-%m", "%Y-%m-%d", "%H:%M", "%H:%M"]
    ax.xaxis.set_major_locator(locator)
    ax.xaxis.set_major_formatter(formatter)
    ax.set_ylabel(_mathematical(paper.word(name)))
    ax.grid(True)
    ax.axhline(0, color=FAINT, linewidth=0.6)
    return figure, ax


def _end(figure, ax):
    """The legend above the axes, in as many lines as it needs."""
    handles, labels = ax.get_legend_handles_labels()
    labels = [_mathematical(one) for one in labels]
    across = 6 if max((len(one) for one in labels), default=0) < 14 else 3
    lines = -(-len(labels) // across)
    high = HIGH + 0.16 * lines
    figure.set_size_inches(WIDTH, high)
    if labels:
        figure.legend(handles, labels, loc="upper right", ncols=across, fontsize=7.5,
                      frameon=False)  # fmt: skip
    set_margins(figure, left=0.65, right=0.12, bottom=0.3, top=0.14 + 0.17 * lines)


def _mathematical(text):
    """Words of ours for a figure, with the index of E set as one."""
    return text.replace("E\N{LATIN SUBSCRIPT SMALL LETTER N}", r"$E_\mathrm{n}$")
