"""What stands in a cell as a person of a language reads and types it, and as the file has it.

A number is shown with the decimal mark of the language. The other mark is never taken for it in
silence: 1.234 is one thousand and more to one reader, and little more than one to another.
"""

from tankcal.job.fields import Field
from tankcal.text.numerals import NUMBER

LISTS = ("numbers", "ranges", "rows")  # several numbers in one cell; their texts have points


class Unwritten(str):
    """An entry that may be read in two ways: it is shown, told, and never written to the file."""


def shown_text(field: Field | None, text: str, in_file: str, in_language: str) -> str:
    """A cell of the file as the grid shows it.

    Parameters
    ----------
    field : Field or None
        What the column takes; None: a column that is not known.
    text : str
        As the file has it.
    in_file, in_language : str
        The decimal marks of the file and of the reader.

    Examples
    --------
    >>> shown_text(Field("z_m", "number", ""), "10.950", ".", ",")
    '10,950'
    """
    if isinstance(text, Unwritten) or field is None or not text:
        return str(text)
    if field.kind in LISTS:
        return text.replace(".", in_language)
    if field.kind != "number" or in_file == in_language:
        return text
    is_number = NUMBER.fullmatch(text.replace(in_file, "."))
    return text.replace(in_file, in_language) if is_number else text


def entered_text(field: Field | None, text: str, in_file: str, in_language: str) -> str:
    """What a person typed as the file is to have it; `Unwritten` where it could be two numbers.

    Parameters are those of `shown_text`.

    Examples
    --------
    >>> column = Field("z_m", "number", "")
    >>> entered_text(column, " 10,950 ", ".", ",")
    '10.950'
    >>> type(entered_text(column, "1.234", ".", ",")).__name__
    'Unwritten'
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
        return Unwritten(text)
    plain = text.replace(in_language, in_file)
    if field.kind in LISTS:
        return plain
    return plain if NUMBER.fullmatch(plain.replace(in_file, ".")) else text
