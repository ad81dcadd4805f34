"""Tables of tank S-1 over the years, their radii drawn with known changes, and a saved history."""

from dataclasses import replace
from datetime import date

import numpy as np
from tables_of_s1 import RADII, new_s1, rings_m3

from tankcal.products.recalibration.history import DatedTable, history_of
from tankcal.record.recalibration import CheckInHistory, InspectionInHistory
from tankcal.record.schema import to_plain

COMMON_U = 0.0002  # relative standard uncertainty of a table, common to its rows
HOSTILE = '=HYPERLINK("http://x.example","y") <script>alert(1)</script>'
NAME = f"{HOSTILE} {'very_long_name_of_a_file_' * 4}.json"


def radii_of_year(number):
    """(5,) the first course settles by 0.4 mm a year, the second by a tenth of that."""
    return RADII - 0.0004 * number * np.array([1.0, 0.1, 0.0, 0.0, 0.0])


def dated_table(number, error=0.0, **given):
    """Table of a year: 2000 + number; `error` is its relative error, U the expanded one."""
    dips = np.round(np.arange(0.10, 8.395, 0.05), 3)
    volumes = (1 + error) * rings_m3(dips, radii_of_year(number), 850.0, is_first_order=True)
    table = new_s1(dips) if not given else new_s1(dips, **given)
    U = 1.959963984540054 * COMMON_U * volumes
    table = replace(
        table, name=f"{2000 + number}.csv", volume_m3=volumes, U_m3=U, k=1.959963984540054,
        number=f"C-{number}", date=f"{2000 + number}-05-31",
    )  # fmt: skip
    return DatedTable(table, f"{number:064d}", date(2000 + number, 5, 31))


def drawn_tables(count, seed=7):
    """Tables of so many years whose errors are drawn by the U that they state."""
    errors = np.random.default_rng(seed).normal(0.0, COMMON_U, count)
    return [dated_table(number, error) for number, error in enumerate(errors)]


def inspections():
    """Two inspections, one of them without a date."""
    check = CheckInHistory("plumbness_axis", "mm", 21.0, 4.0, 42.0, "passed")
    open_check = CheckInHistory("peaking", "mm", None, None, 12.7, "not_determined")
    worse = replace(check, value=-44.0, verdict="failed")
    given = {"sha256": "0" * 64, "tank": "S-1", "rule": "API 653"}
    return [
        InspectionInHistory(
            file="i/a.json", date="2003-02-01", checks=[check, open_check], **given
        ),
        InspectionInHistory(file="i/b.json", date="2006-02-01", checks=[worse], **given),
        InspectionInHistory(file="i/c.json", date=None, checks=[worse], **given),
    ]


def plain():
    """A history of five tables and three inspections."""
    return to_plain(history_of(drawn_tables(5), inspections()))


def single():
    """One table, without U."""
    one = dated_table(3)
    return to_plain(history_of([replace(one, table=replace(one.table, U_m3=None))]))


def hostile():
    """Texts that a spreadsheet, a browser or a typesetter could take for commands."""
    found = plain()
    for one in found["certificates"]:
        one |= {"number": "=1+1 #strong[x] $E$ \\n", "laboratory": NAME, "file": NAME}
    found["inspections"][0]["file"] = NAME
    warning = {"file": NAME, "row": None, "column": None, "code": None, "values": {}}
    found["left_out"] = [warning | {"text": "=SUM(A1)"}]
    return found | {"tank": None, "notice": "@NOTICE"}
