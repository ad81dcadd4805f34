"""Sheets of the capacity table and of its charts."""

from bisect import bisect_right
from dataclasses import dataclass, replace
from itertools import groupby
from math import ceil, floor, log10

from tankcal.report.tables.capacity import (
    capacity_rows,
    capacity_table,
    high_legs_table,
    parts_table,
    roof_corrections_table,
)
from tankcal.report.tables.tank import DEVIATIONS
from tankcal.report.uncertainty.stated import critical_zone, stated_U_m3
from tankcal.report.workbook.look import ACCENT, CRITICAL, Column, width_of, width_of_lines
from tankcal.report.workbook.sections import (
    HEAD_ROW,
    SheetContent,
    cell_table,
    columns_of,
    set_widths,
    write_sheet,
)
from tankcal.text.digits import (
    LITRE_DECIMALS,
    decimals_of_heights,
    decimals_of_rows,
    format_significant,
    shortest,
)
from tankcal.text.words import marks_of

_SAME_MM = 1e-6  # tolerance, mm, for a row at a whole millimetre
# Key of a column and end of its name in formulas.
NAMED = {
    "height_m": "height",
    "volume_m3": "volume",
    "stated_U_m3": "U",
    "k": "k",
    "u_m3": "standard_u",
    "area_m2": "litres_per_cm",
    "low_m3": "low",
    "high_m3": "high",
    "interval": "interval",
}


@dataclass(frozen=True)
class Rows:
    """Position of the capacity table: first and last row, and columns by name, from 0."""

    first: int
    last: int
    columns: dict


def digits_of_heights(height_m):
    """Return the decimals of heights, 3 or 4; the last row, the top of the shell, is rounded."""
    return min(max(decimals_of_heights(height_m[:-1]), default=3), 4)


def capacity_sheet(book, record):
    """Write the sheet and its named ranges; return the `Rows` of the table."""
    capacity = record["capacity"]
    spec = record["job"]["table"]
    temperature = shortest(spec["reference_temperature_c"], marks_of(book.words))
    sheet = book.sheet(
        "capacity", book.word("texts.capacity_subtitle", temperature=temperature), tab="result"
    )
    table, rows = capacity_table(record), capacity_rows(record)
    keys = [column.key for column in table.in_workbook(rows)]
    columns = columns_of(book, table, rows)
    if "interval" in keys:
        place = keys.index("interval")
        wide = max(width_of_lines(columns[place].cells), 11)
        columns[place] = replace(columns[place], width=wide)
    book.widths(sheet, *map(width_of, columns))
    muted = [row for row, is_for_use in enumerate(capacity["for_use"]) if not is_for_use]
    last = book.table(sheet, HEAD_ROW, "capacity_table", columns, muted=muted, muted_fill=CRITICAL)
    places = {NAMED[key]: place for place, key in enumerate(keys) if key in NAMED}
    position = Rows(HEAD_ROW + 1, last, places)
    book.freeze(sheet, HEAD_ROW)
    for name in NAMED.values():
        if name in places:
            book.name(f"capacity_{name}", sheet, position.first, position.last, places[name])
    return position


def proportional_parts_sheet(book, record):
    """Write the proportional parts of 1 mm to 9 mm by zone; no sheet without zones."""
    parts = record["proportional_parts"]
    if not parts["zones"]:
        return
    largest = format_significant(1000 * parts["largest_m3"], 2, marks_of(book.words))
    subtitle = book.word("texts.parts_subtitle", largest=largest)
    table = cell_table(book, parts_table(record), name="proportional_parts")
    content = SheetContent("proportional_parts", [table], subtitle, tab="result")
    sheet, _ = write_sheet(book, content)
    book.freeze(sheet, HEAD_ROW)


