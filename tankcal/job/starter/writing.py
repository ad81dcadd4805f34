"""Where a starter job goes: a new folder, or one workbook that did not exist."""

import dataclasses
import io
import json
import re
from pathlib import Path

from tankcal.errors import InputError, Problem, reason_of
from tankcal.job.contract import columns_of
from tankcal.job.contract.keys import CSV
from tankcal.job.starter.book import book_bytes
from tankcal.job.starter.form import Form
from tankcal.job.starter.texts import is_number, texts_in
from tankcal.job.tables import SETTINGS_FILE, WORKBOOK_FILE
from tankcal.messages import message
from tankcal.text.languages import DEFAULT
from tankcal.text.spreadsheets import write_guarded
from tankcal.text.words import say

KEPT = ("field-sheets.pdf",)  # may lie in the folder when its form is written again

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
    separator, decimal = (form.start("csv", field) for field in CSV)
    rows = [[field.name for field in fields]]
    for row in form.rows(table):
        cells = [(field, row.get(field.name, "")) for field in fields]
        rows.append(
            [
                cell.replace(".", decimal) if field.kind == "number" else cell
                for field, cell in cells
            ]
        )
    text = io.StringIO()
    write_guarded(text, rows, separator)
    return "\n".join(lines) + "\n" + text.getvalue()


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


def write_starter(directory, kind="vertical", survey=None, language=DEFAULT):
    """Write the starter job of a kind of tank as text files into `directory`.

    kind      "vertical", "horizontal", "sphere" or "mesh"; only what it can use is written
    survey    "photos" or "total-station": its files in place of the points; None: points
    language  of the papers that the job asks for, and of the explanations

    The directory is made when it does not exist. An untouched starter workbook in it, as
    `write_input_workbook` makes it, is replaced: a folder holds one form.

    Raises InputError when the directory holds something else or cannot be written, ValueError
    for another kind, another survey, or a survey of a mesh.
    """
    form, directory = Form(kind, survey, language), Path(directory)
    try:
        book = _make_empty(directory, lambda: {WORKBOOK_FILE: book_bytes(form)})
        _write_texts(directory, form)
        _remove(book)
    except OSError as error:
        raise _unwritten(directory, error) from error


def write_form(directory, form, workbook=False):
    """Write the job of a Form into `directory`; InputError as above.

    workbook  write it as job.xlsx in place of text files
    """
    directory = Path(directory)
    try:
        _make_empty(directory)
        if workbook:
            (directory / WORKBOOK_FILE).write_bytes(book_bytes(form))
        else:
            _write_texts(directory, form)
    except OSError as error:
        raise _unwritten(directory, error) from error


def write_input_workbook(path, kind="vertical", survey=None, language=DEFAULT):
    """Write the starter job as a workbook alone; returns its Path.

    path  of a workbook (.xlsx) that does not exist yet, or of a folder: job.xlsx in it, in place
          of untouched text files that `write_starter` made of the same form

    The rest as `write_starter` has it.
    """
    form, path, texts = Form(kind, survey, language), Path(path), []
    try:
        if path.suffix.lower() != ".xlsx":
            texts = _make_empty(path, lambda: _text_files(form))
            path = path / WORKBOOK_FILE
        elif path.exists():
            raise InputError(
                Problem(
                    path.name,
                    message("workbook_exists", "exists; expected the name of a new workbook"),
                )
            )
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(book_bytes(form))
        _remove(texts)
    except OSError as error:
        raise _unwritten(path, error) from error
    return path


def _text_files(form):
    """{name: bytes} of the text files of a Form."""
    texts = {SETTINGS_FILE: settings_text(form)}
    texts |= {f"{table}.csv": csv_text(table, form) for table in form.tables}
    texts |= {f"{register}.toml": register_text(register, form) for register in form.registers}
    return {name: text.encode() for name, text in texts.items()}


def _write_texts(directory, form):
    for name, data in _text_files(form).items():
        (directory / name).write_bytes(data)


def _make_empty(directory, replaceable=None):
    """Make a directory, or check that it has no files of the user; returns those to replace.

    replaceable  makes {name: bytes} of the form whose files may be there, unchanged
    """
    if directory.exists() and not directory.is_dir():
        text = message("new_is_file", "is a file; expected the name of a new or empty folder")
        raise InputError(Problem(directory.name, text))
    found = sorted(directory.iterdir()) if directory.exists() else []
    of_form = [one for one in found if one.name not in KEPT]
    written = replaceable() if of_form and replaceable else {}
    if (found and not written) or not all(_is_untouched(one, written) for one in of_form):
        text = message(
            "new_not_empty",
            "is not empty, and is left as it is; expected the name of a new or empty folder",
        )
        raise InputError(Problem(directory.name, text))
    directory.mkdir(parents=True, exist_ok=True)
    return of_form


def _is_untouched(path, written):
    return path.name in written and path.is_file() and path.read_bytes() == written[path.name]


def _remove(paths):
    for path in paths:
        path.unlink()


def _unwritten(path, error):
    return InputError(
        Problem(
            path.name,
            message("file_unwritten", "cannot be written ({reason})", reason=reason_of(error)),
        )
    )
