"""The output workbook: the record as capacity.xlsx, by XlsxWriter (docs/workbook.md).

No number is computed here. What stands in a cell is the record's value, at most in another unit
(mm for m, litres per centimetre for m2), and a formula carries the record's value as its result.
"""

from tankcal.words import load_words
from tankcal.workbook.book import Book
from tankcal.workbook.capacity import capacity_sheet, charts_sheet
from tankcal.workbook.certificate import certificate_sheet
from tankcal.workbook.dip import dip_sheet
from tankcal.workbook.papers import (
    budget_sheet,
    corrections_sheet,
    courses_sheet,
    provenance_sheet,
)
from tankcal.workbook.parts import densities_sheet, inside_sheet, proportional_parts_sheet
from tankcal.workbook.points import points_sheet
from tankcal.workbook.survey import adjustment_sheet, cameras_sheet, observations_sheet


def write(record, path):
    """Write the workbook of `record` (record.json as parsed) to `path`; same record, same bytes.

    Raises TankcalError when no words are shipped in the language of the job, OSError when the file
    cannot be written.
    """
    words = load_words((record["job"]["table"] or {}).get("language") or "en")
    with Book(path, record) as book:
        if record["capacity"]:
            _sheets_of_tank(book, record, words)
        else:
            _sheets_of_survey(book, record, words)


def _sheets_of_tank(book, record, words):
    certificate_sheet(book, record, words)
    rows = capacity_sheet(book, record)
    proportional_parts_sheet(book, record)
    densities_sheet(book, record)
    dip_sheet(book, record)
    inside_sheet(book, record, words)
    if record["courses"]:
        courses_sheet(book, record, words)
    corrections_sheet(book, record, words)
    if record["points"]:
        points_sheet(book, record, words)
    if record["adjustment"]:
        adjustment_sheet(book, record, words)
        observations_sheet(book, record, words)
        cameras_sheet(book, record, words)
    budget_sheet(book, record, words)
    provenance_sheet(book, record, words)
    charts_sheet(book, rows)


def _sheets_of_survey(book, record, words):
    """A survey that was only adjusted: no table, nothing that follows from one."""
    adjustment_sheet(book, record, words)
    points_sheet(book, record, words)
    observations_sheet(book, record, words)
    cameras_sheet(book, record, words)
    provenance_sheet(book, record, words)
