"""The sheet Certificate: tank, main result, and assumptions."""

from tankcal.report.certificate import doubts_of
from tankcal.report.numbers import unit
from tankcal.report.tables import overrulings
from tankcal.report.tables.facts import REFERENCES, SURVEY, SURVEY_DATE, tank_facts
from tankcal.report.uncertainty import method, rule
from tankcal.report.uncertainty.stated import k_of_rows, stated_U_m3
from tankcal.report.workbook.look import ACCENT, DATE, LINE_PT, MUTED, lines_of, number_format
from tankcal.text.digits import decimals_of, decimals_of_height
from tankcal.text.words import choice_sentence, sentence

_WIDTHS = (36, 20, 24, 14, 14)  # widths of the columns, letters
_LONG = 60  # largest number of letters beside a label
_DATES = ("date", "date_of_issue")  # keys of the job with dates


def certificate_sheet(book, record):
    """Write the first sheet of the workbook."""
    words = book.words
    sheet = book.sheet("certificate", tab="result")
    book.widths(sheet, *_WIDTHS)
    row = 3
    if book.notice:
        look = {"bold": True, "font_size": 14, "align": "center", "valign": "vcenter", "border": 2}
        book.paragraph(sheet, row, book.notice, _WIDTHS, border_color=ACCENT, **look)
        sheet.set_row(row, 26)
        row += 2
    row = _result(book, sheet, row, record)
    row = _doubts(book, sheet, row, record)
    row = _entries(
        book, sheet, row, sentence(words, "headings", "tank"), _declared(book, tank_facts(record))
    )
    row = _entries(book, sheet, row, book.word("headings.certificate"), _certificate(record, words))
    row = _entries(
        book, sheet, row, book.word("headings.survey"),
        _declared(book, SURVEY_DATE, SURVEY, REFERENCES),
    )  # fmt: skip
    row = _uncertainty(book, sheet, row, book.paper)
    row = _corrections(book, sheet, row, record)
    row = _overrulings(book, sheet, row)
    row = _choices(book, sheet, row, record)
    _authorisation(book, sheet, row)


def _label(words, key):
    """Return the label of a key of the job; an unknown key vessel_no becomes "Vessel no"."""
    return words["labels"].get(key, key.replace("_", " ").capitalize())


def _certificate(record, words):
    """Return (label, value, DATE or None) for the entries of the certificate in the job."""
    labels = {"number": sentence(words, "page", "number")}
    return [
        (labels.get(key) or _label(words, key), value, DATE if key in _DATES else None)
        for key, value in record["job"]["certificate"].items()
        if key != "notice"  # printed at the top
    ]


def _declared(book, *tables):
    """Return (label, value, format) of declared facts with values; the format may be DATE."""
    words, lines = book.words, []
    for table in tables:
        (row,) = table.rows(book.paper.record)
        for column in table.in_workbook([row]):
            value = column.text(book.paper, row) if column.text else row.get(column.key)
            if value is not None:
                value = sentence(words, column.words, value) if column.words else value
                lines.append((_label(words, column.key), value, _format(column)))
    return lines


def _format(column):
    if column.key == SURVEY_DATE.name:
        return DATE
    return None if column.is_text else number_format(column.decimals, unit=unit(column.unit).symbol)


def _entries(book, sheet, row, title, lines):
    """Write a heading and a line for each (label, value, format); return the next row."""
    if not lines:
        return row
    book.heading(sheet, row, title, len(_WIDTHS))
    for label, value, shown in lines:
        row += 1
        if shown == DATE:
            book.put_date(sheet, row, 1, value, align="left")
        elif len(str(value)) > _LONG:
            book.paragraph_in(sheet, row, 1, str(value), _WIDTHS[1:])
        else:
            look = {"num_format": shown} if shown else {}
            book.put(sheet, row, 1, value, align="left", valign="top", **look)
        book.label(sheet, row, label, _WIDTHS[0])
    return row + 2


def _uncertainty(book, sheet, row, paper):
    """Write method and inputs of U, and the verdict of a decision rule; return the next row."""
    book.heading(sheet, row, paper.word("headings.uncertainty"), len(_WIDTHS))
    for text in method.sentences(paper, f'"{paper.word("intervals.monte_carlo")}"'):
        row += 1
        book.paragraph(sheet, row, text, _WIDTHS)
    row = _entries(
        book, sheet, row + 2, paper.word("headings.inputs"), _facts(paper, method.inputs)
    )
    if not paper.record.get("rule"):
        return row
    row = _entries(book, sheet, row, paper.word("headings.rule"), _facts(paper, rule.facts)) - 1
    for text in rule.sentences(paper):
        book.paragraph(sheet, row, text, _WIDTHS)
        row += 1
    return row + 1


