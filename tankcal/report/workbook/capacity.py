"""The sheet Capacity, which is the table itself."""

from dataclasses import dataclass

from tankcal.report.uncertainty.stated import stated_U_m3
from tankcal.report.workbook.look import height_digits, width_of, width_of_lines
from tankcal.report.workbook.parts import use_column
from tankcal.tank.dips import TABLE_DECIMALS, VOLUME_UNITS_M3
from tankcal.text.digits import (
    LITRE_DECIMALS,
    decimals_of_height,
    decimals_of_rows,
    rounded,
    shortest,
)
from tankcal.text.words import marks_of

NAMED = ("height", "volume", "U", "k", "standard_u", "litres_per_cm", "low", "high", "interval")
_HEAD_ROW = 3


@dataclass(frozen=True)
class Rows:
    """Where the capacity table stands: its first and last row, and its columns by name, from 0."""

    first: int
    last: int
    columns: dict


def digits_of_heights(height_m):
    """3 decimals (mm), or 4 where a step needs them; the last row, the shell's top, is rounded."""
    return min(max(map(decimals_of_height, height_m[:-1]), default=3), 4)


def capacity_sheet(book, record):
    """Write the sheet and its named ranges; returns the `Rows` of the table."""
    capacity = record["capacity"]
    spec = record["job"]["table"]
    temperature = shortest(spec["reference_temperature_c"], marks_of(book.words))
    sheet = book.sheet(
        "capacity", book.word("texts.capacity_subtitle", temperature=temperature), tab="result"
    )
    columns = {**_in_units_of_the_table(book, capacity, spec), **_columns(book, capacity)}
    if not all(capacity["for_use"]):
        columns["for_use"] = use_column(book, capacity)
    columns |= _U_in_unit_of_the_table(book, capacity, spec["volume_unit"])
    columns |= _intervals(book, capacity)
    book.widths(sheet, *map(width_of, columns.values()))
    muted = [row for row, good in enumerate(capacity["for_use"]) if not good]
    last = book.table(sheet, _HEAD_ROW, "capacity_table", list(columns.values()), muted=muted)
    places = {name: place for place, name in enumerate(columns)}
    rows = Rows(_HEAD_ROW + 1, last, places)
    sheet.freeze_panes(rows.first, 0)
    sheet.repeat_rows(_HEAD_ROW)
    for name in NAMED:
        if name in places:
            book.name(f"capacity_{name}", sheet, rows.first, rows.last, places[name])
    return rows


def _columns(book, capacity):
    """{name: Column} in metres and cubic metres: what formulas refer to."""
    expanded = stated_U_m3(capacity)
    digits = decimals_of_rows(expanded)
    litres = [10.0 * area for area in capacity["area_m2"]]
    heights = height_digits(capacity["height_m"])
    volumes = decimals_of_rows(expanded, least=LITRE_DECIMALS)
    u = decimals_of_rows(capacity["u_m3"])
    return {
        "height": book.column("dip_height_m", capacity["height_m"], heights, 10),
        "volume": book.column("volume_m3", capacity["volume_m3"], volumes, 11),
        "U": book.column("expanded_m3", expanded, digits, 12),
        "k": book.column("k_of_gum", capacity["k"], 2, 11),
        "standard_u": book.column("standard_m3", capacity["u_m3"], u, 12),
        "litres_per_cm": book.column("litres_per_cm", litres, 1, 11),
    }


def _intervals(book, capacity):
    """{name: Column} of the interval of each row that counts, and where it comes from."""
    if "interval" not in capacity:  # a record from before
        return {}
    digits = decimals_of_rows(stated_U_m3(capacity), least=LITRE_DECIMALS)
    codes = [book.words["intervals"][code] for code in capacity["interval"]]
    return {
        "low": book.column("from_m3", capacity["low_m3"], digits, 11),
        "high": book.column("to_m3", capacity["high_m3"], digits, 11),
        "interval": book.column("interval", codes, None, max(width_of_lines(codes), 11)),
    }


def _in_units_of_the_table(book, capacity, spec):
    """{name: Column} of dips in feet and inches and of volumes in litres or barrels, if asked."""
    columns = {}
    if spec["height_unit"] != "m":
        columns["dip"] = book.column("dip_ft_in", capacity["dip"], None, 16)
    if spec["volume_unit"] != "m3":
        unit = spec["volume_unit"]
        factor = float(1 / VOLUME_UNITS_M3[unit])
        volumes = [factor * volume for volume in capacity["volume_m3"]]
        digits = decimals_of_rows(_U_in(unit, capacity), least=TABLE_DECIMALS[unit])
        columns["in_unit"] = book.column("volume_in", volumes, digits, 18, unit=unit)
    return columns


def _U_in_unit_of_the_table(book, capacity, unit):
    """{name: Column} of U in litres or barrels, if asked, with its two digits as on paper."""
    if unit == "m3":
        return {}
    expanded = _U_in(unit, capacity)
    shown = [rounded(U) for U in expanded]
    digits = decimals_of_rows(expanded)
    return {"U_in_unit": book.column("expanded_in", shown, digits, 12, unit=unit)}


def _U_in(unit, capacity):
    return [float(1 / VOLUME_UNITS_M3[unit]) * U for U in stated_U_m3(capacity)]
