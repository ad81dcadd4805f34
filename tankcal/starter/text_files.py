"""The starter job as text: job.toml, the CSV files, and the lists of cameras and instruments."""

import csv
import io
import json
import re

from tankcal.job.contract import COLUMNS
from tankcal.starter.notes import REGISTER_NOTES, SECTION_NOTES, TABLE_NOTES
from tankcal.starter.units import is_number


def settings_text(form):
    """job.toml of a Form, every key with its note."""
    tables = [f"{table}.csv" for table in form.tables]
    tables += [f"{register}.toml" for register in form.registers]
    lines = [
        "# A tankcal job. Fill in every line marked FILL IN; leave the others or fill them in.",
        '# "" is a blank. Numbers stand without quotation marks: nominal_diameter_m = 13.0',
        f"# The units stand in the names. Then fill in {', '.join(tables)}",
        "# (each says what it is for, and which may stay empty), and run:",
        "#     tankcal run .",
    ]
    for section, fields in form.keys.items():
        lines += ["", f"# {SECTION_NOTES[section]}", f"[{section}]"]
        for field in fields:
            start = form.start(section, field)
            note = _note(field, form.is_to_fill_in(section, field))
            lines.append(_setting(field, start, note))
    return "\n".join(lines) + "\n"


def register_text(register, form):
    """cameras.toml or instruments.toml of a Form: its entries, or an empty one."""
    lines = [f"# {REGISTER_NOTES[register]}"]
    for name, given in form.entries(register).items():
        lines += ["", f"[{register}.{_key(name)}]"]
        for field in form.fields(register, given):
            start = given.get(field.name, "")
            lines.append(_setting(field, start, _note(field, field.required and not start)))
    return "\n".join(lines) + "\n"


def _setting(field, start, note):
    is_bare = field.kind == "number" and is_number(start)
    value = start if is_bare else json.dumps(start, ensure_ascii=False)
    name = ".".join(map(_key, field.name.split(".")))
    return f"{f'{name} = {value}':<32}{f' # {note}' if note else ''}".rstrip()


def _key(name):
    """A name as a key of TOML."""
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else json.dumps(name, ensure_ascii=False)


def csv_text(table, form):
    """A CSV file of a Form: comments, and the row of headings."""
    lines = [f"# {TABLE_NOTES[table]}; lines that begin with # are comments"]
    for field in COLUMNS[table]:
        required = "" if field.required else " [may be blank]"
        lines.append(f"# {field.name}: {field.note}{required}")
    if table == "uncertainty":
        lines += [_input(name, one) for name, one in form.inputs.items()]
    names = [field.name for field in COLUMNS[table]]
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerows([row.get(name, "") for name in names] for row in form.rows(table))
    return "\n".join([*lines, ",".join(names)]) + "\n" + text.getvalue()


def _note(field, is_to_fill_in):
    choices = f" ({field.expectation()})" if field.kind == "choice" and is_to_fill_in else ""
    return f"{'FILL IN: ' if is_to_fill_in else ''}{field.note}{choices}"


def _input(name, declarable):
    assumed = f"; not declared: {declarable.assumption}" if declarable.assumption else ""
    return f"# {name}: {declarable.note}, {declarable.unit}{assumed}"
