"""Conversion of the text of a cell between the decimal mark of the file and of the language.

A number is shown with the decimal mark of the language. The other mark is never accepted silently:
1.234 is more than one thousand in some languages, and little more than one in others.
"""

from tankcal.job.fields import Field
from tankcal.text.numerals import NUMBER

LISTS = ("numbers", "ranges", "rows")  # kinds with several numbers in a cell, with decimal points


class AmbiguousNumber(str):
    """An ambiguous number, which is shown and reported, but not written to the file."""


def text_for_display(field: Field | None, text: str, in_file: str, in_language: str) -> str:
    """Convert the text of a cell in the file to the text in the grid.

    Parameters
    ----------
    field : Field or None
        Field of the column; None for an unknown column.
    text : str
        Text in the file.
    in_file, in_language : str
        Decimal marks of the file and of the language.

    Returns
    -------
    str

    Examples
    --------
    >>> text_for_display(Field("z_m", "number", ""), "10.950", ".", ",")
    '10,950'
    """
    if isinstance(text, AmbiguousNumber) or field is None or not text:
        return str(text)
    if field.kind in LISTS:
        return text.replace(".", in_language)
    if field.kind != "number" or in_file == in_language:
        return text
    is_number = NUMBER.fullmatch(text.replace(in_file, "."))
    return text.replace(in_file, in_language) if is_number else text


def text_for_file(field: Field | None, text: str, in_file: str, in_language: str) -> str:
    """Convert an entered text to the text in the file.

    Parameters
    ----------
    field : Field or None
        Field of the column; None for an unknown column.
    text : str
        Entered text.
    in_file, in_language : str
        Decimal marks of the file and of the language.

    Returns
    -------
    str
        An `AmbiguousNumber` if the text is ambiguous.

    Examples
    --------
    >>> column = Field("z_m", "number", "")
    >>> text_for_file(column, " 10,950 ", ".", ",")
    '10.950'
    >>> type(text_for_file(column, "1.234", ".", ",")).__name__
    'AmbiguousNumber'
    """
    text = " ".join(text.replace("\N{NO-BREAK SPACE}", " ").split())
    if field is None:
        return text
    if field.kind in LISTS:
        in_file = "."
    elif field.kind != "number":
        return text
    if in_file == in_language:
        return text
    if in_file in text and NUMBER.fullmatch(text.replace(in_file, ".").split(";")[0].strip()):
        return AmbiguousNumber(text)
    plain = text.replace(in_language, in_file)
    if field.kind in LISTS:
        return plain
    return plain if NUMBER.fullmatch(plain.replace(in_file, ".")) else text
