"""The sheet of the points: where they are, how well they are known, why some were not used."""

from tankcal.report.tables.survey import POINTS, point_rows
from tankcal.report.workbook.tables import columns_of, set_widths

MOST_ROWS = 5_000  # of the sheet: those that were not used, then the weakest
_HEAD_ROW = 3


def points_sheet(book, record):
    """Every surveyed point with its residual, and why it was rejected when it was.

    Of an adjusted survey with sds and error ellipsoids; without a tank with nothing else.
    """
    of_tank = record["capacity"] is not None
    code = "points" if of_tank else "adjusted_points"
    used = sum(row["used"] for row in record["points"]) if of_tank else 0
    subtitle = book.word(f"texts.{code}_subtitle", count=len(record["points"]), used=used)
    shown = _shown(record["points"])
    if len(shown) == MOST_ROWS:
        subtitle = book.word("texts.weakest_points", text=subtitle, shown=len(shown))
    sheet = book.sheet(code, subtitle, landscape=True)
    without_sds = {} if record["adjustment"] else {f"s{axis}_m": {"sheet": None} for axis in "xyz"}
    columns = columns_of(book, POINTS.but(**without_sds), point_rows(record, shown))
    set_widths(book, sheet, columns)
    muted = [index for index, row in enumerate(shown) if of_tank and not row["used"]]
    if shown:
        book.table(sheet, _HEAD_ROW, "points", columns, muted=muted, autofilter=True)
    book.freeze(sheet, _HEAD_ROW, 1)


def _shown(rows):
    """The rows, in their order; of very many those not used, then those with the largest sds."""
    if len(rows) < MOST_ROWS:
        return rows

    def rank(i):
        covariance = rows[i]["cov_m2"]
        variance = 0.0 if covariance is None else sum(covariance[k][k] for k in range(3))
        return rows[i]["used"] is not False, -variance

    return [rows[i] for i in sorted(sorted(range(len(rows)), key=rank)[:MOST_ROWS])]
