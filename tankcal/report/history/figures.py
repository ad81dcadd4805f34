"""Figures of a history: volumes, radii, E_n and inspections over the years."""

from datetime import date

import numpy as np
from matplotlib.dates import AutoDateLocator, ConciseDateFormatter, date2num
from matplotlib.figure import Figure

from tankcal.pipeline.plots.style import FAINT, INK, RED, WIDTH, set_margins
from tankcal.report.camera.drawings import COLOURS, line_style, styled
from tankcal.report.comparison.figures import draw_E_n_limits, typeset_E_n

HEIGHT_IN = 2.5  # height of the axes with labels, inches
OFFSET_SHARE = 0.012  # offset of markers of one day, relative to the whole time
MOST_LINES = 24  # number of styles that line_style distinguishes
DAYS_OF_YEAR = 365.25


@styled
def volumes(paper):
    """Draw the volume of each table minus that of the newest at some dips, with U."""
    history = paper.record
    figure, ax = _figure_over_years(paper, "axes.d_volume")
    days = _certificate_days(history)
    for number, dip in enumerate(history["dips_m"][:MOST_LINES]):
        rows = [row for row in history["volumes"] if row["height_m"] == dip]
        values, U = [row["d_m3"] for row in rows], [row["U_m3"] for row in rows]
        offset = _offset(days, number, len(history["dips_m"]))
        _draw_line(ax, _days_of_rows(days, rows) + offset, values, U, number, paper.height(dip))
    _add_legend(figure, ax)
    return figure


@styled
def radii(paper):
    """Draw the radius of each course minus its mean over the years, with U, mm."""
    history = paper.record
    figure, ax = _figure_over_years(paper, "axes.d_radius")
    days = _certificate_days(history)
    courses = sorted({row["course"] for row in history["radii"]})
    for number, course in enumerate(courses[:MOST_LINES]):
        rows = [row for row in history["radii"] if row["course"] == course]
        mean = np.mean([row["radius_m"] for row in rows])
        values = [1e3 * (row["radius_m"] - mean) for row in rows]
        U = [None if row["U_m"] is None else 1e3 * row["U_m"] for row in rows]
        offset = _offset(days, number, len(courses))
        label = paper.word("legend.course", course=str(course))
        _draw_line(ax, _days_of_rows(days, rows) + offset, values, U, number, label)
    _add_legend(figure, ax)
    return figure


@styled
def normalised(paper):
    """Draw E_n of each table against the one before: worst of rows and deliveries, and radii."""
    changes = paper.record["changes"]
    figure, ax = _figure_over_years(paper, "axes.E_n")
    days = _certificate_days(paper.record)
    worst = [
        (days[change["new"]], change["worst_E_n"])
        for change in changes
        if change["worst_E_n"] is not None
    ]
    if worst:
        label = paper.word("legend.worst")
        ax.plot(*zip(*worst, strict=True), "s", color=INK, markersize=5, label=label)
    of_radii = [
        (days[change["new"]], radius["E_n"])
        for change in changes
        for radius in change["radii"]
        if radius["E_n"] is not None
    ]
    if of_radii:
        label = paper.word("legend.of_radii")
        ax.plot(*zip(*of_radii, strict=True), "o", color=COLOURS[3], markersize=3, label=label)
    draw_E_n_limits(ax, max((abs(e_n) for _, e_n in (*worst, *of_radii)), default=0.0))
    _add_legend(figure, ax)
    return figure


@styled
def checks(paper):
    """Draw the value of each check of the inspections relative to its limit."""
    figure, ax = _figure_over_years(paper, "axes.share_of_limit")
    for number, (code, rows) in enumerate(limited_checks(paper.record).items()):
        days = [_day_number(row["date"]) for row in rows]
        values = [abs(row["value"]) / row["limit"] for row in rows]
        U = [(row["U"] or 0.0) / row["limit"] for row in rows]
        label = paper.words["checks"].get(code, code)
        ax.errorbar(days, values, U, marker="o", markersize=3, capsize=2, label=label,
                    **line_style(number))  # fmt: skip
    ax.axhline(1.0, color=RED, linewidth=0.9, linestyle="--")
    ax.set_ylim(bottom=0.0)
    _add_legend(figure, ax)
    return figure


