"""Sheets beside the capacity table: proportional parts, other densities, what is in the tank."""

from tankcal.uncertainty import LITRE_DECIMALS, decimals_for, height_decimals, row_decimals
from tankcal.workbook.book import Column

_HEAD_ROW = 3


def proportional_parts_sheet(book, record):
    """What 1 to 9 mm add to the row below a dip, course by course; no sheet for other tables."""
    parts = record["proportional_parts"]
    if not parts["zones"]:
        return
    largest = 1000 * parts["largest_m3"]
    sheet = book.sheet(
        "Proportional parts",
        "Proportional parts",
        f"in litres; largest error against the exact capacity {largest:.2g} L",
        landscape=True,
    )
    zones = parts["zones"]
    heights = [[height_decimals(zone[key]) for zone in zones] for key in ("bottom_m", "top_m")]
    columns = [
        Column("From (m)", [zone["bottom_m"] for zone in zones], heights[0], 10),
        Column("To (m)", [zone["top_m"] for zone in zones], heights[1], 10),
    ]
    for place in range(parts["parts"] - 1):
        litres = [1000 * zone["part_m3"][place] for zone in zones]
        columns.append(Column(f"{place + 1} mm (L)", litres, 1, 11))
    book.widths(sheet, *(column.width for column in columns))
    book.table(sheet, _HEAD_ROW, "proportional_parts", columns)


def densities_sheet(book, record):
    """The table for each further density of the liquid; no sheet where none was asked for."""
    others = record["densities"]
    if not others:
        return
    capacity = record["capacity"]
    own = record["job"]["table"]["liquid_density_kg_m3"]
    sheet = book.sheet(
        "Other densities",
        "Capacity by density of the liquid",
        "volumes in m³; U is that of the sheet Capacity",
    )
    digits = row_decimals(capacity["U_m3"], LITRE_DECIMALS)
    heights = capacity["height_m"]
    tables = [(own, capacity["volume_m3"])]
    tables += [(other["density_kg_m3"], other["volume_m3"]) for other in others]
    columns = [Column("Dip height (m)", heights, [height_decimals(h) for h in heights], 13)]
    columns += [Column(f"{density:g} kg/m³", volumes, digits, 16) for density, volumes in tables]
    book.widths(sheet, *(column.width for column in columns))
    book.table(sheet, _HEAD_ROW, "other_densities", columns)
    sheet.freeze_panes(_HEAD_ROW + 1, 0)
    sheet.repeat_rows(_HEAD_ROW)


def inside_sheet(book, record, words):
    """Dimensions, bottom, deadwood and roof, as far as the tank has them."""
    described = [
        (words["headings"]["dimensions"], record["solid"]),
        (words["corrections"]["bottom"], record["bottom"]),
        (words["corrections"]["roof"], record["roof"]),
    ]
    items = record["deadwood"]
    if not items and not any(lines for _, lines in described):
        return
    sheet = book.sheet("Parts of the tank", "Parts of the tank")
    book.widths(sheet, 50, 16, 16, 16, 16)
    row = _HEAD_ROW
    for title, lines in described:
        if lines:
            book.heading(sheet, row, title, 5)
            row = _lines(book, sheet, row, lines, words) + 2
    if items:
        book.heading(sheet, row, words["corrections"]["deadwood"], 5)
        book.table(sheet, row + 1, "deadwood", _deadwood(items))


def _lines(book, sheet, row, lines, words):
    for line in lines:
        row += 1
        unit, value = line["unit"], line["value"]
        book.put(sheet, row, 0, words["labels"].get(line["code"], line["code"]))
        if unit is None:
            value = words["parts"].get(value, value)
        shown = "0.######" if unit is not None else None
        factor = 1000 if unit in ("mm", "mm/m") else 1
        value = value * factor if unit is not None else value
        book.put(sheet, row, 1, value, **({"num_format": shown} if shown else {}))
        book.put(sheet, row, 2, (unit or "").replace("m3", "m³"), indent=1)
    return row


def _deadwood(items):
    u = [item["u_m3"] for item in items]
    digits = [decimals_for(one) if one else LITRE_DECIMALS + 1 for one in u]
    return [
        Column("Item", [item["name"] for item in items], None, 34),
        Column("Bottom (m)", [item["bottom_m"] for item in items], 3, 12),
        Column("Top (m)", [item["top_m"] for item in items], 3, 12),
        Column("Volume (m³)", [item["volume_m3"] for item in items], digits, 14),
        Column("u (m³)", u, digits, 12),
    ]
