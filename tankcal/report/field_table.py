"""The field table of a gauger: volumes without U, and proportional parts for millimetres."""

from functools import partial

from tankcal.report.numbers import unit
from tankcal.report.tables.capacity import capacity_rows, capacity_table, parts_table
from tankcal.report.tables.facts import FIELD_TABLE, REFERENCES, tank_facts
from tankcal.report.uncertainty.capacity import note_on_use, times_across

MOST_ACROSS = 6  # largest number of table columns side by side


def facts(paper):
    """Block of tank, certificate, zero, reference height and reference temperature."""
    shown = (tank_facts(paper.record), REFERENCES)
    return paper.facts([fact for table in shown for fact in paper.facts_of(table, FIELD_TABLE)])


def table(paper):
    """Blocks of the field table, set side by side as often as the page width allows."""
    record, name = paper.record, "field_table"
    declared, rows = capacity_table(record), capacity_rows(record)
    across = partial(times_across, most=MOST_ACROSS)
    symbol = unit(record["job"]["table"]["volume_unit"]).symbol
    block = paper.show(declared, rows, on=name, across=across, unit=symbol)
    return [*note_on_use(paper, rows), block]


def proportional_parts(paper):
    """Blocks of the proportional parts per zone; [] if the record has no zones."""
    parts, name = paper.record["proportional_parts"], paper.record["job"]["table"]["volume_unit"]
    if not parts["zones"]:
        return []
    largest = paper.number(parts["largest_m3"], name, digits=2)
    return [paper.show(parts_table(paper.record), unit=unit(name).symbol, largest=largest)]