def limited_checks(history):
    """Return {code: rows with their dates} of the dated checks with a value and a limit."""
    rows = {}
    for inspection in history["inspections"]:
        for check in inspection["checks"]:
            if inspection["date"] and check["value"] is not None and check["limit"]:
                dated = check | {"date": inspection["date"]}
                rows.setdefault(check["code"], []).append(dated)
    return rows


def _draw_line(ax, days, values, U, number, label):
    """Draw a line with error bars; values without U (None) have no bar."""
    values = np.array(values)
    bars = np.array([np.nan if half is None else half for half in U])
    style = line_style(number)
    ax.plot(days, values, marker="o", markersize=2.5, label=label, **style)
    known = np.isfinite(bars)
    if known.any():
        ax.errorbar(days[known], values[known], bars[known], fmt="none", capsize=1.5,
                    linewidth=0.6, color=style["color"])  # fmt: skip


def _offset(days, number, count):
    """Return the offset in days of a line, so that the bars of one day do not hide each other.

    It is less than the shortest time between two tables.
    """
    times = np.unique(list(days.values()))
    span = times[-1] - times[0] or DAYS_OF_YEAR
    largest = min(OFFSET_SHARE * span, 0.3 * float(np.diff(times).min(initial=span)))
    return largest * (number - (count - 1) / 2) / max(count, 1) * 2


def _days_of_rows(days, rows):
    return np.array([days[row["certificate"]] for row in rows])


def _certificate_days(history):
    """Return {number of the certificate: day of its table}."""
    return {entry["certificate"]: _day_number(entry["date"]) for entry in history["certificates"]}


def _day_number(iso):
    return float(date2num(date.fromisoformat(iso)))


def _figure_over_years(paper, name):
    """Return a figure and its axes over the days of certificates and dated inspections."""
    figure = Figure(figsize=(WIDTH, HEIGHT_IN))
    ax = figure.subplots()
    history = paper.record
    days = list(_certificate_days(history).values())
    days += [_day_number(entry["date"]) for entry in history["inspections"] if entry["date"]]
    room = 0.06 * (max(days) - min(days)) or DAYS_OF_YEAR
    ax.set_xlim(min(days) - room, max(days) + room)
    locator = AutoDateLocator(minticks=3, maxticks=9)
    formatter = ConciseDateFormatter(locator, show_offset=False)
    formatter.formats = ["%Y", "%Y-%m", "%Y-%m-%d", "%H:%M", "%H:%M", "%S"]
    formatter.zero_formats = ["%Y", "%Y", "%Y-%m", "%Y-%m-%d", "%H:%M", "%H:%M"]
    ax.xaxis.set_major_locator(locator)
    ax.xaxis.set_major_formatter(formatter)
    ax.set_ylabel(typeset_E_n(paper.word(name)))
    ax.grid(True)
    ax.axhline(0, color=FAINT, linewidth=0.6)
    return figure, ax


def _add_legend(figure, ax):
    """Add the legend above the axes; the figure grows by the number of its lines."""
    handles, labels = ax.get_legend_handles_labels()
    labels = [typeset_E_n(label) for label in labels]
    across = 6 if max(map(len, labels), default=0) < 14 else 3
    lines = -(-len(labels) // across)
    figure.set_size_inches(WIDTH, HEIGHT_IN + 0.16 * lines)
    if labels:
        figure.legend(handles, labels, loc="upper right", ncols=across, fontsize=7.5,
                      frameon=False)  # fmt: skip
    set_margins(figure, left=0.65, right=0.12, bottom=0.3, top=0.14 + 0.17 * lines)
