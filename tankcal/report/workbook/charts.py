"""The sheet Charts with charts of the table and the wall, and the sheet Deviations."""

from itertools import groupby
from math import floor, log10

from tankcal.report.tables.tank import DEVIATIONS
from tankcal.report.workbook.look import ACCENT
from tankcal.report.workbook.sections import HEAD_ROW, SheetContent, cell_table, write_sheet

_MOST_POINTS = 20_000  # largest number of points in the sheet Deviations
_WIDE, _HIGH, _LOW = 640, 415, 300  # pixels; width, heights of two or three charts per page
_PT = 0.75  # points per pixel
_COLOURS = (ACCENT, "#B03A2E", "#2E7D5B", "#8E6C00", "#6A4C93", "#445566")
_GRID = {"visible": True, "line": {"color": "#E3E8ED", "width": 0.75}}


def charts_sheets(book, record, rows):
    """Write charts of the capacity table (its `Rows`) and of the deviations of the wall.

    Parameters
    ----------
    book : Book
        Workbook.
    record : dict
        Record of the tank.
    rows : capacity.Rows
        Position of the capacity table.
    """
    sheet = book.sheet("charts", tab="paper")
    row = HEAD_ROW
    for name, axis in (("litres_per_cm", "litres_per_cm"), ("U", "U_m3")):
        row = _insert(book, sheet, row, _curve(book, rows, name, axis), _HIGH)
    points = _points_of_sections(record) or _points_of_solid(record)
    if not points:
        return
    for title, x_axis, series in _deviations_sheet(book, points):
        chart = _scatter(book, title, x_axis, series, _limit_mm(points))
        row = _insert(book, sheet, row, (chart, title, x_axis, "residual"), _LOW)


def _insert(book, sheet, row, chart_parts, high):
    """Insert a chart into one row, which page breaks cannot divide; return the next row."""
    chart, title, *axes = chart_parts
    x, y = (book.words["axes"][axis] for axis in axes)
    sheet.set_row(row, _PT * (high + 5))
    chart.set_size({"width": _WIDE, "height": high})
    described = book.word("charts.alt", title=title, x=x, y=y)
    sheet.insert_chart(row, 0, chart, {"description": described})
    return row + 1


def _curve(book, rows, name, axis):
    """Return chart, title and axes of a column of the capacity table against the height."""
    title, capacity = book.word(f"charts.{name}"), book.sheet_name("capacity")
    height, column = rows.columns["height"], rows.columns[name]
    chart = book.chart()
    chart.add_series(
        {
            "name": title,
            "categories": [capacity, rows.first, height, rows.last, height],
            "values": [capacity, rows.first, column, rows.last, column],
            "line": {"color": ACCENT, "width": 1.5},
        }
    )
    _dress(book, chart, title, "height", axis)
    chart.set_legend({"none": True})
    return chart, title, "height", axis


def _dress(book, chart, title, x_axis, y_axis, x=None, y=None):
    """Set title and axes of a chart; x and y are further options of the axes."""
    names = book.words["axes"]
    plain = {"major_gridlines": _GRID, "name_font": {"bold": False}, "label_position": "low"}
    chart.set_title({"name": title, "name_font": {"size": 12, "color": ACCENT}})
    chart.set_x_axis({"name": names[x_axis], "num_format": "0", **plain, **(x or {})})
    chart.set_y_axis({"name": names[y_axis], "num_format": "General", **plain, **(y or {})})


# ---- deviations of the points from the wall


def _deviations_sheet(book, rows):
    """Write the points with their deviations; return (title, x axis, series) of each chart."""
    every = -(-len(rows) // _MOST_POINTS)
    shown = rows[::every]
    subtitle = book.word("texts.deviations_subtitle", shown=len(shown), all=len(rows))
    table = cell_table(book, DEVIATIONS, shown, name="radial_deviations")
    sheet, _ = write_sheet(book, SheetContent("deviations", [table], subtitle, landscape=False))
    book.freeze(sheet, HEAD_ROW, 1)
    name, last = sheet.get_name(), len(table.columns) - 1
    if "section" not in shown[0]:
        title = book.word("charts.deviations_solid")
        end = HEAD_ROW + len(shown)
        places = [[name, HEAD_ROW + 1, column, end, column] for column in (last - 1, last)]
        return [(title, "height", [(title, *places)])]
    return [
        (book.word("charts.deviations", course=course), "azimuth", series)
        for course, series in _series_of_courses(book, name, shown, last)
    ]


def _points_of_sections(record):
    """Return a row for each used point of the sections, in the order of azimuth."""
    return [
        {
            "point": point,
            "course": section["course"],
            "section": section["section"],
            "azimuth_deg": azimuth,
            "residual_mm": 1000.0 * residual,
        }
        for section in record["sections"]
        for azimuth, point, residual in sorted(
            zip(section["azimuth_deg"], section["points"], section["residual_m"], strict=True)
        )
    ]


def _points_of_solid(record):
    """Return a row for each used point of a wall without sections, in the order of height."""
    used = [row for row in record["points"] or [] if row["used"]]
    return [
        {"point": row["point"], "z_m": row["z_m"], "residual_mm": 1000.0 * row["residual_m"]}
        for row in sorted(used, key=lambda row: row["z_m"])
    ]


def _series_of_courses(book, name, rows, last):
    """Return (course, [(name, x cells, y cells) of each section]) from the bottom up."""
    row, courses = HEAD_ROW, {}
    for (course, section), group in groupby(
        rows, key=lambda point: (point["course"], point["section"])
    ):
        first, row = row + 1, row + len(list(group))
        cells = [[name, first, column, row, column] for column in (last - 1, last)]
        title = book.words["axes"]["section"].format(section=section)
        courses.setdefault(course, []).append((title, *cells))
    return courses.items()


def _limit_mm(rows):
    """Return the common end of the axes of deviations: 1, 2 or 5 times 10^n mm."""
    largest = max(abs(row["residual_mm"]) for row in rows) or 1.0
    power = 10.0 ** floor(log10(largest))
    return next(step * power for step in (1, 2, 5, 10) if step * power >= largest)


def _scatter(book, title, x_axis, series, limit_mm):
    """Return a chart of deviations: against azimuth, joined per section, or against height."""
    joined = x_axis == "azimuth"
    chart = book.chart("straight_with_markers" if joined else None)
    for place, (name, x, y) in enumerate(series):
        colour = _COLOURS[place % len(_COLOURS)]
        chart.add_series(
            {
                "name": name,
                "categories": x,
                "values": y,
                "line": {"color": colour, "width": 0.75} if joined else {"none": True},
                "marker": {
                    "type": "circle",
                    "size": 4,
                    "fill": {"color": colour},
                    "border": {"none": True},
                },
            }
        )
    turn = {"min": 0, "max": 360, "major_unit": 45} if joined else {}
    ends = {"min": -limit_mm, "max": limit_mm}
    _dress(book, chart, title, x_axis, "residual", turn, ends)
    chart.set_legend({"position": "bottom"} if len(series) > 1 else {"none": True})
    return chart