def _facts(paper, facts_of):
    """Return (label, text, None) for the non-empty texts of facts_of(paper)."""
    return [(paper.label(key), text, None) for key, text in facts_of(paper) if text]


def _result(book, sheet, row, record):
    """Write the capacity at the top of the table with U and k; return the next row."""
    capacity, words = record["capacity"], book.words
    U, k = stated_U_m3(capacity)[-1], k_of_rows(capacity)[-1]
    factor, symbol = book.paper.volume_factor, book.paper.volume_symbol
    volume_format = number_format(decimals_of(factor * U), unit=symbol)
    top = number_format(decimals_of_height(capacity["height_m"][-1]), unit="m")
    book.heading(sheet, row, sentence(words, "headings", "result"), len(_WIDTHS))
    lines = []
    for column, code in enumerate(("volume", "U", "k", "dip_height"), 1):
        text = book.word(f"labels.{code}")
        look = {"align": "right", "text_wrap": True, "font_color": MUTED}
        book.put(sheet, row + 1, column, text, **look)
        lines.append(lines_of(text, _WIDTHS[column]))
    book.set_height(sheet, row + 1, LINE_PT * max(lines))
    line = {"bold": True, "font_size": 12}
    sheet.set_row(row + 2, 20)
    book.put(sheet, row + 2, 0, book.word("labels.top_of_table"), **line)
    k = words["intervals"]["monte_carlo"] if k is None else k
    for column, value, shown in (
        (1, factor * capacity["volume_m3"][-1], volume_format),
        (2, factor * U, f'"± "{volume_format}'),
        (3, k, '"k = "0.00'),
        (4, capacity["height_m"][-1], top),
    ):
        book.put(sheet, row + 2, column, value, num_format=shown, align="right", **line)
    return row + 4


def _doubts(book, sheet, row, record):
    """Write the warnings of implausible input; return the next row."""
    lines = doubts_of(record["warnings"])
    if not lines:
        return row
    book.heading(sheet, row, book.words["certificate"]["doubtful"], len(_WIDTHS))
    for text in lines:
        row += 1
        book.paragraph(sheet, row, text, _WIDTHS, bold=True, font_color=ACCENT)
    return row + 2


def _corrections(book, sheet, row, record):
    """Write the applied corrections with their sizes; return the next row."""
    words = book.words
    book.heading(sheet, row, sentence(words, "headings", "corrections"), len(_WIDTHS))
    applied = [correction for correction in record["corrections"] if correction["applied"]]
    factor, symbol = book.paper.volume_factor, book.paper.volume_symbol
    decimals = decimals_of(factor * stated_U_m3(record["capacity"])[-1]) + 1
    volume_format = number_format(decimals, unit=symbol)
    for correction in applied:
        row += 1
        book.put(sheet, row, 0, sentence(words, "corrections", correction["code"]))
        book.put(sheet, row, 1, factor * correction["size_m3"], num_format=volume_format)
        book.put(sheet, row, 2, correction["size_percent"], num_format='0.0000 "%"')
    if not applied:
        row += 1
        book.put(sheet, row, 0, sentence(words, "texts", "no_corrections"))
    return row + 2


def _overrulings(book, sheet, row):
    """Write the decisions against the outlier test; return the next row."""
    texts = overrulings.sentences(book.paper)
    if not texts:
        return row
    book.heading(sheet, row, book.paper.word("headings.overrulings"), len(_WIDTHS))
    for text in texts:
        row += 1
        book.paragraph(sheet, row, text, _WIDTHS)
    return row + 2


def _choices(book, sheet, row, record):
    """Write the assumptions; return the next row."""
    words = book.words
    book.heading(sheet, row, sentence(words, "headings", "choices"), len(_WIDTHS))
    for choice in record["choices"]:
        row += 1
        text = choice_sentence(words, choice)
        book.paragraph(sheet, row, text, _WIDTHS)
    return row + 2


def _authorisation(book, sheet, row):
    """Write blank lines for name, signature, place and date."""
    words = book.words
    book.heading(sheet, row, sentence(words, "headings", "authorisation"), len(_WIDTHS))
    line = book.format(bottom=1)
    for below, key in ((2, "authorised_by"), (4, "signature"), (6, "place_and_date")):
        book.put(sheet, row + below, 0, _label(words, key))
        for column in (1, 2):
            sheet.write_blank(row + below, column, None, line)