def densities_sheet(book, record):
    """Write the table for each additional density of the liquid; no sheet without any."""
    entries = record["densities"]
    if not entries:
        return
    capacity = record["capacity"]
    table_density = record["job"]["table"]["liquid_density_kg_m3"]
    name = book.sheet_name("capacity")
    subtitle = book.word("texts.densities_subtitle", capacity=name)
    sheet = book.sheet("other_densities", subtitle, tab="result")
    digits = decimals_of_rows(stated_U_m3(capacity), least=LITRE_DECIMALS)
    tables = [(table_density, capacity["volume_m3"])]
    tables += [(entry["density_kg_m3"], entry["volume_m3"]) for entry in entries]
    table = capacity_table(record).but(height_m={"width": 13})
    columns = columns_of(book, table.only("height_m", "for_use"))
    columns[1:1] = [
        Column(f"{shortest(density, marks_of(book.words))} kg/m³", volumes, digits, 16)
        for density, volumes in tables
    ]
    muted = [row for row, is_for_use in enumerate(capacity["for_use"]) if not is_for_use]
    set_widths(book, sheet, columns)
    last = book.table(sheet, HEAD_ROW, "other_densities", columns, muted=muted, muted_fill=CRITICAL)
    book.freeze(sheet, HEAD_ROW)
    for place in range(2, 1 + len(tables)):
        book.name(name_of_density(place), sheet, HEAD_ROW + 1, last, place)


def roof_sheet(book, record):
    """Write the rows on high legs and the corrections by density; no sheet without a roof."""
    tables = [
        (name, table(record))
        for name, table in (
            ("on_high_legs", high_legs_table),
            ("roof_corrections", roof_corrections_table),
        )
        if record.get(name)
    ]
    if tables:
        sections = [
            cell_table(book, table, name=name, title=book.word(f"headings.{name}"))
            for name, table in tables
        ]
        write_sheet(book, SheetContent("floating_roof", sections, tab="result"))


def name_of_density(place):
    """Return the name of the range of volumes of density `place`, from 2 (1: the table)."""
    return f"volume_of_density_{place}"


# ---- every millimetre, for gauging systems


def millimetres_sheet(book, record):
    """Write the table interpolated to whole millimetres; blank in a critical zone."""
    capacity = record["capacity"]
    dips, litres, digits = _millimetres(capacity, critical_zone(record))
    columns = [
        Column(book.word("columns.dip_mm", of="calculator"), dips, 0, 14),
        Column(book.word("columns.volume_l", of="calculator"), litres, digits, 18),
    ]
    book.plain_sheet("capacity_mm", columns, tab="result")


def _millimetres(capacity, critical):
    """Return (dips in mm, volumes in L or None, decimals) of the rows.

    The last row of the table, the top of the shell, is listed at its rounded millimetre, as in the
    calculator.
    """
    heights, volumes = capacity["height_m"], capacity["volume_m3"]
    first = ceil(1000 * heights[0] - _SAME_MM)
    last = max(floor(1000 * heights[-1] + _SAME_MM), round(1000 * heights[-1]))
    decimals = decimals_of_rows(stated_U_m3(capacity), least=LITRE_DECIMALS)
    dips = list(range(first, last + 1))
    litres, digits = [], []
    for dip in dips:
        height = min(dip / 1000, heights[-1])
        # Linear interpolation between the rows around the height.
        row = min(bisect_right(heights, height + _SAME_MM / 1000) - 1, len(heights) - 1)
        after = min(row + 1, len(heights) - 1)
        part = 0.0
        if after > row and height - heights[row] > _SAME_MM / 1000:
            part = (height - heights[row]) / (heights[after] - heights[row])
        volume = volumes[row] + part * (volumes[after] - volumes[row])
        litres.append(None if _is_critical(height, critical) else 1000 * volume)
        digits.append(max(decimals[row] - LITRE_DECIMALS, 0))
    return dips, litres, digits


def _is_critical(height_m, critical):
    tolerance_m = _SAME_MM / 1000
    return critical is not None and critical[0] + tolerance_m < height_m < critical[1] - tolerance_m


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
