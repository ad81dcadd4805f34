"""Explanations of keys and columns: in an input workbook, and in docs/job-format.md.

The English notes of keys and columns are in the contract. The word files of the other languages
contain their translations.

In docs/job-format.md, the heading above a table names its sections and files: `### [datum]`,
`### points.csv`. The contract gives the first column (names, bold if required) and the last column
(accepted values). The text between them is kept. A new key or column gets a row with its note; the
row of a key or column that no longer exists is removed.

    python -m tankcal.job.starter.texts docs/job-format.md
"""

import math
import re
import sys
from dataclasses import dataclass
from pathlib import Path

from tankcal.job.contract import COLUMNS, KEYS, REGISTER_KEYS
from tankcal.job.fields import MAX_TEXT
from tankcal.methods.base import methods
from tankcal.text.digits import shortest
from tankcal.text.naming import MAX_NAME, NUMBER, split_unit
from tankcal.text.shipped import DEFAULT
from tankcal.text.words import load_words, marks_of, word_of


def is_number(text):
    """Return True if TOML and spreadsheets read the text as a number."""
    return NUMBER.fullmatch(text) is not None


# Purpose of each section, table and list of a starter job, in English.

SECTION_NOTES = {
    "tank": "the tank, as in the drawing; the texts are printed when given",
    "survey": "how and when the tank was surveyed",
    "datum": "heights, in the frame of the points",
    "table": "what the capacity table is to be; dips count from the table's zero",
    "horizontal": "the cylinder and its ends; sizes as measured, inside or outside (survey.side)",
    "sphere": "the sphere; its size as measured, inside or outside (survey.side)",
    "mesh": "the closed surface of the inside",
    "ship": "only of a tank of a ship: trims, lists and the sounding pipe; all of it, or nothing",
    "bottom": "what the bottom is like; see bottom.csv, too",
    "top": "the head on top, which liquid may rise into; blank: the table ends with the shell",
    "roof": "the floating roof: all of it, or nothing when there is none",
    "levels": "operating levels, whose volumes are stated on the certificate; may stay empty",
    "corrections": "false switches a correction off, and the report says so",
    "material": "the shell's steel",
    "checks": "only compared, to tell a slip of the hand: nothing here changes a number",
    "inspection": "only for tankcal inspect: no capacity depends on it",
    "adjustment": "how bad points are treated, and what holds the frame of a survey",
    "adjustment.camera": "what of the cameras is adjusted: off, camera free, camera weighted,"
    " camera fixed, or the same with block or photo in place of camera",
    "certificate": "printed when given, never invented",
    "csv": "how the CSV files are written; ; and , for a spreadsheet that uses decimal commas",
}
TABLE_NOTES = {
    "courses": "one row for each course (ring of plates), from the bottom up",
    "welds": "one row for each vertical weld of a course whose azimuth is known; may stay empty",
    "bottom": "one row for each surveyed point of the bottom (x_m, y_m, z_m), or for each level"
    " measured with liquid (level_m, volume_m3); leave it empty for other bottoms",
    "deadwood": "one row for each thing in the tank that takes or gives room; may stay empty",
    "uncertainty": "one row for each uncertainty that the points do not carry themselves",
    "correlations": "one row for each pair of inputs of uncertainty that are correlated; may stay"
    " empty",
    "stated": "one row for each dip, or pair of dips, whose volume is to be reported with its"
    " budget; may stay empty",
    "overrulings": "one row for each point or reading that was decided by hand against the search"
    " for blunders; may stay empty",
    "targets": "one row for each target of the wall; may stay empty: the wall is then searched",
    "photos": "one row for each photo; orientations may stay blank, they are found",
    "image_points": "one row for each image of a point; a repeated row is a repeated reading",
    "control": "one row for each point that is known beforehand",
    "check": "one row for each known point that is only compared; may stay empty",
    "setups": "one row for each set-up of an instrument over a station",
    "distances": "one row for each distance read with a tape or between two points; may stay empty",
    "slope_distances": "one row for each distance measured from a set-up",
    "directions": "one row for each direction read on the horizontal circle",
    "zenith_angles": "one row for each zenith angle, of both faces the mean",
    "height_differences": "one row for each levelled difference; may stay empty",
    "plumb_lines": "one row for each pair of points on one vertical line; may stay empty",
    "vectors": "one row for each vector between two points (GNSS); may stay empty",
    "correlated_readings": "one row for each pair of values that are correlated; may stay empty",
    "stadia": "one row for each reading of a stadia bar from a set-up; may stay empty",
}
for _method in methods():
    SECTION_NOTES |= _method.section_notes
    TABLE_NOTES |= _method.table_notes
