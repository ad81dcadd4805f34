"""The sheet of the points: where they are, how well they are known, why some were not used."""

from tankcal.words import sentence
from tankcal.workbook.book import Column, in_mm

_HEAD_ROW = 3


def _of(rows, key):
    """The values of one key, row by row."""
    return [row[key] for row in rows]


def _or_empty(value):
    """The value, or an empty cell where most rows have none."""
    return "" if value is None else value


def points_sheet(book, record, words):
    """Every surveyed point with its residual, and why it was rejected when it was.

    Of an adjusted survey with sds and error ellipsoids; without a tank with nothing else.
    """
    rows = record["points"]
    of_tank = record["capacity"] is not None
    columns = [
        Column("Point", _of(rows, "point"), None, 12),
        Column("x (m)", _of(rows, "x_m"), 4, 14),
        Column("y (m)", _of(rows, "y_m"), 4, 14),
        Column("z (m)", _of(rows, "z_m"), 4, 12),
        *_adjusted(record),
    ]
    title, subtitle = "Adjusted points", f"{len(rows)} points; error ellipsoid of 95 %"
    if of_tank:
        course, section, *others = _of_wall(record, words)
        columns = [columns[0], course, section, *columns[1:], *others]
        used = sum(row["used"] for row in rows)
        title = "Points and residuals"
        subtitle = (
            f"{len(rows)} points surveyed, {used} accepted; residual from the circle of the "
            "section (or the wall of a solid), outwards positive"
        )
    sheet = book.sheet(title, title, subtitle, landscape=True)
    book.widths(sheet, *(column.width for column in columns))
    muted = [index for index, row in enumerate(rows) if of_tank and not row["used"]]
    if rows:
        book.table(sheet, _HEAD_ROW, "points", columns, muted=muted, autofilter=True)
    sheet.freeze_panes(_HEAD_ROW + 1, 1)
    sheet.repeat_rows(_HEAD_ROW)


def _of_wall(record, words):
    """Columns of what a tank says of its points: course, section, residual, why not used."""
    rows = record["points"]
    rejected = {row["point"]: row for row in record["rejected"]}
    of_rejected = [rejected.get(row["point"], {}) for row in rows]
    residual = [
        row["residual_m"] if row["used"] else out.get("residual_m")
        for row, out in zip(rows, of_rejected, strict=True)
    ]
    reason = [
        sentence(words, "reasons", out["reason"])
        if "reason" in out
        else sentence(words, "reasons", "not_wall")
        if not row["used"]
        else ""
        for row, out in zip(rows, of_rejected, strict=True)
    ]
    return [
        Column("Course", _of(rows, "course"), None, 9),
        Column("Section", _of(rows, "section"), None, 10),
        Column("Residual (mm)", [in_mm(value) for value in residual], 1, 12),
        Column("Used", _of(rows, "used"), None, 8),
        Column("Reason", reason, None, 48),
        Column("w", [_or_empty(out.get("w")) for out in of_rejected], 1, 8),
        Column("Row in the file", [_or_empty(out.get("row")) for out in of_rejected], 0, 10),
    ]


def _adjusted(record):
    """Columns of adjusted points: what each is, its sds and error ellipsoid; else none."""
    if not record["adjustment"]:
        return []
    known = {row["point"]: row for row in record["adjustment"]["points"]}
    rows = [known.get(row["point"], {}) for row in record["points"]]
    variance = [row["cov_m2"] for row in record["points"]]
    columns = [
        Column("Kind", [row.get("kind", "") for row in rows], None, 10),
        Column("Rays", [row.get("rays") for row in rows], 0, 7),
    ]
    for i, axis in enumerate("xyz"):
        sds = [None if one is None else 1000 * max(one[i][i], 0.0) ** 0.5 for one in variance]
        columns.append(Column(f"sd {axis} (mm)", sds, 2, 9))
    for i, axis in enumerate("abc"):
        axes = [in_mm(row["ellipsoid_m"][i]) if row else None for row in rows]
        columns.append(Column(f"Ellipsoid {axis} (mm)", axes, 2, 11))
    return columns
