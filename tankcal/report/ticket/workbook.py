"""Workbook of a ticket: result, steps, quantities, budgets and uncertainties as numbers."""

from tankcal.report.ticket.pages import notes, warnings_text
from tankcal.report.ticket.tables import BUDGET, QUANTITIES, STEPS, UNCERTAINTIES
from tankcal.report.workbook.book import workbook_head
from tankcal.report.workbook.sections import Sentences, SheetContent, cell_table, write_workbook


def write(paper, path):
    """Write the workbook of a TicketPaper; equal tickets give equal bytes."""
    saved = paper.record
    head = workbook_head(
        saved["tankcal"], tank=saved["tank"], date=saved["date"], notice=saved["notice"]
    )
    write_workbook(paper, path, "ticket", head, sheets)


def sheets(book):
    """Yield the content of each sheet, in order."""
    texts = filter(None, [warnings_text(book.paper), *notes(book.paper)])
    yield SheetContent("steps", [cell_table(book, STEPS), Sentences([*texts])],
                       tab="result")  # fmt: skip
    yield SheetContent("quantities", [cell_table(book, QUANTITIES)], tab="result")
    yield SheetContent("budget", [cell_table(book, BUDGET)], is_filtered=True)
    yield SheetContent("uncertainties", [cell_table(book, UNCERTAINTIES)], tab="input")
