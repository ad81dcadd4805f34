"""Workbook of a ticket: result, steps, quantities, budgets and uncertainties as numbers."""

from tankcal.report.ticket.pages import (
    comparison_text,
    label_text,
    notes,
    result_text,
    warnings_text,
)
from tankcal.report.ticket.tables import BUDGET, QUANTITIES, STEPS, UNCERTAINTIES
from tankcal.report.workbook.book import workbook_head
from tankcal.report.workbook.sections import (
    FIRST_LINE,
    Sentences,
    SheetContent,
    cell_table,
    write_workbook,
)


def write(paper, path):
    """Write the workbook of a TicketPaper; equal tickets give equal bytes."""
    saved = paper.record
    head = workbook_head(
        saved["tankcal"], tank=saved["tank"], date=saved["date"], notice=saved["notice"]
    )
    write_workbook(paper, path, "ticket", head, sheets)


def sheets(book):
    """Yield the content of each sheet, in order."""
    paper = book.paper
    result = ": ".join([label_text(paper), result_text(paper)])
    texts = filter(None, [warnings_text(paper), *notes(paper)])
    compared = filter(None, [comparison_text(paper)])
    head = Sentences([result], look=FIRST_LINE), Sentences([*compared])
    sections = [head, cell_table(book, STEPS), Sentences([*texts])]
    yield SheetContent("steps", sections, tab="result")
    yield SheetContent("quantities", [cell_table(book, QUANTITIES)], tab="result")
    yield SheetContent("budget", [cell_table(book, BUDGET)], is_filtered=True)
    yield SheetContent("uncertainties", [cell_table(book, UNCERTAINTIES)], tab="input")
