"""Texts with the code and the values that say them in another language, and problems."""

from tankcal.messages import as_plain
from tankcal.record.schema import Saved, fill_from, key


class Text(Saved):
    """A text in English, with its code and the values in it."""

    text: str = key("in English")
    code: str | None = key("its name in the words of other languages; null: it has none")
    values: dict = key("numbers, texts, lists of these, and texts within the text")


class WarningRecord(Saved):
    """What did not stop the job but should be read."""

    file: str = key("name")
    row: int | None = key("of the file")
    column: str | None = key("or key")
    text: str = key("in English")
    code: str | None = key("its name in the words of other languages; null: it has none")
    values: dict = key("numbers, texts, lists of these, and texts within the text")


def text_of(message):
    """The `Text` of a Message, or of any text."""
    return Text(str(message), **as_plain(message))


def warnings_of(problems):
    """The `WarningRecord` of each `errors.Problem`."""
    return [
        fill_from(WarningRecord, one, text=str(one.expected), **as_plain(one.expected))
        for one in problems
    ]
