"""Validation rule of the cells of one field in a spreadsheet, with its error message."""

import datetime
import math

from tankcal.job.fields import MAX_TEXT
from tankcal.job.starter.texts import is_wide
from tankcal.text.form_words import NO, YES
from tankcal.text.naming import MAX_NAME

LONGEST_LIST = 255  # longest list of choices in Excel, characters
LONGEST_TITLE, LONGEST_MESSAGE = 32, 255  # longest title and message in Excel, characters
_LENGTHS = {
    "name": MAX_NAME,
    "tank id": MAX_NAME,
    "text": MAX_TEXT,
    "rule name": MAX_NAME,
    "mesh file": MAX_NAME,
}
FIRST_DAY, LAST_DAY = datetime.date(1950, 1, 1), datetime.date(2119, 1, 1)


def rule_of(field, choices, cell, texts):
    """Options of XlsxWriter's data_validation; None if the field accepts any text.

    Parameters
    ----------
    field : Field
        Description of the cells.
    choices : sequence of str
        Choices that replace those of the field.
    cell : str
        First cell of the range, such as "C7".
    texts : Texts
        Texts of the language.

    Returns
    -------
    dict or None
    """
    condition = _condition(field, choices, cell, texts)
    if condition is None:
        return None
    return condition | {
        "ignore_blank": True,
        "error_type": "stop",
        "error_title": texts.of("expected", "title")[:LONGEST_TITLE],
        "error_message": texts.expectation(field)[:LONGEST_MESSAGE],
    }


def _condition(field, choices, cell, texts):
    if field.kind == "flag":
        return {"validate": "list", "source": [texts.choice(YES), texts.choice(NO)]}
    if field.kind == "choice":
        listed = [texts.choice(choice) for choice in choices]
        return (
            {"validate": "list", "source": listed}
            if (len(",".join(listed)) <= LONGEST_LIST)
            else None
        )
    if field.kind == "number":
        return _of_number(field, cell)
    if field.kind == "date":
        return {
            "validate": "date",
            "criteria": "between",
            "minimum": FIRST_DAY,
            "maximum": LAST_DAY,
        }
    if field.kind in _LENGTHS:
        return {"validate": "length", "criteria": "<=", "value": _LENGTHS[field.kind]}
    return None


def _of_number(field, cell):
    bounds = {"validate": "decimal", "criteria": "between"}
    if is_wide(field) or (not field.above_low and not field.choices and field.high < math.inf):
        return bounds | {"minimum": field.low, "maximum": field.high}
    parts = [f"ISNUMBER({cell})", f"{cell}{'>' if field.above_low else '>='}{field.low!r}"]
    if field.high < math.inf:
        parts.append(f"{cell}<={field.high!r}")
    formula = f"AND({','.join(parts)})"
    if field.choices:
        words = ",".join(f'{cell}="{word}"' for word in field.choices)
        formula = f"OR({words},IF(ISNUMBER({cell}),{formula},FALSE))"
    return {"validate": "custom", "value": f"={formula}"}
