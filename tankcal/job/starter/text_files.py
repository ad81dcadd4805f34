"""The starter job as text: job.toml, the CSV files, and the lists of cameras and instruments."""

import csv
import io
import json
import re

from tankcal.job.contract import COLUMNS
from tankcal.job.starter.texts import texts_in
from tankcal.job.starter.units import is_number
from tankcal.text.words import said


def settings_text(form):
    """job.toml of a Form, every key with its note."""
    texts = texts_in(form.language)
    tables = [f"{table}.csv" for table in form.tables]
    tables += [f"{register}.toml" for register in form.registers]
    values = {"fill_in": texts.of("files", "fill_in"), "tables": ", ".join(tables)}
    lines = [
        f"# {texts.of('files', code, **values)}"
        for code in ("title", "numbers", "units", "each_says")
    ]
    lines.append("#     tankcal run .")
    for section, fields in form.keys.items():
        lines += ["", f"# {texts.note('sections', section)}", f"[{section}]"]
        for field in fields:
            start = form.start(section, field)
            is_to_fill_in = form.is_to_fill_in(section, field)
            note = _note(texts, field, texts.note("keys", section, field), is_to_fill_in)
            lines.append(_setting(field, start, note))
    return "\n".join(lines) + "\n"


def register_text(register, form):
    """cameras.toml or instruments.toml of a Form: its entries, or an empty one."""
    texts = texts_in(form.language)
    lines = [f"# {texts.note('registers', register)}"]
    for name, given in form.entries(register).items():
        lines += ["", f"[{register}.{_key(name)}]"]
        for field in form.fields(register, given):
            start = given.get(field.name, "")
            text = texts.note("entries", register, field) if field.note else ""
            note = _note(texts, field, text, field.required and not start)
            lines.append(_setting(field, start, note))
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
    texts = texts_in(form.language)
    lines = [f"# {texts.note('tables', table)}; {texts.of('files', 'comments')}"]
    for field in COLUMNS[table]:
        blank = "" if field.required else f" [{texts.of('files', 'may_be_blank')}]"
        lines.append(f"# {field.name}: {texts.note('columns', table, field)}{blank}")
    if table == "uncertainty":
        lines += [_input(texts, name, one) for name, one in form.inputs.items()]
    names = [field.name for field in COLUMNS[table]]
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerows([row.get(name, "") for name in names] for row in form.rows(table))
    return "\n".join([*lines, ",".join(names)]) + "\n" + text.getvalue()


def _note(texts, field, text, is_to_fill_in):
    """A note with, where something must be filled in, that word and what may be chosen."""
    if not is_to_fill_in:
        return text
    choices = f" ({said(texts.words, field.expectation())})" if field.kind == "choice" else ""
    return f"{texts.of('files', 'fill_in')}: {text}{choices}"


def _input(texts, name, declarable):
    assumed = texts.assumption(declarable)
    ending = f"; {texts.of('files', 'not_declared', assumed=assumed)}" if assumed else ""
    return f"# {name}: {texts.input_note(name, declarable)}, {declarable.unit}{ending}"
