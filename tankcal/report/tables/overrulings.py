"""Decisions against the outlier test: sentences of the certificate, and a table."""

from tankcal.report.tables.table import Column, Table

LITRE = 3  # decimals of a change of volume in m3
NO_SOLUTION, REMOVED = "no_solution", "removed"


def _what(paper, row):
    return row["what"] if row["kind"] == "point" else _reading(paper, row)


def _reading(paper, row):
    table, _, number = row["what"].rpartition(" ")
    return paper.word("overrulings.reading", table=table, row=number)


def _searched(paper, row):
    """Return the result of the outlier test without the decision; None: not computed."""
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
    """Return the decisions of a record (list of dict)."""
    overrulings = record.get("overrulings")
    return overrulings["each"] if overrulings else []


def sentences(paper):
    """Return a sentence for each decision, and a sentence on their joint effect."""
    overrulings = paper.record.get("overrulings")
    if not overrulings:
        return []
    texts = [sentence_of(paper, row) for row in overrulings["each"]]
    if len(texts) > 1 and overrulings["moved_m3"] is not None:
        texts.append(
            paper.word("overrulings.together", moved=_litres(paper, overrulings["moved_m3"]))
        )
    if overrulings["others"]:
        texts.append(paper.word("overrulings.others", names=", ".join(overrulings["others"])))
    return texts


def sentence_of(paper, row):
    """Return a sentence on a decision: reason, person, result of the test, and effect."""
    parts = [paper.word(f"overrulings.{row['decision']}", what=_what(paper, row))]
    parts.append(paper.word("overrulings.reason", reason=row["reason"].rstrip(". ")))
    person, day = row["by"], paper.day(row["date"])
    if person:
        who = ", ".join(part for part in (person, day) if part)
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
    """Return distance and w in brackets, such as " (12.3 mm from the wall; w = 5.1)", or ""."""
    parts = []
    if row["off_m"] is not None:
        off = paper.number(row["off_m"], "mm", decimals=1)
        parts.append(paper.word("overrulings.off", off=off))
    if row["w"] is not None:
        parts.append(f"w = {paper.number(row['w'], decimals=1)}")
    return f" ({'; '.join(parts)})" if parts else ""


def _litres(paper, moved_m3):
    text = paper.number(moved_m3, "m3", decimals=LITRE)
    return f"+{text}" if moved_m3 > 0 else text
