"""The output workbook capacity.xlsx, written from the record by XlsxWriter (docs/workbook.md).

The package computes no results. The cells contain values of the record, possibly in another unit
(mm for m, litres per centimetre for m2). The stored results of formulas are values of the record.
"""

from tankcal.methods.base import methods
from tankcal.report.workbook.book import Book
from tankcal.report.workbook.calculator import calculator_sheets, factor_sheets
from tankcal.report.workbook.capacity import (
    capacity_sheet,
    charts_sheets,
    densities_sheet,
    millimetres_sheet,
    proportional_parts_sheet,
    roof_sheet,
)
from tankcal.report.workbook.papers import (
    adjustment_sheet,
    budget_sheet,
    cameras_sheet,
    certificate_sheet,
    corrections_sheet,
    deliveries_sheet,
    inside_sheet,
    monte_carlo_sheet,
    observations_sheet,
    points_sheet,
    provenance_sheet,
    rule_sheet,
    ship_sheet,
    tables_sheets,
)
from tankcal.report.workbook.quantity import quantity_sheets
from tankcal.text.words import language_of, load_words, translate_record

# Sheets for other programs, which would print on hundreds of pages: hidden.
_HIDDEN = (
    *("capacity_mm", "workings", "quantity_workings", "covariance_factor"),
    *("covariance_weights", "monte_carlo"),
    *("points", "adjusted_points", "observations", "deviations"),
    *(sheet for method in methods() for sheet in method.hidden_sheets),
)


def write(record, path, language=None, digest=None):
    """Write the workbook of a record; equal records give equal bytes.

    Parameters
    ----------
    record : dict
        Loaded record.json.
    path : str or Path
        Path of the workbook.
    language : str, optional
        Language of the workbook; None: the language of the job.
    digest : str, optional
        SHA-256 of the record.json, which becomes a property of the workbook.

    Raises
    ------
    TankcalError
        If the language of the job is not available.
    OSError
        If the file cannot be written.
    """
    words = load_words(language or language_of(record))
    record = translate_record(words, record)
    hidden = _HIDDEN if record["capacity"] else ("observations",)
    with Book(path, record, words, hidden=hidden) as book:
        if digest:
            book.name_record(digest)
        if record["capacity"]:
            _sheets_of_tank(book, record)
        else:
            adjustment_sheet(book, record)
            points_sheet(book, record)
            observations_sheet(book, record)
            cameras_sheet(book, record)
            provenance_sheet(book, record)
        book.write_index()


def _sheets_of_tank(book, record):
    """Write the sheets of a calibrated tank, in the order of the workbook."""
    certificate_sheet(book, record)
    rows = capacity_sheet(book, record)
    proportional_parts_sheet(book, record)
    densities_sheet(book, record)
    roof_sheet(book, record)
    millimetres_sheet(book, record)
    calculator_sheets(book, record)
    quantity_sheets(book, record)
    factor_sheets(book, record)
    tables_sheets(book, record)
    if record.get("ship"):
        ship_sheet(book, record)
    corrections_sheet(book, record)
    inside_sheet(book, record)
    budget_sheet(book, record)
    if record.get("budgets"):
        deliveries_sheet(book, record)
    if record.get("monte_carlo"):
        monte_carlo_sheet(book, record)
    if record.get("rule"):
        rule_sheet(book, record)
    if record["adjustment"]:
        adjustment_sheet(book, record)
    if record["points"]:
        points_sheet(book, record)
    if record["adjustment"]:
        observations_sheet(book, record)
        cameras_sheet(book, record)
    provenance_sheet(book, record)
    charts_sheets(book, record, rows)
