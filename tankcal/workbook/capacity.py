"""The sheet Capacity, which is the table itself, and the sheet Charts, which draws it."""

from dataclasses import dataclass

from tankcal.uncertainty import LITRE_DECIMALS, height_decimals, row_decimals
from tankcal.workbook.book import ACCENT, Column

SHEET = "Capacity"
_HEAD_ROW = 3
_HEIGHT, _VOLUME, _EXPANDED, _K, _STANDARD, _LITRES = range(6)


@dataclass(frozen=True)
class Rows:
    """Where the capacity table stands: numbers of its first and last row, counted from 0."""

    first: int
    last: int


def digits_of_heights(height_m):
    """3 decimals (mm), or 4 where a step needs them; the last row, the shell's top, is rounded."""
    return 3 if all(abs(height - round(height, 3)) < 1e-9 for height in height_m[:-1]) else 4


def capacity_sheet(book, record):
    """Write the sheet and its named ranges; returns the `Rows` of the table."""
    capacity = record["capacity"]
    spec = record["job"]["table"]
    sheet = book.sheet(
        SHEET,
        "Capacity table",
        f"reference temperature {spec['reference_temperature_c']:g} °C",
    )
    digits = row_decimals(capacity["U_m3"])
    digits_of_height = [height_decimals(height) for height in capacity["height_m"]]
    digits_of_u = row_decimals(capacity["u_m3"])
    digits_of_volumes = row_decimals(capacity["U_m3"], LITRE_DECIMALS)
    columns = [
        Column("Dip height (m)", capacity["height_m"], digits_of_height, 13),
        Column("Volume (m³)", capacity["volume_m3"], digits_of_volumes, 16),
        Column("Expanded uncertainty U (m³)", capacity["U_m3"], digits, 18),
        Column("Coverage factor k", capacity["k"], 2, 13),
        Column("Standard uncertainty u (m³)", capacity["u_m3"], digits_of_u, 20),
        Column("Litres per centimetre (L/cm)", [10.0 * a for a in capacity["area_m2"]], 1, 20),
    ]
    sheet.set_default_row(13.5)
    book.widths(sheet, *(column.width for column in columns))
    last = book.table(sheet, _HEAD_ROW, "capacity_table", columns)
    rows = Rows(_HEAD_ROW + 1, last)
    sheet.freeze_panes(rows.first, 0)
    sheet.repeat_rows(_HEAD_ROW)
    for name, column in (
        ("capacity_height", _HEIGHT),
        ("capacity_volume", _VOLUME),
        ("capacity_U", _EXPANDED),
        ("capacity_k", _K),
        ("capacity_standard_u", _STANDARD),
        ("capacity_litres_per_cm", _LITRES),
    ):
        book.name(name, sheet, rows.first, rows.last, column)
    return rows


def charts_sheet(book, rows):
    """Draw litres per centimetre and U against the height, as native charts."""
    sheet = book.sheet("Charts", "Charts of the capacity table")
    for place, column, title, unit in (
        (3, _LITRES, "Litres per centimetre of height", "L/cm"),
        (26, _EXPANDED, "Expanded uncertainty U of the volume", "m³"),
    ):
        chart = book.chart()
        chart.add_series(
            {
                "name": title,
                "categories": [SHEET, rows.first, _HEIGHT, rows.last, _HEIGHT],
                "values": [SHEET, rows.first, column, rows.last, column],
                "line": {"color": ACCENT, "width": 1.5},
            }
        )
        chart.set_title({"name": title, "name_font": {"size": 12, "color": ACCENT}})
        chart.set_legend({"none": True})
        grid = {"visible": True, "line": {"color": "#E3E8ED", "width": 0.75}}
        chart.set_x_axis({"name": "Dip height (m)", "major_gridlines": grid, "num_format": "0"})
        chart.set_y_axis({"name": unit, "major_gridlines": grid, "num_format": "General"})
        chart.set_size({"width": 640, "height": 420})
        sheet.insert_chart(
            place, 0, chart, {"description": f"{title} ({unit}) against the dip height in m"}
        )
