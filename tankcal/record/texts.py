"""Texts and problems, with the codes and values of their translation."""

from tankcal.messages import as_plain
from tankcal.record.schema import Saved, fill_from, key


class Text(Saved):
    """A text in English, with its code and the values in it."""

    text: str = key("in English")
    code: str | None = key("of its translation; null: none")
    values: dict = key("of the placeholders: numbers, texts, lists of these, and texts with a code")


class WarningRecord(Saved):
    """A problem that did not stop the job."""

    file: str = key("name")
    row: int | None = key("of the file")
    column: str | None = key("of the file, or key")
    text: str = key("in English")
    code: str | None = key("of its translation; null: none")
    values: dict = key("of the placeholders: numbers, texts, lists of these, and texts with a code")


def text_of(message):
    """Return the `Text` of a Message or of any text."""
    return Text(str(message), **as_plain(message))


def warnings_of(problems):
    """Return the `WarningRecord` of each `errors.Problem`."""
    return [
        fill_from(WarningRecord, problem, text=str(problem.expected), **as_plain(problem.expected))
        for problem in problems
    ]
