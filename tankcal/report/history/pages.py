"""Report of a history with its figures over the years, and its workbook with all rows.

Both show certificates, volumes, radii, changes and inspections.
"""

from dataclasses import replace
from datetime import date

import numpy as np
from matplotlib.dates import AutoDateLocator, ConciseDateFormatter, date2num
from matplotlib.figure import Figure

from tankcal.report import blocks
from tankcal.report.camera.figures import COLOURS, line_style, styled
from tankcal.report.comparison.paper import draw_E_n_limits, typeset_E_n
from tankcal.report.history.tables import (
    CERTIFICATES,
    CHANGES,
    CHECKS,
    MONTHS,
    RADII,
    VOLUMES,
    check_rows,
    radius_rows,
    volume_rows,
)
from tankcal.report.plain import Column
from tankcal.report.plots.style import FAINT, INK, RED, WIDTH, set_margins
from tankcal.report.saved_document import bearable
from tankcal.report.workbook.book import workbook_head
from tankcal.report.workbook.sections import Sentences, SheetContent, cell_table, write_workbook

MOST_ROWS = 60  # largest number of rows of a table in the PDF; workbook, page and CSV have all
DIGEST = 12  # number of printed digits of a SHA-256
FILE_COLUMNS = (Column("certificate", decimals=0), Column("file"), Column("sha256"))
HEIGHT_IN = 2.5  # height of the axes with labels, inches
OFFSET_SHARE = 0.012  # offset of markers of one day, relative to the whole time
MOST_LINES = 24  # number of styles that line_style distinguishes
DAYS_OF_YEAR = 365.25
ORIGIN_COLUMNS = ("certificate", "tank", "origin", "tankcal", "method", "file", "sha256")
CERTIFICATE_COLUMNS = (
    "certificate", "date", "superseded", "number", "laboratory", "top_dip_m", "top_volume_m3",
    "U_top_m3", "k", "reference_temperature_c", "liquid_density_kg_m3", "reference_height_m",
    "nominal_diameter_m", "nominal_height_m", "zero", "sigma0", "global_test_passed",
    "rule_verdict",
)  # fmt: skip
SHEETS = {
    "certificates": CERTIFICATES.only(*CERTIFICATE_COLUMNS),
    "volumes": VOLUMES,
    "radii": RADII,
    "changes": CHANGES,
    "inspections": CHECKS,
    "months": MONTHS,
    "origins": replace(CERTIFICATES.only(*ORIGIN_COLUMNS), name="origins"),
}


def pages(paper, folder=None, whole=False):
    """Return the blocks of a HistoryPaper, as `SavedDocument.renderers` describes."""
    return [
        *paper.head(folder),
        blocks.result(paper.word("labels.history"), _span(paper), _summary(paper)),
        *_certificates(paper),
        *[
            paper.heading("volumes"),
            paper.paragraph(
                "volumes",
                date=paper.day(paper.newest["date"]),
                k=paper.number(paper.record["coverage_k"], decimals=2),
            ),
            paper.figure(draw_volumes(paper), "volumes"),
            *_table(paper, VOLUMES, volume_rows(paper.record), whole),
        ],
        *_radii(paper, whole),
        *_changes(paper),
        *_inspections(paper),
        *_months(paper),
        *_limits(paper),
        *_files(paper),
    ]


def _span(paper):
    """Return the number of certificates, and the dates of the first and the last one."""
    certificates = paper.record["certificates"]
    dates = {
        "first": paper.day(certificates[0]["date"]),
        "last": paper.day(certificates[-1]["date"]),
    }
    if len(certificates) == 1:
        return paper.word("texts.one_certificate", **dates)
    return paper.word("texts.span", count=len(certificates), **dates)


def _summary(paper):
    """Return how many changes exceed their uncertainty."""
    changes = paper.record["changes"]
    known = [change for change in changes if change["worst_E_n"] is not None]
    if not changes:
        return paper.word("texts.nothing_to_compare")
    if not known:
        return paper.word("texts.no_E_n_at_all")
    beyond = [change for change in known if abs(change["worst_E_n"]) > 1]
    return paper.word("texts.changes_beyond", beyond=len(beyond), known=len(known))


def _certificates(paper):
    """Return the certificates and the basis of their tables, without empty columns."""
    rows = paper.record["certificates"]
    known = {key for row in rows for key, value in row.items() if value is not None}
    table = CERTIFICATES.only(*known)
    return [
        paper.heading("certificates"),
        paper.show(table, rows),
        paper.show(table, rows, on="certificate_facts"),
    ]


