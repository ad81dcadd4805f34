"""From the checked rows of overrulings.csv to `Overruling`s."""

from tankcal.job.model.overrulings import Overruling

_COLUMNS = ("point", "table", "row", "decision", "reason", "by", "date")


def make_overrulings(table):
    """`Overruling`s in the order of the file; () without the table."""
    if table is None:
        return ()
    rows = zip(*map(table.of, _COLUMNS), table.rows, strict=True)
    return tuple(
        Overruling(
            point=point,
            table=reading_table,
            reading_row=None if number is None else int(number),
            decision=decision,
            reason=reason,
            by=by or "",
            date="" if date is None else str(date),
            row=row,
            file=table.file,
        )
        for point, reading_table, number, decision, reason, by, date, row in rows
    )
