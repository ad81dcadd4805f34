"""The table that a gauger carries: heights and volumes, millimetres by proportional parts, no U."""

from tankcal.report.dip_point import dip_point_text
from tankcal.report.numbers import unit
from tankcal.report.paper import Column
from tankcal.report.uncertainty.table import NOT_FOR_USE, capacity_rows, times_across, use_columns

MOST_ACROSS = 6


def facts(paper):
    """What must be known to read a dip: tank, certificate, zero, reference height, temperature."""
    record = paper.record
    job, datum = record["job"], record["job"]["datum"]
    density = job["table"]["liquid_density_kg_m3"] or None
    return paper.facts(
        [
            ("tank_id", job["tank"]["id"]),
            ("location", job["tank"]["details"].get("location")),
            ("certificate_number", job["certificate"].get("number")),
            ("zero", paper.word(f"zeros.{record['capacity']['zero']}")),
            ("reference_height", paper.number(datum["reference_height_m"], "m", decimals=3)),
            ("dip_point", dip_point_text(paper)),
            (
                "reference_temperature",
                paper.number(job["table"]["reference_temperature_c"], "degC", digits=3),
            ),
            ("table_density", paper.number(density, "kg/m3", digits=4)),
        ]
    )


def table(paper):
    """Heights and volumes, to the litre, as many times side by side as there is room."""
    spec, rows = paper.record["job"]["table"], capacity_rows(paper)
    shown = unit(spec["volume_unit"])
    height = Column("dip") if spec["height_unit"] != "m" else Column("height_m", "m", height=True)
    columns = [height, Column("volume_m3", spec["volume_unit"], decimals=shown.least)]
    columns += use_columns(rows)
    across = times_across(paper, rows, columns, most=MOST_ACROSS)
    found = [paper.table("field_table", rows, columns, across=across, unit=shown.symbol)]
    if len(columns) > 2:
        found.insert(0, paper.paragraph("not_for_use_marked", mark=NOT_FOR_USE))
    return found


def proportional_parts(paper):
    """What millimetres add to a row of a centimetre table, zone by zone; [] where nothing does."""
    parts, name = paper.record["proportional_parts"], paper.record["job"]["table"]["volume_unit"]
    if not parts["zones"]:
        return []
    of_mm = [Column(f"part_{n}", name, digits=4) for n in range(1, parts["parts"])]
    rows = [
        zone | {f"part_{n}": part for n, part in enumerate(zone["part_m3"], 1)}
        for zone in parts["zones"]
    ]
    heights = [Column(f"{end}_m", "m", height=True) for end in ("bottom", "top")]
    largest = paper.number(parts["largest_m3"], name, digits=2)
    symbol = unit(name).symbol
    columns = [*heights, *of_mm]
    return [paper.table("proportional_parts", rows, columns, unit=symbol, largest=largest)]
