"""What papers of any kind of sights say: words of their tables, a sheet's cells, instruments."""

import openpyxl

from tankcal.report import workbook
from tankcal.report.certificate import _instruments
from tankcal.report.plain import PlainPaper
from tankcal.text.words import load_words, translate_record


def assert_tables_have_words(record, tables, language):
    """Each table has rows of a record, and a caption and headings in a language."""
    words = load_words(language)
    paper, said = PlainPaper(words), translate_record(words, record)
    for table in tables:
        assert table.rows(said)
        assert paper.word(f"captions.{table.name}")
        for column in table.columns:
            assert paper.word(f"table_headings.{column.heading or column.key}")


def cells_of_sheet(record, path, sheet):
    """The filled cells of a sheet of the workbook that a record gives."""
    workbook.write(record, path)
    rows = openpyxl.load_workbook(path)[sheet].iter_rows()
    return [cell.value for row in rows for cell in row if cell.value is not None]


def instruments_said(record):
    """What the certificate of a record says of its instruments, in English."""

    class Paper:
        def __init__(self):
            self.record, self.words = record, load_words("en")

        def word(self, key, **values):
            return PlainPaper(self.words).word(key, **values)

    return _instruments(Paper())
