"""Sheets of the capacity table: rows, proportional parts, other densities, whole millimetres."""

from bisect import bisect_right
from dataclasses import dataclass, replace
from math import ceil, floor

from tankcal.report.tables.capacity import (
    capacity_rows,
    capacity_table,
    high_legs_table,
    parts_table,
    roof_corrections_table,
)
from tankcal.report.uncertainty.sources import critical_zone
from tankcal.report.uncertainty.stated import stated_U_m3
from tankcal.report.workbook.look import CRITICAL, Column, width_of, width_of_lines
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
    decimals_of_height,
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
    return min(max(map(decimals_of_height, height_m[:-1]), default=3), 4)


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
