"""Where a starter job goes: a new folder, or one workbook that did not exist."""

import csv
import dataclasses
import io
import json
import re
from pathlib import Path

from tankcal.errors import InputError, Problem, reason_of
from tankcal.job.contract import columns_of
from tankcal.job.starter.book import write_book
from tankcal.job.starter.form import Form
from tankcal.job.starter.texts import is_number, texts_in
from tankcal.job.tables import SETTINGS_FILE
from tankcal.messages import message
from tankcal.text.languages import DEFAULT
from tankcal.text.words import say

# A starter job that has something in it already: what a plan knows before the survey.


@dataclasses.dataclass(frozen=True)
class FilledForm(Form):
    """A Form with settings, rows and entries, all as texts.

    settings  {"tank.id": text}
    given     {table: ({column: text}, ...)}
    registered  {"cameras" or "instruments": {name: {key: text}}}
    to_fill   keys such as "survey.date" that have to be filled in, beside those that always have
    more      tables beside those of the kind of survey
    """

    settings: dict = dataclasses.field(default_factory=dict)
    given: dict = dataclasses.field(default_factory=dict)
    registered: dict = dataclasses.field(default_factory=dict)
    to_fill: tuple = ()
    more: tuple = ()

    @property
    def tables(self):
        """Names of its tables."""
        usual = super().tables
        return (*usual, *(table for table in self.more if table not in usual))

    @property
    def registers(self):
        """Names of its lists of cameras and instruments."""
        usual = super().registers
        return (*usual, *(name for name in self.registered if name not in usual))

    def start(self, section, field):
        """What stands in the place of a key; "" for nothing."""
        return self.settings.get(f"{section}.{field.name}", super().start(section, field))

    def is_to_fill_in(self, section, field):
        """Is it a key that must be given, and has nothing yet?"""
        if self.start(section, field):
            return False
        return f"{section}.{field.name}" in self.to_fill or super().is_to_fill_in(section, field)

    def entries(self, register):
        """{name: {key: text}} of a list; an empty entry where there is none."""
        return self.registered.get(register) or super().entries(register)

    def rows(self, table):
        """The rows of a table."""
        return self.given.get(table, ())

    def _has(self, section, field):
        is_given = f"{section}.{field.name}" in self.settings and field.suits(self.kind)
        return is_given or super()._has(section, field)


# The starter job as text: job.toml, the CSV files, and the lists of cameras and instruments.


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
    fields = columns_of(table, form.kind)
    for field in fields:
        blank = "" if field.required else f" [{texts.of('files', 'may_be_blank')}]"
        lines.append(f"# {field.name}: {texts.note('columns', table, field)}{blank}")
    if table == "uncertainty":
        lines += [_input(texts, name, one) for name, one in form.inputs.items()]
    names = [field.name for field in fields]
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerows([row.get(name, "") for name in names] for row in form.rows(table))
    return "\n".join([*lines, ",".join(names)]) + "\n" + text.getvalue()


def _note(texts, field, text, is_to_fill_in):
    """A note with, where something must be filled in, that word and what may be chosen."""
    if not is_to_fill_in:
        return text
    choices = f" ({say(texts.words, field.expectation())})" if field.kind == "choice" else ""
    return f"{texts.of('files', 'fill_in')}: {text}{choices}"


def _input(texts, name, declarable):
    assumed = texts.assumption(declarable)
    ending = f"; {texts.of('files', 'not_declared', assumed=assumed)}" if assumed else ""
    return f"# {name}: {texts.input_note(name, declarable)}, {declarable.unit}{ending}"


WORKBOOK_FILE = "job.xlsx"


def write_starter(directory, kind="vertical", survey=None, language=DEFAULT):
    """Write the starter job of a kind of tank into `directory`, made when it does not exist.

    kind      "vertical", "horizontal", "sphere" or "mesh"; only what it can use is written
    survey    "photos" or "total-station": its files in place of the points; None: points
    language  of the papers that the job asks for, and of the workbook's explanations

    Raises InputError when the directory holds something already or cannot be written, ValueError
    for another kind, another survey, or a survey of a mesh.
    """
    write_form(directory, Form(kind, survey, language))


def write_form(directory, form):
    """Write the job of a Form into `directory`, text files and workbook; InputError as above."""
    directory = Path(directory)
    try:
        _make_empty(directory)
        (directory / SETTINGS_FILE).write_text(settings_text(form), encoding="utf-8")
        for table in form.tables:
            (directory / f"{table}.csv").write_text(csv_text(table, form), encoding="utf-8")
        for register in form.registers:
            path = directory / f"{register}.toml"
            path.write_text(register_text(register, form), encoding="utf-8")
        write_book(directory / WORKBOOK_FILE, form)
    except OSError as error:
        raise _unwritten(directory, error) from error


def write_input_workbook(path, kind="vertical", survey=None, language=DEFAULT):
    """Write the starter job as a workbook alone; returns its Path.

    path  of a workbook (.xlsx) that does not exist yet, or of a folder: job.xlsx in it

    The rest as `write_starter` has it.
    """
    form, path = Form(kind, survey, language), Path(path)
    try:
        if path.suffix.lower() != ".xlsx":
            _make_empty(path)
            path = path / WORKBOOK_FILE
        elif path.exists():
            raise InputError(
                Problem(
                    path.name,
                    message("workbook_exists", "exists; expected the name of a new workbook"),
                )
            )
        path.parent.mkdir(parents=True, exist_ok=True)
        write_book(path, form)
    except OSError as error:
        raise _unwritten(path, error) from error
    return path


def _make_empty(directory):
    if directory.exists() and (not directory.is_dir() or any(directory.iterdir())):
        found = "is not empty" if directory.is_dir() else "is a file"
        raise InputError(Problem(directory.name, f"{found}; expected a new or empty directory"))
    directory.mkdir(parents=True, exist_ok=True)


def _unwritten(path, error):
    return InputError(
        Problem(
            path.name,
            message("file_unwritten", "cannot be written ({reason})", reason=reason_of(error)),
        )
    )