REGISTER_NOTES = {
    "cameras": "one section for each camera; put its name, as in photos.csv, in place of NAME",
    "instruments": "one section for each instrument; put its name in place of NAME; may stay empty",
    "clouds": "one section for each file of a scanner; put a name of your own in place of NAME",
    "meters": "one section for each meter; put its name, as in liquid.csv, in place of NAME",
    "equipment": "one section for each piece of equipment; put its name in place of NAME",
    "seals": "one section for each seal of the tank; put its name in place of NAME",
}


def english_notes():
    """{group: {name: note}}, with the keys of `[input.notes]` of other languages."""
    return {
        "sections": SECTION_NOTES,
        "tables": TABLE_NOTES,
        "registers": REGISTER_NOTES,
        "keys": _notes_of_fields(KEYS),
        "columns": _notes_of_fields({name: COLUMNS[name] for name in TABLE_NOTES}),
        "entries": _notes_of_fields(REGISTER_KEYS),
    }


def _notes_of_fields(owners):
    return {
        f"{owner}.{field.name}": field.note for owner, fields in owners.items() for field in fields
    }


@dataclass(frozen=True)
class Texts:
    """Words and notes of one language."""

    words: dict
    notes: dict

    def of(self, group, code, **values):
        """Text of the group input.`group`, with its values inserted."""
        return self.words["input"][group][code].format(**values)

    def note(self, group, owner, field=None):
        """Purpose of a section, table or list (field: None), or note of one of its fields."""
        return self.notes[group][owner if field is None else f"{owner}.{field.name}"]

    def heading(self, field):
        """Short heading of a column."""
        stem, _ = split_unit(field.name)
        return self.words["input"]["labels"][stem]

    def expectation(self, field):
        """Accepted values of a cell: "a number above 0, at most 50 (m)"."""
        most = {"name": MAX_NAME, "tank id": MAX_NAME, "text": MAX_TEXT}.get(field.kind)
        if field.kind != "number":
            code = field.kind.replace(" ", "_")
            return self.of("expected", code, most=most, unit=_unit_in_brackets(field))
        low, high = (self._number(bound) for bound in (field.low, field.high))
        return self.of(
            "expected", _bounds(field), low=low, high=high, unit=_unit_in_brackets(field)
        ) + (self.of("expected", "or_word", word=", ".join(field.choices)) if field.choices else "")

    def choice(self, word):
        """A choice, "true" or "false" in the words of the form."""
        return word_of(self.words["language"]["code"], word)

    def value(self, field, given):
        """Initial value of a cell; choices are in the words of the form."""
        return self.choice(given) if field.kind in ("choice", "flag") else given

    def example(self, field, given):
        """Example of a field in the words of the form."""
        known = self.words["input"]["examples"]
        return known.get(given, self.value(field, given)) if isinstance(given, str) else given

    def input_note(self, name, declarable):
        """Meaning of an input of uncertainty."""
        if self.words["language"]["code"] == DEFAULT:
            return declarable.note
        return self.words["inputs"]["deadwood_share" if name == "deadwood" else name]

    def assumption(self, declarable):
        """Assumed value of an input that is not declared; "" if none."""
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
    """Code of the sentence that states the bounds of a number."""
    if is_wide(field):
        return "number"
    if field.high == float("inf"):
        return "above" if field.above_low else "at_least"
    return "above_at_most" if field.above_low else "from_to"


def is_wide(field):
    """Return True if the bounds only exclude absurd values."""
    return field.low == -field.high and field.high >= 1e5


def _unit_in_brackets(field):
    _, unit = split_unit(field.name)
    return f" ({unit})" if unit else ""


