"""The sheet of the points: where they are, how well they are known, why some were not used."""

from tankcal.report.workbook.look import in_mm, sd_digits, values_of
from tankcal.report.workbook.tables import set_widths
from tankcal.text.digits import decimals_of_rows
from tankcal.text.words import sentence

MOST_ROWS = 5_000  # of the sheet: those that were not used, then the weakest
_HEAD_ROW = 3


def _or_empty(value):
    """The value, or an empty cell where most rows have none."""
    return "" if value is None else value


def points_sheet(book, record):
    """Every surveyed point with its residual, and why it was rejected when it was.

    Of an adjusted survey with sds and error ellipsoids; without a tank with nothing else.
    """
    of_tank = record["capacity"] is not None
    code = "points" if of_tank else "adjusted_points"
    used = sum(row["used"] for row in record["points"]) if of_tank else 0
    subtitle = book.word(f"texts.{code}_subtitle", count=len(record["points"]), used=used)
    record = record | {"points": _shown(record["points"])}
    rows = record["points"]
    if len(rows) == MOST_ROWS:
        subtitle = book.word("texts.weakest_points", text=subtitle, shown=len(rows))
    sheet = book.sheet(code, subtitle, landscape=True)
    columns = [book.column("point", values_of(rows, "point"), None, 12)]
    if of_tank:
        columns.append(book.column("course", values_of(rows, "course"), None, 9))
        columns.append(book.column("section", values_of(rows, "section"), None, 10))
    for axis, sds in zip("xyz", _sds_m(rows), strict=True):
        digits = decimals_of_rows(sds, most=6, unknown=4)
        columns.append(book.column("of_m", values_of(rows, f"{axis}_m"), digits, 11, axis=axis))
    if of_tank:
        columns += _about_wall(book, record)
    columns += _adjusted(book, record)
    set_widths(book, sheet, columns)
    muted = [index for index, row in enumerate(rows) if of_tank and not row["used"]]
    if rows:
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


def _about_wall(book, record):
    """Columns of what a tank says of its points: residual, whether used, and why not."""
    rows, words = record["points"], book.words
    rejected = {row["point"]: row for row in record["rejected"]}
    of_rejected = [rejected.get(row["point"], {}) for row in rows]
    residual = [
        row["residual_m"] if row["used"] else out.get("residual_m")
        for row, out in zip(rows, of_rejected, strict=True)
    ]
    reason = [
        "" if row["used"] else sentence(words, "reasons", out.get("reason", "not_wall"))
        for row, out in zip(rows, of_rejected, strict=True)
    ]
    return [
        book.column("residual_mm", [in_mm(value) for value in residual], 1, 10),
        book.column("used", values_of(rows, "used"), None, 8),
        book.column("reason", reason, None, 40),
        book.column("w", [_or_empty(out.get("w")) for out in of_rejected], 1, 8),
        book.column("row_in_file", [_or_empty(out.get("row")) for out in of_rejected], 0, 9),
    ]


def _adjusted(book, record):
    """Columns of adjusted points: what each is, its sds and error ellipsoid; else none."""
    if not record["adjustment"]:
        return []
    known = {row["point"]: row for row in record["adjustment"]["points"]}
    rows = [known.get(row["point"], {}) for row in record["points"]]
    kinds = book.words["plan"]
    columns = [
        book.column(
            "kind", [kinds.get(row.get("kind"), row.get("kind", "")) for row in rows], None, 15
        ),
        book.column("rays", [row.get("rays") for row in rows], 0, 7),
    ]
    for axis, sds in zip("xyz", _sds_m(record["points"]), strict=True):
        in_small = [in_mm(sd) for sd in sds]
        columns.append(book.column("sd_of_mm", in_small, sd_digits(in_small), 9, axis=axis))
    for i, axis in enumerate("abc"):
        axes = [in_mm(row["ellipsoid_m"][i]) if row else None for row in rows]
        columns.append(book.column("ellipsoid_mm", axes, sd_digits(axes), 11, axis=axis))
    return columns


def _sds_m(rows):
    """Standard deviations of x, of y and of z, a list each; None where a point has none."""
    variances = [row["cov_m2"] for row in rows]
    return [
        [None if one is None else max(one[i][i], 0.0) ** 0.5 for one in variances] for i in range(3)
    ]
