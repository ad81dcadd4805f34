"""Offsets of reference lines on paper: a row for each level and face, a column for each line."""

from dataclasses import replace

from tankcal.report import blocks
from tankcal.report.tables.lines import OFFSETS

ACROSS, LETTERS = 12, 72  # lines side by side, and letters of their names
MOST_SHOWN = 20  # offsets that are shown with their tests, beside those that were rejected
MARKS = {"used": "{}", "rejected": "{}*", "check": "({})"}


def offsets_by_level(paper):
    """Blocks: every offset as read, in tables of some lines each.

    Repeated readings stand in rows of their own. The workbook and offsets.csv have the same row by
    row.
    """
    record = paper.record["lines"]
    names = [one["line"] for one in record["lines"]]
    decimals = _decimals([1000 * one["offset_m"] for one in record["offsets"]])
    read = _by_place(record["offsets"])
    found = []
    across = max(1, min(ACROSS, LETTERS // max(map(len, names))))
    for start in range(0, len(names), across):
        shown = names[start : start + across]
        rows = [
            [course, paper.number(level_m, decimals=3), str(face),
             *(_cell(paper, cells.get(name), decimals) for name in shown)]
            for (course, level_m, face, _), cells in read.items()
            if cells.keys() & set(shown)
        ]  # fmt: skip
        heads = [(paper.word(f"table_headings.{key}"), unit)
                 for key, unit in (("course", ""), ("level_m", "m"), ("face", ""))]  # fmt: skip
        heads += [(name, "mm") for name in shown]
        align = ["left", "right", "right", *["right"] * len(shown)]
        caption = paper.word("captions.offsets_by_level")
        found.append(blocks.table(heads, rows, caption, align, paper.marks.decimal))
    return found


def largest_departures(record):
    """`Table` of the offsets that were rejected, and of those with the largest |w|."""
    rows = record["lines"]["offsets"]
    order = sorted(range(len(rows)), key=lambda i: _rank(rows[i]))
    aside = sum(one["state"] == "rejected" for one in rows)
    chosen = [rows[i] for i in order[: max(MOST_SHOWN, aside)]]
    return replace(OFFSETS, rows=lambda record: chosen)


def _rank(row):
    return row["state"] != "rejected", -abs(row["w"] or 0.0)


def _by_place(offsets):
    """{(course, level, face, which reading there): {line: offset}}, from the bottom up."""
    found, seen = {}, {}
    for one in offsets:
        place = one["course"], round(one["level_m"], 3), one["face"]
        again = seen[place, one["line"]] = seen.get((place, one["line"]), -1) + 1
        found.setdefault((*place, again), {})[one["line"]] = one
    return dict(sorted(found.items(), key=lambda one: (one[0][1], one[0][3], one[0][2])))


def _cell(paper, offset, decimals):
    if offset is None:
        return None
    text = paper.number(1000 * offset["offset_m"], decimals=decimals)
    return MARKS[offset["state"]].format(text)


def _decimals(values_mm):
    """1, or 2 where a reading has a second decimal."""
    return 1 + any(abs(value - round(value, 1)) > 1e-6 for value in values_mm)
