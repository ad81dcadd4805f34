"""What papers say: every text of their blocks, words of their tables, a sheet's cells."""

import openpyxl

from tankcal.report import workbook
from tankcal.report.certificate import _instruments
from tankcal.report.plain import PlainPaper
from tankcal.text.words import load_words, translate_record

NO_TEXT = {"kind", "align", "language", "decimal_mark", "part", "svg", "date", "nodes"}


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


def texts_of(blocks):
    """Every text of some blocks that a reader sees."""

    def seen(value, key=None):
        if key in NO_TEXT:
            return
        if isinstance(value, str):
            yield value
        elif isinstance(value, dict):
            for name, one in value.items():
                yield from seen(one, name)
        elif isinstance(value, list):
            for one in value:
                yield from seen(one)

    return [text for block in blocks for text in seen(block.data)]


def texts_in(value):
    """Every text of what is saved."""
    if isinstance(value, dict):
        return {text for one in value.values() for text in texts_in(one)}
    if isinstance(value, list):
        return {text for one in value for text in texts_in(one)}
    return {value} if isinstance(value, str) else set()
