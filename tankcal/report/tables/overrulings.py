"""Decisions against the search for blunders: as sentences of the certificate, and as a table."""

from tankcal.report.tables.table import Column, Table

LITRE = 3  # decimals of a change of volume, m3: most are of litres
NO_SOLUTION, REMOVED = "no_solution", "removed"


def _what(paper, row):
    return row["what"] if row["kind"] == "point" else _reading(paper, row)


def _reading(paper, row):
    table, _, number = row["what"].rpartition(" ")
    return paper.word("overrulings.reading", table=table, row=number)


def _searched(paper, row):
    """What the search alone does with it, in words; None: not computed."""
    code = row["searched"]
    if code is None:
        return None
    if code in ("", REMOVED, NO_SOLUTION):
        return paper.word(f"overrulings.searched_{code or 'used'}")
    return paper.word(f"reasons.{code}")


OVERRULINGS = Table(
    "overrulings",
    (
        Column("what", text=_what, heading="overruled"),
        Column("decision", words="overruling_decisions"),
        Column("reason", heading="overruling_reason"),
        Column("by", heading="decided_by"),
        Column("date", text=lambda paper, row: paper.day(row["date"]), heading="decided_on"),
        Column("searched", text=_searched),
        Column("off_m", "mm", decimals=1, heading="residual_m"),
        Column("w", decimals=1),
        Column("moved_m3", "m3", decimals=LITRE),
    ),
    rows=lambda record: record["overrulings"]["each"],
)


def decisions_of(record):
    """The decisions of a record; [] where there are none."""
    found = record.get("overrulings")
    return found["each"] if found else []


def sentences(paper):
    """What the certificate states of each decision, then what they change together."""
    found = paper.record.get("overrulings")
    if not found:
        return []
    told = [sentence_of(paper, row) for row in found["each"]]
    if len(told) > 1 and found["moved_m3"] is not None:
        told.append(paper.word("overrulings.together", moved=_litres(paper, found["moved_m3"])))
    if found["others"]:
        told.append(paper.word("overrulings.others", names=", ".join(found["others"])))
    return told


def sentence_of(paper, row):
    """One decision: what, why, by whom, what the search said, and what it is worth."""
    parts = [paper.word(f"overrulings.{row['decision']}", what=_what(paper, row))]
    parts.append(paper.word("overrulings.reason", reason=row["reason"].rstrip(". ")))
    by, day = row["by"], paper.day(row["date"])
    if by:
        who = ", ".join(one for one in (by, day) if one)
        parts.append(paper.word("overrulings.by", who=who))
    elif day:
        parts.append(paper.word("overrulings.on", day=day))
    searched = _searched(paper, row)
    if searched is not None:
        parts.append(
            paper.word("overrulings.search", searched=searched, numbers=_numbers(paper, row))
        )
    if row["moved_m3"] is not None:
        parts.append(paper.word("overrulings.moved", moved=_litres(paper, row["moved_m3"])))
    return " ".join(parts)


def _numbers(paper, row):
    """(12.3 mm from the wall; w = 5.1); "" where there are none."""
    found = []
    if row["off_m"] is not None:
        off = paper.number(row["off_m"], "mm", decimals=1)
        found.append(paper.word("overrulings.off", off=off))
    if row["w"] is not None:
        found.append(f"w = {paper.number(row['w'], decimals=1)}")
    return f" ({'; '.join(found)})" if found else ""


def _litres(paper, moved_m3):
    text = paper.number(moved_m3, "m3", decimals=LITRE)
    return f"+{text}" if moved_m3 > 0 else text
