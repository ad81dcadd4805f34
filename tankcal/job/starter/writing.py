"""Writing of a starter job to a new folder or a new workbook."""

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
from tankcal.text.delimited import write_guarded
from tankcal.text.shipped import DEFAULT
from tankcal.text.words import say

KEPT = ("field-sheets.pdf",)  # files that may exist in the folder of a new form

# Starter job with content: data of a plan, known before the survey.


@dataclasses.dataclass(frozen=True)
class FilledForm(Form):
    """A Form with settings, rows and entries, all as texts.

    Attributes
    ----------
    settings : dict
        {"tank.id": text}.
    given : dict
        {table: ({column: text}, ...)}.
    registered : dict
        {"cameras" or "instruments": {name: {key: text}}}.
    to_fill : tuple of str
        Keys such as "survey.date" that must be filled in, in addition to required keys.
    more : tuple of str
        Tables in addition to those of the kind of survey.
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
        """Names of its lists, such as cameras and instruments."""
        usual = super().registers
        return (*usual, *(name for name in self.registered if name not in usual))

    def start(self, section, field):
        """Initial value of a key; "" if blank."""
        return self.settings.get(f"{section}.{field.name}", super().start(section, field))

    def is_to_fill_in(self, section, field):
        """Return True if the key must be filled in and has no value."""
        if self.start(section, field):
            return False
        return f"{section}.{field.name}" in self.to_fill or super().is_to_fill_in(section, field)

    def entries(self, register):
        """{name: {key: text}} of a list; without entries, one empty entry."""
        return self.registered.get(register) or super().entries(register)

    def rows(self, table):
        """Rows of a table."""
        return self.given.get(table, ())

    def _has(self, section, field):
        is_given = f"{section}.{field.name}" in self.settings and field.suits(self.kind)
        return is_given or super()._has(section, field)


# Text files of the starter job: job.toml, CSV files, lists of cameras and instruments.


def settings_text(form):
    """Text of job.toml for a Form, every key with its note."""
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
    """Text of a list such as cameras.toml for a Form, with its entries or an empty entry."""
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
    """Name as a key of TOML."""
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else json.dumps(name, ensure_ascii=False)


def csv_text(table, form):
    """Text of a CSV file for a Form: comments, row of headings, and initial rows."""
    texts = texts_in(form.language)
    lines = [f"# {texts.note('tables', table)}; {texts.of('files', 'comments')}"]
    fields = columns_of(table, form.kind)
    for field in fields:
        blank = "" if field.required else f" [{texts.of('files', 'may_be_blank')}]"
        lines.append(f"# {field.name}: {texts.note('columns', table, field)}{blank}")
    if table == "uncertainty":
        lines += [_input(texts, name, declarable) for name, declarable in form.inputs.items()]
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
    """Note of a key; for a key to be filled in, with this request and the choices."""
    if not is_to_fill_in:
        return text
    choices = f" ({say(texts.words, field.expectation())})" if field.kind == "choice" else ""
    return f"{texts.of('files', 'fill_in')}: {text}{choices}"


def _input(texts, name, declarable):
    assumed = texts.assumption(declarable)
    ending = f"; {texts.of('files', 'not_declared', assumed=assumed)}" if assumed else ""
    return f"# {name}: {texts.input_note(name, declarable)}, {declarable.unit}{ending}"


def write_starter(directory, kind="vertical", survey=None, language=DEFAULT):
    """Write the starter job of a kind of tank as text files.

    The directory is created if it does not exist. An unchanged starter workbook in it, as written
    by `write_input_workbook`, is replaced, because a folder contains one form.

    Parameters
    ----------
    directory : str or PathLike
        New or empty folder.
    kind : {"vertical", "horizontal", "sphere", "mesh"}, optional
        Kind of tank; only its keys and tables are written.
    survey : str, optional
        Kind of survey, such as "photos" or "total-station", whose files replace the points; None:
        points.
    language : str, optional
        Language of the report and of the explanations.

    Raises
    ------
    InputError
        If the directory contains other files or cannot be written.
    ValueError
        For an unknown kind of tank or survey, or a survey of a mesh.
    """
    form, directory = Form(kind, survey, language), Path(directory)
    try:
        book = _make_empty(directory, lambda: {WORKBOOK_FILE: book_bytes(form)})
        _write_texts(directory, form)
        _remove(book)
    except OSError as error:
        raise _unwritten(directory, error) from error


def write_form(directory, form, workbook=False):
    """Write the job of a Form into a directory.

    Parameters
    ----------
    directory : str or PathLike
        New or empty folder.
    form : Form
        Content of the job.
    workbook : bool, optional
        True: write job.xlsx; False: write text files.

    Raises
    ------
    InputError
        If the directory contains other files or cannot be written.
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
    """Write the starter job as a workbook.

    Parameters
    ----------
    path : str or PathLike
        New workbook (.xlsx), or a folder. In a folder, job.xlsx replaces unchanged text files that
        `write_starter` wrote for the same form.
    kind, survey, language : str, optional
        As for `write_starter`.

    Returns
    -------
    Path
        The workbook.

    Raises
    ------
    InputError, ValueError
        As for `write_starter`.
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
    """Create a directory, or check that it contains no files of the user.

    Parameters
    ----------
    directory : Path
        The directory.
    replaceable : callable, optional
        Returns {name: bytes} of the form whose unchanged files may be replaced.

    Returns
    -------
    list of Path
        Files to be replaced.
    """
    if directory.exists() and not directory.is_dir():
        text = message("new_is_file", "is a file; expected the name of a new or empty folder")
        raise InputError(Problem(directory.name, text))
    paths = sorted(directory.iterdir()) if directory.exists() else []
    of_form = [path for path in paths if path.name not in KEPT]
    written = replaceable() if of_form and replaceable else {}
    if (paths and not written) or not all(
        (path.name in written and path.is_file() and path.read_bytes() == written[path.name])
        for path in of_form
    ):
        text = message(
            "new_not_empty",
            "is not empty, and is left as it is; expected the name of a new or empty folder",
        )
        raise InputError(Problem(directory.name, text))
    directory.mkdir(parents=True, exist_ok=True)
    return of_form


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
