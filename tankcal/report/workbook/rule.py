"""The sheet Decision rule: what the rule limits, and what became of every limit."""

from tankcal.report.uncertainty import rule
from tankcal.report.workbook.tables import columns_of, write_tables

_HEAD_ROW = 3
_FACTS = (40, 16, 16, 16, 16, 16)  # widths of the columns that the facts go over


def rule_sheet(book, record):
    """The rule, its verdict, and its limits; of U first, then of deviations."""
    paper = book.paper
    sheet = book.sheet("rule", landscape=True, tab="result")
    row = _HEAD_ROW
    for key, text in rule.facts(paper):
        if text:
            book.paragraph_in(sheet, row, 1, text, _FACTS[1:])
            book.label(sheet, row, paper.label(key), _FACTS[0])
            row += 1
    tables = [("limits", rule.LIMITS)]
    if record["rule"]["deviation"]:
        tables += [("deviations", rule.DEVIATIONS), ("acceptance", rule.ACCEPTANCE)]
    tables = [
        (book.word(f"headings.{name}"), name, columns_of(book, table)) for name, table in tables
    ]
    row = write_tables(book, sheet, row + 1, tables)
    for text in rule.sentences(paper):
        book.paragraph(sheet, row, text, (*_FACTS, *_FACTS[1:4]))
        row += 1
