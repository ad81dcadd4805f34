"""Update of the tables of keys and columns in docs/job-format.md from the contract.

The heading above a table names its sections and files: `### [datum]`, `### points.csv`. The
contract gives the first column (names, bold if required) and the last column (accepted values). The
text between them is kept. A new key or column gets a row with its note; the row of a key or column
that no longer exists is removed.

    python -m tankcal.job.starter.page docs/job-format.md
"""

import math
import re
import sys
from pathlib import Path

from tankcal.job.contract import COLUMNS, KEYS, REGISTER_KEYS

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
        words = [_bounds(field), *(f"`{choice}`" for choice in field.choices)]
        return " or ".join(word for word in words if word) or field.kind
    if field.kind == "rows":
        words = [f"rows of {field.width} numbers", *(f"`{choice}`" for choice in field.choices)]
        return " or ".join(words)
    if field.kind == "choice":
        if len(field.choices) > MANY:
            return "one of those named"
        return ", ".join(f"`{choice}`" for choice in field.choices).replace("\t", r"\t")
    return _OF_KIND[field.kind]


def _bounds(field):
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
