"""The sheet Certificate: tank, main result, and assumptions."""

from functools import partial

from tankcal.report.certificate import (
    authorising_person,
    calibration_facts,
    doubts_of,
    limits_of_u,
)
from tankcal.report.numbers import unit
from tankcal.report.tables import overrulings
from tankcal.report.tables.facts import REFERENCES, SURVEY, SURVEY_DATE, tank_facts
from tankcal.report.uncertainty import method, rule
from tankcal.report.uncertainty.stated import k_of_rows, stated_U_m3
from tankcal.report.workbook.look import ACCENT, DATE, LINE_PT, MUTED, lines_of, number_format
from tankcal.report.workbook.sections import (
    DrawnPart,
    Facts,
    Sentences,
    SheetContent,
    write_sheet,
)
from tankcal.text.digits import decimals_of, decimals_of_height
from tankcal.text.words import choice_sentence, sentence

_WIDTHS = (36, 20, 24, 14, 14)  # widths of the columns, letters
_LONG = 60  # largest number of letters beside a label
_DATES = ("date", "date_of_issue")  # keys of the job with dates
_ELSEWHERE = (  # keys of the certificate that other parts of the sheet show
    *("notice", "survey_end", "authorised_by", "authorised_role"),
    *("next_verification", "next_verification_rule"),
)


def certificate_sheet(book, record):
    """Write the first sheet of the workbook."""
    words, paper = book.words, book.paper
    rules = ()
    if record.get("rule"):
        facts = _facts(paper, paper.word("headings.rule"), rule.facts)
        rules = ((facts, Sentences(rule.sentences(paper))),)
    choices = [choice_sentence(words, choice) for choice in record["choices"]]
    sections = [
        *([DrawnPart(_draw_notice)] if book.notice else []),
        DrawnPart(partial(_draw_result, record), sentence(words, "headings", "result")),
        Sentences([limits_of_u(paper)]),
        Sentences(
            doubts_of(record["warnings"]),
            title=words["certificate"]["doubtful"],
            look={"bold": True, "font_color": ACCENT},
        ),
        Facts(
            _declared(book, tank_facts(record)), sentence(words, "headings", "tank"), longest=_LONG
        ),
        Facts(_certificate(record, words), book.word("headings.certificate"), longest=_LONG),
        Facts(
            _declared(book, SURVEY_DATE, SURVEY, REFERENCES),
            book.word("headings.survey"),
            longest=_LONG,
        ),
        _facts(paper, paper.word("headings.calibration"), calibration_facts),
        Sentences(
            method.sentences(paper, f'"{paper.word("intervals.monte_carlo")}"'),
            title=paper.word("headings.uncertainty"),
        ),
        _facts(paper, paper.word("headings.inputs"), method.inputs),
        *rules,
        DrawnPart(partial(_draw_corrections, record), sentence(words, "headings", "corrections")),
        Sentences(overrulings.sentences(paper), title=paper.word("headings.overrulings")),
        Sentences(choices, title=sentence(words, "headings", "choices")),
        DrawnPart(
            partial(_draw_authorisation, record), sentence(words, "headings", "authorisation")
        ),
    ]
    content = SheetContent("certificate", sections, landscape=False, tab="result", widths=_WIDTHS)
    write_sheet(book, content)


def _label(words, key):
    """Return the label of a key of the job; an unknown key vessel_no becomes "Vessel no"."""
    return words["labels"].get(key, key.replace("_", " ").capitalize())


def _certificate(record, words):
    """Return (label, value, DATE or None) for the entries of the certificate in the job."""
    labels = {"number": sentence(words, "page", "number")}
    return [
        (labels.get(key) or _label(words, key), value, DATE if key in _DATES else None)
        for key, value in record["job"]["certificate"].items()
        if key not in _ELSEWHERE
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


def _facts(paper, title, facts_of):
    """Return the `Facts` for the non-empty texts of facts_of(paper)."""
    lines = [(paper.label(key), text, None) for key, text in facts_of(paper) if text]
    return Facts(lines, title, longest=_LONG)


def _draw_notice(book, sheet, row):
    """Write the notice of the certificate in a frame; return the next row."""
    look = {"bold": True, "font_size": 14, "align": "center", "valign": "vcenter", "border": 2}
    book.paragraph(sheet, row, book.notice, _WIDTHS, border_color=ACCENT, **look)
    sheet.set_row(row, 26)
    return row + 1


def _draw_result(record, book, sheet, row):
    """Write the capacity at the top of the table with U and k; return the next row."""
    capacity, words = record["capacity"], book.words
    U, k = stated_U_m3(capacity)[-1], k_of_rows(capacity)[-1]
    factor, symbol = book.paper.volume_factor, book.paper.volume_symbol
    volume_format = number_format(decimals_of(factor * U), unit=symbol)
    top = number_format(decimals_of_height(capacity["height_m"][-1]), unit="m")
    lines = []
    for column, code in enumerate(("volume", "U", "k", "dip_height"), 1):
        text = book.word(f"labels.{code}")
        look = {"align": "right", "text_wrap": True, "font_color": MUTED}
        book.put(sheet, row, column, text, **look)
        lines.append(lines_of(text, _WIDTHS[column]))
    book.set_height(sheet, row, LINE_PT * max(lines))
    line = {"bold": True, "font_size": 12}
    sheet.set_row(row + 1, 20)
    book.put(sheet, row + 1, 0, book.word("labels.top_of_table"), **line)
    k = words["intervals"]["monte_carlo"] if k is None else k
    for column, value, shown in (
        (1, factor * capacity["volume_m3"][-1], volume_format),
        (2, factor * U, f'"± "{volume_format}'),
        (3, k, '"k = "0.00'),
        (4, capacity["height_m"][-1], top),
    ):
        book.put(sheet, row + 1, column, value, num_format=shown, align="right", **line)
    return row + 2


def _draw_corrections(record, book, sheet, row):
    """Write the applied corrections with their sizes; return the next row."""
    words = book.words
    applied = [correction for correction in record["corrections"] if correction["applied"]]
    factor, symbol = book.paper.volume_factor, book.paper.volume_symbol
    decimals = decimals_of(factor * stated_U_m3(record["capacity"])[-1]) + 1
    volume_format = number_format(decimals, unit=symbol)
    for correction in applied:
        book.put(sheet, row, 0, sentence(words, "corrections", correction["code"]))
        book.put(sheet, row, 1, factor * correction["size_m3"], num_format=volume_format)
        book.put(sheet, row, 2, correction["size_percent"], num_format='0.0000 "%"')
        row += 1
    if not applied:
        book.put(sheet, row, 0, sentence(words, "texts", "no_corrections"))
        row += 1
    return row


def _draw_authorisation(record, book, sheet, row):
    """Write lines for the authorising person, signature, place and date; return the next row."""
    line, person = book.format(bottom=1), authorising_person(record["job"]["certificate"])
    for below, key in ((1, "authorised_by"), (3, "signature"), (5, "place_and_date")):
        book.put(sheet, row + below, 0, _label(book.words, key))
        for column in (1, 2):
            sheet.write_blank(row + below, column, None, line)
    if person:
        book.put(sheet, row + 1, 1, person, bottom=1)
    return row + 6
