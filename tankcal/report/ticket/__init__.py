"""Files of `tankcal ticket`: JSON, CSV, workbook, XML, PDF of a single page, and web page.

All values come from ticket.json; no number is computed here.
"""

from typing import ClassVar

from tankcal.record.ticket import TICKET
from tankcal.report import blocks
from tankcal.report.plain import words_with_part
from tankcal.report.saved_document import SavedDocument, SavedPaper, bearable
from tankcal.report.ticket.pages import BUDGET, QUANTITIES, STEPS, UNCERTAINTIES
from tankcal.text.shipped import DEFAULT
from tankcal.text.words import load_words, message_sentence

__all__ = ["DOCUMENT", "TicketPaper", "refuse_foreign", "write_ticket"]

FILE, WORKBOOK, XML = "ticket.json", "ticket.xlsx", "ticket.xml"
TABLES = {
    "steps.csv": STEPS,
    "quantities.csv": QUANTITIES,
    "budget.csv": BUDGET,
    "uncertainties.csv": UNCERTAINTIES,
}


class TicketPaper(SavedPaper):
    """Formatter of a `record.ticket.TicketFile` in a language.

    Words are looked up in the part of a group under `ticket` first, then in the group.

    Parameters
    ----------
    ticket : dict
        The ticket as plain data; it is checked by its schema.
    language : str, optional
        As in languages.LANGUAGES; None: English.
    letterhead : letterhead.Letterhead, optional
    """

    kind, file = "ticket", FILE
    attached: ClassVar[dict] = {FILE: "ticket", WORKBOOK: "ticket_workbook", XML: "ticket_xml"}
    is_dense = True

    def __init__(self, ticket, language=None, letterhead=None):
        super().__init__(words_with_part(load_words(language or DEFAULT), "ticket"))
        self.saved = self.record = TICKET.migrated(ticket, TICKET.file)
        self.letterhead = letterhead.data() if letterhead else None

    def head(self, folder=None):
        """Document block and title; the facts below name number, tank and product."""
        document, _ = super().head(folder)
        return [document, blocks.masthead(self.word(f"titles.{self.kind}"))]

    def subject(self):
        """Return the number of the ticket, the tank and the product."""
        saved = self.record
        tank = f"{self.word('page.tank')} {saved['tank']}"
        return bearable(" · ".join(filter(None, (saved["number"], tank, saved["product"]))))

    def date(self):
        """Return the ISO date of the transfer, or "" if it is not known."""
        return self.record["date"] or ""

    def warning(self, entry):
        """Return a warning with its key, such as closing.dip_m."""
        sentence = message_sentence(self.words, entry["text"], entry["code"], entry["values"])
        place = f"{entry['column']}: " if entry["column"] else ""
        return bearable(f"{place}{sentence}")

    def correction(self):
        """Return the volume correction with edition, group and base."""
        saved = self.record
        return message_sentence(
            self.words, saved["correction"], saved["correction_code"], saved["correction_values"]
        )

    @property
    def state(self):
        """State of the main result: "moved", or "closing" for a stock."""
        return "moved" if len(self.record["gaugings"]) > 1 else "closing"

    def quantity(self, state, name):
        """Return the saved quantity of a state."""
        return next(
            row
            for row in self.record["quantities"]
            if (row["state"], row["quantity"]) == (state, name)
        )

    def input_name(self, row):
        """Return the name of an input of the budget, with its gauging."""
        name = self.words["inputs"][row["input"]]
        if row["gauging"] is None:
            return name
        return f"{name}, {self.words['states'][row['gauging']]}"


def _load_renderers():
    from tankcal.report.ticket.pages import pages

    return pages, _write_sheets


def _write_sheets(paper, path):
    """Write the workbook of a TicketPaper; equal tickets give equal bytes."""
    from tankcal.report.workbook.book import workbook_head
    from tankcal.report.workbook.sections import write_workbook

    saved = paper.record
    head = workbook_head(
        saved["tankcal"], tank=saved["tank"], date=saved["date"], notice=saved["notice"]
    )
    write_workbook(paper, path, "ticket", head, _sheets)


def _sheets(book):
    """Yield the content of each sheet, in order."""
    from tankcal.report.ticket.pages import (
        comparison_text,
        label_text,
        notes,
        result_text,
        room_texts,
        warnings_text,
    )
    from tankcal.report.workbook.sections import FIRST_LINE, Sentences, SheetContent, cell_table

    paper = book.paper
    result = ": ".join([label_text(paper), result_text(paper)])
    texts = filter(None, [warnings_text(paper), *notes(paper)])
    compared = filter(None, [comparison_text(paper)])
    rooms = [f"{paper.label(key)}: {text}" for key, text in room_texts(paper)]
    head = Sentences([result], look=FIRST_LINE), Sentences([*compared, *rooms])
    sections = [head, cell_table(book, STEPS), Sentences([*texts])]
    yield SheetContent("steps", sections, tab="result")
    yield SheetContent("quantities", [cell_table(book, QUANTITIES)], tab="result")
    yield SheetContent("budget", [cell_table(book, BUDGET)], is_filtered=True)
    yield SheetContent("uncertainties", [cell_table(book, UNCERTAINTIES)], tab="input")


def _write_xml(paper, path):
    from tankcal.report.ticket.xml import ticket_xml

    path.write_bytes(ticket_xml(paper))


DOCUMENT = SavedDocument(
    TICKET,
    TicketPaper,
    _load_renderers,
    tables=TABLES,
    others={XML: _write_xml},
    recomputed_by="tankcal.products.quantity.ticketing:compute_again",
)
refuse_foreign = DOCUMENT.refuse_foreign
write_ticket = DOCUMENT.write
