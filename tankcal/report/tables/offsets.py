"""Offsets of reference lines in the papers: a row per level and face, a column per line."""

from dataclasses import replace

from tankcal.report import blocks
from tankcal.report.tables.lines import OFFSETS

ACROSS, LETTERS = 12, 72  # largest number of lines in a table, and of letters of their names
MOST_SHOWN = 20  # offsets shown with their tests, including the rejected offsets
# Format of an offset by its state.
MARKS = {"used": "{}", "rejected": "{}*", "check": "({})"}


def offsets_by_level(paper):
    """Tables of all observed offsets, several lines per table (list of Block).

    Repeated readings have separate rows. The workbook and offsets.csv list the offsets row by row.
    """
    record = paper.record["lines"]
    names = [line["line"] for line in record["lines"]]
    decimals = _decimals([1000 * offset["offset_m"] for offset in record["offsets"]])
    readings = _group_by_place(record["offsets"])
    tables = []
    across = max(1, min(ACROSS, LETTERS // max(map(len, names))))
    for start in range(0, len(names), across):
        shown = names[start : start + across]
        rows = [
            [course, paper.number(level_m, decimals=3), str(face),
             *(_cell(paper, cells.get(name), decimals) for name in shown)]
            for (course, level_m, face, _), cells in readings.items()
            if cells.keys() & set(shown)
        ]  # fmt: skip
        heads = [(paper.word(f"table_headings.{key}"), unit)
                 for key, unit in (("course", ""), ("level_m", "m"), ("face", ""))]  # fmt: skip
        heads += [(name, "mm") for name in shown]
        align = ["left", "right", "right", *["right"] * len(shown)]
        caption = paper.word("captions.offsets_by_level")
        tables.append(blocks.table(heads, rows, caption, align, paper.marks.decimal))
    return tables


def largest_departures(record):
    """Return the Table of the rejected offsets and of the offsets with the largest |w|."""
    rows = record["lines"]["offsets"]
    order = sorted(range(len(rows)), key=lambda i: _rank(rows[i]))
    rejected = sum(offset["state"] == "rejected" for offset in rows)
    chosen = [rows[i] for i in order[: max(MOST_SHOWN, rejected)]]
    return replace(OFFSETS, rows=lambda record: chosen)


def _rank(row):
    return row["state"] != "rejected", -abs(row["w"] or 0.0)


def _group_by_place(offsets):
    """Return {(course, level, face, number of the repetition): {line: offset}}, from below."""
    readings, counts = {}, {}
    for offset in offsets:
        place = offset["course"], round(offset["level_m"], 3), offset["face"]
        repetition = counts[place, offset["line"]] = counts.get((place, offset["line"]), -1) + 1
        readings.setdefault((*place, repetition), {})[offset["line"]] = offset
    return dict(sorted(readings.items(), key=lambda item: (item[0][1], item[0][3], item[0][2])))


def _cell(paper, offset, decimals):
    if offset is None:
        return None
    text = paper.number(1000 * offset["offset_m"], decimals=decimals)
    return MARKS[offset["state"]].format(text)


def _decimals(values_mm):
    """Return the number of decimals of the readings, 1 or 2."""
    return 1 + any(abs(value - round(value, 1)) > 1e-6 for value in values_mm)