def _radii(paper, whole):
    """Return the radii of the courses on one basis, and their figure."""
    rows = radius_rows(paper.record)
    if not rows:
        return [paper.heading("radii"), paper.paragraph("no_radii")]
    return [
        paper.heading("radii"),
        paper.paragraph("radii"),
        paper.figure(draw_radii(paper), "radii"),
        *_table(paper, RADII, rows, whole),
    ]


def _changes(paper):
    """Return the comparisons of each table with the one before, and their omitted steps."""
    changes = paper.record["changes"]
    if not changes:
        return []
    omissions = [
        paper.word(
            "texts.not_made",
            former=str(change["former"]),
            new=str(change["new"]),
            steps=", ".join(paper.words["steps"].get(step, step) for step in change["not_made"]),
        )
        for change in changes
        if change["not_made"]
    ]
    is_E_n_known = any(change["worst_E_n"] is not None for change in changes)
    return [
        paper.heading("changes"),
        paper.paragraph("changes"),
        *([paper.figure(draw_E_n(paper), "normalised")] if is_E_n_known else []),
        paper.show(CHANGES, changes),
        *([blocks.listing(omissions)] if omissions else []),
    ]


def _inspections(paper):
    """Return the worst result of each check of each inspection."""
    rows = check_rows(paper.record)
    if not rows:
        return []
    has_figure = bool(limited_checks(paper.record))
    return [
        paper.heading("inspections"),
        paper.paragraph("inspections"),
        *([paper.figure(draw_checks(paper), "inspections")] if has_figure else []),
        paper.show(CHECKS, rows),
    ]


def _months(paper):
    """Return the months of the upkeeps by everyday data."""
    rows = MONTHS.rows(paper.record)
    return [paper.heading("months"), paper.show(MONTHS, rows)] if rows else []


def _limits(paper):
    """Return the files left out, the warnings, and the limits of every history."""
    left_out = [paper.warning(entry) for entry in paper.record["left_out"]]
    texts = [paper.warning(entry) for entry in paper.record["warnings"]]
    texts += paper.words["standing_limits"].values()
    return [
        *([paper.heading("left_out"), blocks.listing(left_out)] if left_out else []),
        paper.heading("limits"),
        blocks.listing(texts),
    ]


def _files(paper):
    """Return the file of each table, with the first digits of its SHA-256."""
    rows = [
        {
            "certificate": entry["certificate"],
            "file": bearable(entry["file"]),
            "sha256": f"{entry['sha256'][:DIGEST]}…",
        }
        for entry in paper.record["certificates"]
    ]
    return [paper.heading("files"), paper.table("files", rows, FILE_COLUMNS)]


def _table(paper, table, rows, whole):
    """Return a table, or its first rows and a note if the PDF has no space for all rows."""
    if whole or len(rows) <= MOST_ROWS:
        return [paper.show(table, rows, across=1 if len(rows) > MOST_ROWS else None)]
    return [
        paper.show(table, rows[:MOST_ROWS]),
        paper.paragraph("first_rows", shown=MOST_ROWS, all=len(rows)),
    ]


# ---- figures


@styled
def draw_volumes(paper):
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
def draw_radii(paper):
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
def draw_E_n(paper):
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
def draw_checks(paper):
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


# ---- workbook


def write_sheets(paper, path):
    """Write the workbook of a HistoryPaper; equal histories give equal bytes."""
    history, newest = paper.record, paper.newest
    head = workbook_head(
        history["tankcal"],
        tank=history["tank"] or newest["file"],
        date=newest["date"],
        notice=history["notice"],
        laboratory=newest["laboratory"],
    )
    write_workbook(paper, path, "history", head, sheets)


def sheets(book):
    """Yield the content of each sheet, in order; no sheet for a table without rows."""
    paper, history = book.paper, book.paper.record
    for code, table in SHEETS.items():
        if table.rows(history):
            yield SheetContent(code, [cell_table(book, table)], tab="result", is_filtered=True)
    # The files left out, the warnings, and the limits of every history.
    entries = (*history["left_out"], *history["warnings"])
    texts = [paper.warning(entry) for entry in entries]
    texts += paper.words["standing_limits"].values()
    sentences = Sentences([f"– {text}" for text in texts])
    yield SheetContent("warnings", [sentences], landscape=False, widths=(100,))
