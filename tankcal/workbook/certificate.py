"""The sheet Certificate: what was calibrated, the main result, and what was assumed."""

from tankcal.uncertainty import decimals_for, height_decimals
from tankcal.words import choice_sentence, method_line, sentence
from tankcal.workbook.book import ACCENT, MUTED, number_format

_WIDTHS = (36, 20, 24, 14, 14)


def certificate_sheet(book, record, words):
    """Write the sheet, which is the one the workbook opens on."""
    sheet = book.sheet("Certificate", sentence(words, "titles", "certificate"))
    sheet.fit_to_pages(1, 1)
    book.widths(sheet, *_WIDTHS)
    row = 3
    if book.notice:
        look = {"bold": True, "font_size": 14, "align": "center", "border": 2}
        book.paragraph(sheet, row, book.notice, _WIDTHS, border_color=ACCENT, **look)
        sheet.set_row(row, 26)
        row += 2
    row = _result(book, sheet, row, record, words)
    row = _entries(book, sheet, row, sentence(words, "headings", "tank"), _tank(record, words))
    row = _entries(book, sheet, row, "Certificate", _certificate(record, words))
    row = _entries(book, sheet, row, "Survey and table", _survey(record, words))
    row = _corrections(book, sheet, row, record, words)
    row = _choices(book, sheet, row, record, words)
    _authorisation(book, sheet, row, words)
    sheet.activate()


def _label(words, key):
    """The label of a key of the job; one without words is written out: vessel_no as Vessel no."""
    return words["labels"].get(key, key.replace("_", " ").capitalize())


def _tank(record, words):
    """(label, value, number format or None) of the tank."""
    tank = record["job"]["tank"]
    return [
        (_label(words, "tank_id"), tank["id"], None),
        (_label(words, "kind"), sentence(words, "kinds", tank["kind"]), None),
        *((_label(words, key), value, None) for key, value in tank["details"].items()),
        *(
            (_label(words, key), tank[f"{key}_{unit}"], shown)
            for key, unit, shown in (
                ("nominal_diameter", "m", '0.000 "m"'),
                ("nominal_height", "m", '0.000 "m"'),
                ("nominal_volume", "m3", '0.000 "m³"'),
            )
            if tank[f"{key}_{unit}"] is not None
        ),
    ]


def _certificate(record, words):
    """(label, value, None) of what the job says about its certificate, and nothing else."""
    labels = {"number": sentence(words, "page", "number")}
    return [
        (labels.get(key) or _label(words, key), value, None)
        for key, value in record["job"]["certificate"].items()
        if key != "notice"  # that one stands at the top
    ]


def _survey(record, words):
    """(label, value, number format or None) of the survey and of what the table refers to."""
    job = record["job"]
    survey, table, adjustment = job["survey"], job["table"], record["adjustment"]
    lines = (
        ("survey_date", survey["date"], None),
        ("survey_method", adjustment and method_line(words, adjustment), None),
        ("survey_side", sentence(words, "sides", survey["side"]), None),
        ("shell_temperature", survey["shell_temperature_c"], '0.0 "°C"'),
        ("reference_temperature", table["reference_temperature_c"], '0.0 "°C"'),
        ("zero", sentence(words, "zeros", record["capacity"]["zero"]), None),
        ("reference_height", job["datum"]["reference_height_m"], '0.000 "m"'),
    )
    return [(_label(words, key), value, shown) for key, value, shown in lines if value is not None]


def _entries(book, sheet, row, title, lines):
    """A heading and a line for each (label, value, number format); returns the next row."""
    if not lines:
        return row
    book.heading(sheet, row, title, len(_WIDTHS))
    for label, value, shown in lines:
        row += 1
        book.put(sheet, row, 0, label)
        book.put(sheet, row, 1, value, align="left", **({"num_format": shown} if shown else {}))
    return row + 2


def _result(book, sheet, row, record, words):
    """The capacity at the top of the table with U and k on its line; returns the next row."""
    capacity = record["capacity"]
    cubic = number_format(decimals_for(capacity["U_m3"][-1]))
    top = number_format(height_decimals(capacity["height_m"][-1]))
    book.heading(sheet, row, sentence(words, "headings", "result"), len(_WIDTHS))
    heads = ("", "Volume", "Expanded uncertainty U", "Factor k", "Dip height")
    for column, text in enumerate(heads):
        book.put(sheet, row + 1, column, text, align="right", font_color=MUTED)
    line = {"bold": True, "font_size": 12}
    sheet.set_row(row + 2, 20)
    book.put(sheet, row + 2, 0, "Capacity at the top of the table", **line)
    for column, key, shown in (
        (1, "volume_m3", f'{cubic} "m³"'),
        (2, "U_m3", f'"± "{cubic} "m³"'),
        (3, "k", '"k = "0.00'),
        (4, "height_m", f'{top} "m"'),
    ):
        book.put(sheet, row + 2, column, capacity[key][-1], num_format=shown, **line)
    probability = record["job"]["table"]["coverage_probability"]
    text = (
        "The expanded uncertainty is U = k · u, where u is the standard uncertainty and k gives a "
        f"coverage probability of {probability:.4g}. Every row of the sheet Capacity has its own."
    )
    book.paragraph(sheet, row + 3, text, _WIDTHS)
    return row + 5


def _corrections(book, sheet, row, record, words):
    """The corrections that were applied, with their sizes; returns the next row."""
    book.heading(sheet, row, sentence(words, "headings", "corrections"), len(_WIDTHS))
    applied = [correction for correction in record["corrections"] if correction["applied"]]
    cubic = number_format(decimals_for(record["capacity"]["U_m3"][-1]) + 1)
    for correction in applied:
        row += 1
        book.put(sheet, row, 0, sentence(words, "corrections", correction["code"]))
        book.put(sheet, row, 1, correction["size_m3"], num_format=f'{cubic} "m³"')
        book.put(sheet, row, 2, correction["size_percent"], num_format='0.0000 "%"')
    if not applied:
        row += 1
        book.put(sheet, row, 0, sentence(words, "texts", "no_corrections"))
    return row + 2


def _choices(book, sheet, row, record, words):
    """What was assumed, a sentence each; returns the next row."""
    book.heading(sheet, row, sentence(words, "headings", "choices"), len(_WIDTHS))
    for choice in record["choices"]:
        row += 1
        text = choice_sentence(words, choice)
        book.paragraph(sheet, row, text, _WIDTHS)
    return row + 2


def _authorisation(book, sheet, row, words):
    """Lines that are left empty, for a person to fill in and sign."""
    book.heading(sheet, row, sentence(words, "headings", "authorisation"), len(_WIDTHS))
    line = book.format(bottom=1)
    for below, key in ((2, "authorised_by"), (4, "signature"), (6, "place_and_date")):
        book.put(sheet, row + below, 0, _label(words, key))
        for column in (1, 2):
            sheet.write_blank(row + below, column, None, line)