LAST = "values"
MANY = 6  # a field with more choices lists them in the text of the page
_OWNER = re.compile(r"\[([a-z.]+)\]|(\w+)\.(?:csv|toml)")
_NAME = re.compile(r"(?:\*\*)?`([^`]+)`(?:\*\*)?")
_HEAD = re.compile(r"\| (key|column) \| what it is \|")
_OF_KIND = {
    "tank id": "text",
    "text": "text",
    "name": "name",
    "names": "names",
    "dms": "angle",
    "flag": "`true`, `false`",
    "date": "date",
    "time": "date and time",
    "mesh file": "file",
    "cloud file": "file",
    "rule name": "rule",
    "ranges": "pairs of numbers",
}


def filled_page(text):
    """Page with updated tables of keys and columns.

    Parameters
    ----------
    text : str
        Content of docs/job-format.md.

    Returns
    -------
    str
        Updated content; equal to `text` if the page is up to date.
    """
    lines, owners, table = [], {}, None
    for line in [*text.split("\n"), ""]:
        if line.startswith("#"):
            owners = _fields_beneath(line)
        if table is None and owners and _HEAD.match(line):
            table = []
        if table is not None and line.startswith("|"):
            table.append(line)
            continue
        if table:
            lines += _filled_table(table, owners)
            table, owners = None, {}
        lines.append(line)
    return "\n".join(lines[:-1])


def values_of(field):
    """Accepted values of a key or a column: bounds, words or kind."""
    if field.kind in ("number", "numbers"):
        words = [_bounds_of_page(field), *(f"`{choice}`" for choice in field.choices)]
        return " or ".join(word for word in words if word) or field.kind
    if field.kind == "rows":
        words = [f"rows of {field.width} numbers", *(f"`{choice}`" for choice in field.choices)]
        return " or ".join(words)
    if field.kind == "choice":
        if len(field.choices) > MANY:
            return "one of those named"
        return ", ".join(f"`{choice}`" for choice in field.choices).replace("\t", r"\t")
    return _OF_KIND[field.kind]


def _bounds_of_page(field):
    low, high = (f"{bound:g}".replace("e+0", "e") for bound in (field.low, field.high))
    if field.above_low:
        return f"above {low}" + ("" if math.isinf(field.high) else f", at most {high}")
    if math.isinf(field.high):
        return "" if math.isinf(field.low) else f"at least {low}"
    return f"{low} to {high}"


def _fields_beneath(heading):
    """{name: fields} of the sections and files in a heading, in their order."""
    fields = {}
    for section, file in _OWNER.findall(heading):
        known = KEYS.get(section) or COLUMNS.get(file) or REGISTER_KEYS.get(file, ())
        for field in known:
            fields.setdefault(field.name, []).append(field)
    return fields


def _filled_table(table, fields):
    head = " | ".join(table[0].strip("| ").split(" | ")[:2])
    rows = [cells for line in table[2:] if (cells := _filled_row(line, fields))]
    names_of_rows = [set(_NAME.findall(row[0])) for row in rows]
    previous = None
    for name, known in fields.items():
        if not any(name in names for names in names_of_rows):
            at = next((k + 1 for k, names in enumerate(names_of_rows) if previous in names), 0)
            note = known[0].note
            rows.insert(at, (_key_text(name, fields), note, _values_of_all([name], fields)))
            names_of_rows.insert(at, {name})
        previous = name
    return [f"| {head} | {LAST} |", "| --- | --- | --- |", *(f"| {' | '.join(r)} |" for r in rows)]


def _filled_row(line, fields):
    """Three cells of a row; None if the contract has none of its names."""
    first, prose = (cell.strip() for cell in line[1:].split("|")[:2])
    names = [name for name in _NAME.findall(first) if name in fields]
    for obsolete in set(_NAME.findall(first)) - set(names):
        first = re.sub(rf"(?:, )?(?:\*\*)?`{re.escape(obsolete)}`(?:\*\*)?", "", first).strip(", ")
    shown = _NAME.sub(lambda match: _key_text(match[1], fields), first)
    return (shown, prose, _values_of_all(names, fields)) if names else None


def _key_text(name, fields):
    return f"**`{name}`**" if all(field.required for field in fields[name]) else f"`{name}`"


def _values_of_all(names, fields):
    values = dict.fromkeys(values_of(field) for name in names for field in fields[name])
    return "; ".join(values)


if __name__ == "__main__":
    page = Path(sys.argv[1])
    page.write_text(filled_page(page.read_text(encoding="utf-8")), encoding="utf-8")
