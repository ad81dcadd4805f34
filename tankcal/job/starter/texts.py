"""The explanations of an input workbook, in one language.

The notes of keys and columns are written once, in English, beside the contract; the words of each
other language hold theirs.
"""

from dataclasses import dataclass

from tankcal.job.contract import COLUMNS, KEYS, REGISTER_KEYS
from tankcal.job.fields import MAX_NAME, MAX_TEXT
from tankcal.job.starter.notes import REGISTER_NOTES, SECTION_NOTES, TABLE_NOTES
from tankcal.job.starter.units import parted
from tankcal.text.digits import shortest
from tankcal.text.form_words import word_of
from tankcal.text.languages import DEFAULT
from tankcal.text.words import load_words, marks_of


def english_notes():
    """{group: {name: note}} as `[input.notes]` of another language has them, key by key."""
    return {
        "sections": SECTION_NOTES,
        "tables": TABLE_NOTES,
        "registers": REGISTER_NOTES,
        "keys": _of_fields(KEYS),
        "columns": _of_fields({name: COLUMNS[name] for name in TABLE_NOTES}),
        "entries": _of_fields(REGISTER_KEYS),
    }


def _of_fields(owners):
    return {
        f"{owner}.{field.name}": field.note for owner, fields in owners.items() for field in fields
    }


@dataclass(frozen=True)
class Texts:
    """Words of a language, and the notes in it."""

    words: dict
    notes: dict

    def of(self, group, code, **values):
        """A text of the group input.`group`, its places filled in."""
        return self.words["input"][group][code].format(**values)

    def note(self, group, owner, field=None):
        """What a section, table or list is for (field: None), or one of its keys or columns."""
        return self.notes[group][owner if field is None else f"{owner}.{field.name}"]

    def heading(self, field):
        """Short heading of a column."""
        stem, _ = parted(field.name)
        return self.words["input"]["labels"][stem]

    def expectation(self, field):
        """What a cell takes: "a number above 0, at most 50 (m)"."""
        most = {"name": MAX_NAME, "tank id": MAX_NAME, "text": MAX_TEXT}.get(field.kind)
        if field.kind != "number":
            code = field.kind.replace(" ", "_")
            return self.of("expected", code, most=most, unit=_bracketed(field))
        low, high = (self._number(bound) for bound in (field.low, field.high))
        return self.of("expected", _bounds(field), low=low, high=high, unit=_bracketed(field)) + (
            self.of("expected", "or_word", word=", ".join(field.choices)) if field.choices else ""
        )

    def choice(self, word):
        """One of the choices, "true" or "false" as the form offers it."""
        return word_of(self.words["language"]["code"], word)

    def value(self, field, given):
        """What stands in a cell of a field: its choices in the words of the form."""
        return self.choice(given) if field.kind in ("choice", "flag") else given

    def input_note(self, name, declarable):
        """What an input of uncertainty is."""
        if self.words["language"]["code"] == DEFAULT:
            return declarable.note
        return self.words["inputs"]["deadwood_share" if name == "deadwood" else name]

    def assumption(self, declarable):
        """What is assumed for an input that is not declared; "" for nothing."""
        if declarable.default_share is not None:
            return self.of("inputs", "share", share=self._number(100 * declarable.default_share))
        if declarable.default is None:
            return ""
        return f"± {self._number(declarable.default)} {declarable.unit}"

    def _number(self, value):
        return shortest(value, marks_of(self.words))


def texts_in(language):
    """Texts of one language."""
    words = load_words(language)
    notes = english_notes() if language == DEFAULT else words["input"]["notes"]
    return Texts(words, notes)


def _bounds(field):
    """Which sentence says the bounds of a number."""
    if is_wide(field):
        return "number"
    if field.high == float("inf"):
        return "above" if field.above_low else "at_least"
    return "above_at_most" if field.above_low else "from_to"


def is_wide(field):
    """Do the bounds only keep nonsense out?"""
    return field.low == -field.high and field.high >= 1e5


def _bracketed(field):
    _, unit = parted(field.name)
    return f" ({unit})" if unit else ""
