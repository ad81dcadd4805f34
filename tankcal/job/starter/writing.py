"""Writing of a starter job to a new folder or a new workbook."""

import dataclasses
import io
import json
import re
from dataclasses import dataclass
from pathlib import Path

from tankcal.errors import InputError, Problem, reason_of
from tankcal.job.contract import (
    INPUTS,
    KEYS,
    OF_PHOTOS,
    REGISTER_KEYS,
    REGISTERS_OF_SURVEY,
    SURVEYS,
    SURVEYS_OF_KIND,
    TABLES_OF_KIND,
    columns_of,
    tables_of_survey,
)
from tankcal.job.contract.keys import CSV
from tankcal.job.contract.uncertainty import UNITS
from tankcal.job.fields import Field
from tankcal.job.starter.book import book_bytes
from tankcal.job.starter.texts import is_number, texts_in
from tankcal.job.tables import SETTINGS_FILE, WORKBOOK_FILE
from tankcal.messages import message
from tankcal.methods.base import methods, methods_for
from tankcal.text.delimited import write_guarded
from tankcal.text.shipped import DEFAULT, LANGUAGES
from tankcal.text.words import say

STRAPPED = ("strapping", "reference-line")  # surveys without an adjustment of points
# Surveys for vertical tanks; for other kinds see SURVEYS_OF_KIND.
OF_SHELLS = tuple(method.starter for method in methods_for("vertical"))
OF_GREAT_CIRCLES = (("sphere", "ovality_mm"), ("sphere", "form_mm"))
# Marks of CSV files from spreadsheets in these languages.
DECIMAL_COMMAS = {"separator": ";", "decimal": ","}
PLACEHOLDER = "NAME"  # replaces the name of a camera or an instrument
KEPT = ("field-sheets.pdf",)  # files that may exist in the folder of a new form


# ---- content of a starter job: tables, lists and keys, by the kind of tank and of survey


@dataclass(frozen=True)
class Form:
    """Kind of tank, kind of survey and language of a starter job.

    Attributes
    ----------
    kind : str
        Kind of tank.
    survey : str or None
        Kind of survey; None: surveyed points.
    language : str
        Language of the report.

    Raises
    ------
    ValueError
        For an unknown value, or a survey that the kind of tank does not have.
    """

    kind: str
    survey: str | None = None
    language: str = DEFAULT

    def __post_init__(self):
        _refuse_others(self.kind, TABLES_OF_KIND)
        _refuse_others(self.language, LANGUAGES)
        if self.survey is not None:
            _refuse_others(self.survey, SURVEYS)
            has_points = "points" in TABLES_OF_KIND[self.kind] and self.survey not in OF_SHELLS
            is_own = self.survey in SURVEYS_OF_KIND.get(self.kind, {})
            if not (has_points or is_own or self.kind == "vertical"):
                raise ValueError(f"a tank of kind {self.kind} has no survey; expected another kind")

    @property
    def tables(self):
        """Names of its tables; the tables of a survey replace the points."""
        of_tank = TABLES_OF_KIND[self.kind]
        if self.survey is None:
            return of_tank
        return (
            *tables_of_survey(self.kind, self.survey),
            *(table for table in of_tank if table != "points"),
        )

    @property
    def registers(self):
        """Names of its lists, such as cameras and instruments."""
        return REGISTERS_OF_SURVEY.get(self.survey, ())

    @property
    def keys(self):
        """{section: its fields}, without empty sections."""
        suiting = {
            section: [field for field in fields if self._has(section, field)]
            for section, fields in KEYS.items()
        }
        return {section: fields for section, fields in suiting.items() if fields}

    @property
    def inputs(self):
        """{name: Declarable} of the inputs of uncertainty for this kind of tank."""
        return {
            name: declarable for name, declarable in INPUTS.items() if self.kind in declarable.kinds
        }

    def start(self, section, field):
        """Initial value of a key; "" if blank."""
        if (section, field.name) == ("tank", "kind"):
            return self.kind
        if (section, field.name) == ("table", "language") and self.language != DEFAULT:
            return self.language
        if section == "csv" and self.language != DEFAULT:
            return DECIMAL_COMMAS[field.name]
        for method in methods_for(self.kind):
            starts = method.starter_settings(self.kind) if method.starter == self.survey else {}
            if f"{section}.{field.name}" in starts:
                return starts[f"{section}.{field.name}"]
        return field.start

    def is_to_fill_in(self, section, field):
        """Return True if the key is required and has no initial value."""
        return field.is_required(self.kind) and not self.start(section, field)

    def entries(self, register):
        """{name: {key: text}} of the initial entries of a list."""
        return {PLACEHOLDER: {}}

    def fields(self, register, given):
        """Fields of an entry: the usual fields, and those named by the user."""
        usual = REGISTER_KEYS[register]
        others = given.keys() - {field.name for field in usual}
        return (*usual, *(Field(name, "numbers", "") for name in given if name in others))

    def rows(self, table):
        """Initial rows of a table: a {column: text} for each row."""
        return ()

    def choices(self, table, field):
        """Choices of a column; for inputs of uncertainty, the inputs of this tank."""
        suiting = self.inputs
        if table in ("uncertainty", "correlations") and set(field.choices) <= set(INPUTS):
            return tuple(name for name in field.choices if name in suiting)
        if field.choices == UNITS:
            return tuple(dict.fromkeys(declarable.unit for declarable in suiting.values()))
        return field.choices

    def _has(self, section, field):
        if field.of_survey and self.survey is None:
            return False
        if (section, field.name) in OF_GREAT_CIRCLES and self.survey not in STRAPPED:
            return False
        starting = [method for method in methods() if method.starter == self.survey]
        if section.startswith("adjustment") and not all(
            method.starter_has_network for method in starting
        ):
            return False
        owners = [method for method in methods() if section in method.settings()]
        if owners and not set(owners) & set(starting):
            return False
        of_photos = section == "adjustment.camera" or field.name in OF_PHOTOS
        return field.suits(self.kind) and (self.survey == "photos" or not of_photos)


def _refuse_others(value, known):
    if value not in known:
        raise ValueError(f"found {value!r}; expected one of {', '.join(known)}")


def refuse_other_survey(kind, survey, language):
    """Raise InputError if the kind of tank has no such survey."""
    try:
        Form(kind, survey, language)
    except ValueError as error:
        expected = message(
            "survey_of_other_kind",
            "found {survey}; expected another survey: a tank of kind {of_kind} has no such survey",
            survey=survey,
            of_kind=kind,
        )
        raise InputError(Problem("--survey", expected)) from error


# ---- writing of a starter job to a new folder or a new workbook


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
    choices = f" ({say(texts.words, field.expectation)})" if field.kind == "choice" else ""
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
