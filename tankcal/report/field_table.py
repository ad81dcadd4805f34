"""The table that a gauger carries: heights and volumes, millimetres by proportional parts, no U."""

from tankcal.report.dip_point import dip_point_text
from tankcal.report.numbers import unit
from tankcal.report.tables.capacity import capacity_rows, capacity_table, parts_table
from tankcal.report.uncertainty.table import note_on_use, times_across

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
    record, name = paper.record, "field_table"
    declared, rows = capacity_table(record), capacity_rows(record)
    across = times_across(paper, rows, declared.on_paper(name, rows), most=MOST_ACROSS)
    symbol = unit(record["job"]["table"]["volume_unit"]).symbol
    block = paper.show(declared, rows, on=name, across=across, unit=symbol)
    return [*note_on_use(paper, rows), block]


def proportional_parts(paper):
    """What millimetres add to a row of a centimetre table, zone by zone; [] where nothing does."""
    parts, name = paper.record["proportional_parts"], paper.record["job"]["table"]["volume_unit"]
    if not parts["zones"]:
        return []
    largest = paper.number(parts["largest_m3"], name, digits=2)
    return [paper.show(parts_table(paper.record), unit=unit(name).symbol, largest=largest)]
