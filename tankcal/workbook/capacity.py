"""The sheet Capacity, which is the table itself, and the sheet Charts, which draws it."""

from dataclasses import dataclass

from tankcal.dips import TABLE_DECIMALS, VOLUME_UNITS_M3
from tankcal.uncertainty import LITRE_DECIMALS, height_decimals, row_decimals
from tankcal.workbook.book import ACCENT, Column

SHEET = "Capacity"
_HEAD_ROW = 3


@dataclass(frozen=True)
class Rows:
    """Where the capacity table stands: its first and last row, and its columns by name, from 0."""

    first: int
    last: int
    columns: dict


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
    columns = {**_in_units_of_the_table(capacity, spec), **_columns(capacity)}
    if not all(capacity["for_use"]):
        marks = ["" if good else "not for use" for good in capacity["for_use"]]
        columns["for_use"] = Column("Use", marks, None, 14)
    sheet.set_default_row(13.5)
    book.widths(sheet, *(column.width for column in columns.values()))
    muted = [row for row, good in enumerate(capacity["for_use"]) if not good]
    last = book.table(sheet, _HEAD_ROW, "capacity_table", list(columns.values()), muted=muted)
    places = {name: place for place, name in enumerate(columns)}
    rows = Rows(_HEAD_ROW + 1, last, places)
    sheet.freeze_panes(rows.first, 0)
    sheet.repeat_rows(_HEAD_ROW)
    for name in ("height", "volume", "U", "k", "standard_u", "litres_per_cm"):
        book.name(f"capacity_{name}", sheet, rows.first, rows.last, places[name])
    return rows


def _columns(capacity):
    """{name: Column} in metres and cubic metres: what formulas refer to."""
    digits = row_decimals(capacity["U_m3"])
    litres = [10.0 * area for area in capacity["area_m2"]]
    heights = [height_decimals(height) for height in capacity["height_m"]]
    volumes = row_decimals(capacity["U_m3"], LITRE_DECIMALS)
    u = row_decimals(capacity["u_m3"])
    return {
        "height": Column("Dip height (m)", capacity["height_m"], heights, 13),
        "volume": Column("Volume (m³)", capacity["volume_m3"], volumes, 16),
        "U": Column("Expanded uncertainty U (m³)", capacity["U_m3"], digits, 18),
        "k": Column("Coverage factor k", capacity["k"], 2, 13),
        "standard_u": Column("Standard uncertainty u (m³)", capacity["u_m3"], u, 20),
        "litres_per_cm": Column("Litres per centimetre (L/cm)", litres, 1, 20),
    }


def _in_units_of_the_table(capacity, spec):
    """{name: Column} of dips in feet and inches and of volumes in litres or barrels, if asked."""
    columns = {}
    if spec["height_unit"] != "m":
        columns["dip"] = Column("Dip (ft-in)", capacity["dip"], None, 16)
    if spec["volume_unit"] != "m3":
        unit = spec["volume_unit"]
        factor = float(1 / VOLUME_UNITS_M3[unit])
        volumes = [factor * volume for volume in capacity["volume_m3"]]
        digits = row_decimals([factor * U for U in capacity["U_m3"]], TABLE_DECIMALS[unit])
        columns["in_unit"] = Column(f"Volume ({unit})", volumes, digits, 18)
    return columns


def charts_sheet(book, rows):
    """Draw litres per centimetre and U against the height, as native charts."""
    sheet = book.sheet("Charts", "Charts of the capacity table")
    height = rows.columns["height"]
    for place, name, title, symbol in (
        (3, "litres_per_cm", "Litres per centimetre of height", "L/cm"),
        (26, "U", "Expanded uncertainty U of the volume", "m³"),
    ):
        column = rows.columns[name]
        chart = book.chart()
        chart.add_series(
            {
                "name": title,
                "categories": [SHEET, rows.first, height, rows.last, height],
                "values": [SHEET, rows.first, column, rows.last, column],
                "line": {"color": ACCENT, "width": 1.5},
            }
        )
        chart.set_title({"name": title, "name_font": {"size": 12, "color": ACCENT}})
        chart.set_legend({"none": True})
        grid = {"visible": True, "line": {"color": "#E3E8ED", "width": 0.75}}
        chart.set_x_axis({"name": "Dip height (m)", "major_gridlines": grid, "num_format": "0"})
        chart.set_y_axis({"name": symbol, "major_gridlines": grid, "num_format": "General"})
        chart.set_size({"width": 640, "height": 420})
        sheet.insert_chart(
            place, 0, chart, {"description": f"{title} ({symbol}) against the dip height in m"}
        )
