"""The CSV files of the camera's analyses: one row a thing, units in the headings."""

import csv

FORMULA_SIGNS = ("=", "+", "-", "@", "\t", "\r")


def write_csv(path, rows):
    """Write rows (dicts with the same keys) as CSV with twelve digits.

    A text that a spreadsheet would take for a formula gets an apostrophe before it.
    """
    with open(path, "w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(rows[0])
        writer.writerows([_cell(value) for value in row.values()] for row in rows)


def _cell(value):
    if value is None:
        return ""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.12g}"
    if isinstance(value, list):
        value = " ".join(map(str, value))
    text = str(value)
    return f"'{text}" if not isinstance(value, int) and text.startswith(FORMULA_SIGNS) else text
