"""The sheet Capacity with the capacity table."""

from dataclasses import dataclass, replace

from tankcal.report.tables.capacity import capacity_rows, capacity_table
from tankcal.report.workbook.look import width_of, width_of_lines
from tankcal.report.workbook.sections import HEAD_ROW
from tankcal.report.workbook.tables import columns_of
from tankcal.text.digits import decimals_of_height, shortest
from tankcal.text.words import marks_of

# Key of a column and end of its name in formulas.
NAMED = {
    "height_m": "height",
    "volume_m3": "volume",
    "stated_U_m3": "U",
    "k_of_gum": "k",
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
    last = book.table(sheet, HEAD_ROW, "capacity_table", columns, muted=muted)
    places = {NAMED[key]: place for place, key in enumerate(keys) if key in NAMED}
    position = Rows(HEAD_ROW + 1, last, places)
    book.freeze(sheet, HEAD_ROW)
    for name in NAMED.values():
        if name in places:
            book.name(f"capacity_{name}", sheet, position.first, position.last, places[name])
    return position
