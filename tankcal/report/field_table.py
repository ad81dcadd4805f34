"""The table that a gauger carries: heights and volumes, millimetres by proportional parts, no U."""

from tankcal.report.numbers import unit
from tankcal.report.tables.capacity import capacity_rows, capacity_table, parts_table
from tankcal.report.tables.facts import FIELD_TABLE, REFERENCES, tank_facts
from tankcal.report.uncertainty.capacity import note_on_use, times_across

MOST_ACROSS = 6


def facts(paper):
    """What must be known to read a dip: tank, certificate, zero, reference height, temperature."""
    shown = (tank_facts(paper.record), REFERENCES)
    return paper.facts([fact for table in shown for fact in paper.facts_of(table, FIELD_TABLE)])


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
