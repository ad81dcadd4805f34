"""Editing of a job: its files on the disk and in their edited state, with its problems by cell.

draft = Draft.open("my-tank")
draft.set_cells("points", [(0, "x_m", "6.5021")])
draft.check().problems
draft.save()
"""

import hashlib
import os
import tempfile
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path

from tankcal.errors import SHEET, InputError, Problem
from tankcal.job.contract import COLUMNS, KINDS, columns_of
from tankcal.job.field_values import read_value
from tankcal.job.fields import Refused
from tankcal.job.folder import csv_marks, decode, parsed_toml, read_toml, results_given_as_job
from tankcal.job.loading import load_edited
from tankcal.job.tables import (
    REGISTERS,
    SETTINGS_FILE,
    TABLES,
    WORKBOOK_FILE,
    Log,
    meant,
    read_beside,
    read_bytes,
)
from tankcal.messages import message
from tankcal.products.desk.keys import (
    READ_ONLY_SECTIONS,
    SETTINGS,
    EditedKeys,
    field_of,
    new_sheet_table,
    read_book,
    write_book,
)
from tankcal.products.desk.tables import AmbiguousNumber, new_csv_table, read_csv_table
from tankcal.text.delimited import WESTERN, decode_text, find_encoding, is_western

BAD, DOUBTFUL = "bad", "doubtful"  # levels of a problem and of a warning; also CSS classes


@dataclass(frozen=True)
class Mark:
    """Problem (BAD) or warning (DOUBTFUL) of a cell."""

    level: str
    problem: Problem


@dataclass(frozen=True)
class Check:
    """Result of a check.

    Attributes
    ----------
    problems, warnings : tuple of Problem
        Problems and warnings of the job.
    job : Job or None
        The job; None if it has problems.
    marks : dict
        Marks of cells, {table or keys: {(row, column): tuple of Mark}}. For a table, the row is
        counted from 0 and the column is a heading; for keys, they are owner and key. None denotes
        the whole row, column or table.
    """

    problems: tuple
    warnings: tuple
    job: object
    marks: dict = field(default_factory=dict)

    @property
    def is_valid(self):
        """Whether the job has no problem and can be computed."""
        return not self.problems


def mark_cells(draft, numbers, check):
    """Assign the problems and warnings of a check to cells.

    Parameters
    ----------
    draft : Draft
        Edited files of the job.
    numbers : dict
        Number of each row of each table in its file, {table: sequence of int or None}.
    check : Check
        Check without marks.

    Returns
    -------
    Check
        Check with marks.
    """
    rows = {
        name: {number: place for place, number in enumerate(known) if number is not None}
        for name, known in numbers.items()
    }
    marks = {}
    for level, problems in ((BAD, check.problems), (DOUBTFUL, check.warnings)):
        for problem in problems:
            name = _table_of(draft, problem)
            if name is None:
                continue
            place = rows.get(name, {}).get(problem.row), problem.column
            if name in draft.keys:
                place = _place_in_keys(problem, {entry.owner for entry in draft.keys[name].entries})
            known = marks.setdefault(name, {})
            known[place] = (*known.get(place, ()), Mark(level, problem))
    return replace(check, marks=marks)


def _table_of(draft, problem):
    """Name of the table or keys that a problem concerns, or None."""
    name = problem.file.removeprefix(SHEET)
    if not draft.is_book:
        name, _, ending = problem.file.rpartition(".")
        if ending not in ("csv", "toml") or (ending == "toml") != (name in draft.keys):
            return None
    return name if name in draft.keys or name in draft.tables else None


def _place_in_keys(problem, owners):
    """Owner and key of a problem of keys; the owner may itself contain a dot."""
    if problem.column is None:
        return None, None
    if problem.column.startswith("["):
        return problem.column.strip("[]"), None
    matches = [owner_name for owner_name in owners if problem.column.startswith(f"{owner_name}.")]
    if matches:
        owner = max(matches, key=len)
        return owner, problem.column.removeprefix(f"{owner}.")
    owner, _, key = problem.column.rpartition(".")
    return owner or key, key if owner else None


AMBIGUOUS = message(
    "entry_not_told_apart",
    "which of two numbers is meant cannot be told from the decimal mark; expected the mark of the "
    "language. The entry is not written",
)
READ_AS_COMMENT = message("entry_switches_off", "begins with #: the row is not read")
FORMULAS = message(
    "workbook_has_formulas",
    "has formulas in the sheets of the job; edit it in Excel or LibreOffice, for their values "
    "would be lost here",
)
MOST_UNDO = 200  # number of edits that Undo can revert
MOST_HISTORY = 1_000_000  # letters of the steps that a later session can undo
OPERATIONS = (
    *("set_cells", "insert_rows", "remove_rows", "add_column", "add_table", "set_value", "restore"),
)


def source_of(path):
    """Folder or workbook of the job at a path; InputError if there is no job."""
    path = Path(path)
    is_settings = path.name == SETTINGS_FILE and path.is_file()
    folder = path.parent if is_settings else path
    with suppress(OSError, ValueError):
        if folder.is_dir() and (folder / SETTINGS_FILE).is_file():
            return folder
        if (folder / WORKBOOK_FILE).is_file():
            return folder / WORKBOOK_FILE
        if path.suffix.lower() == ".xlsx" and path.is_file():
            return path
    no_job = message(
        "no_job_to_open",
        "no job there; expected a folder with job.toml or a workbook (.xlsx), such as tankcal new "
        "writes",
    )
    raise InputError(Problem(path.name or str(path), results_given_as_job(path) or no_job))


@dataclass(frozen=True)
class Step:
    """State of a job beside an edit, with the operations of this edit.

    An operation is the name of a method of `Draft` with its arguments.
    """

    operations: list
    tables: dict
    keys: dict


class Draft:
    """State of the files of a job, with previous states for Undo.

    Attributes
    ----------
    source : Path
        Folder or workbook.
    tables : dict of EditedTable
        Tables of the job.
    keys : dict of EditedKeys
        The settings ("job"), and the existing lists of cameras, instruments, clouds and meters.
    locked : Message or None
        Reason why the job cannot be edited.
    unreadable : list of Problem
        Problems of files of keys that cannot be read, and therefore cannot be edited here.
    revision : int
        Number of edits since the job was opened; Undo and Redo are edits.
    on_edit : callable
        Function on_edit(operations) that is called after each edit.
    """

    def __init__(self, source):
        self.source = source
        self.is_book = source.is_file()
        self.locked = None
        self.unreadable = []
        self._saved_bytes = {}  # {file: its bytes, None for a missing file}
        self._saved = {}  # {name of a table or of keys: its state on the disk}
        self._undo_steps, self._redo_steps, self._group = [], [], None
        self._revisions, self.revision = {}, 0  # {revision: (tables, keys)} before later edits
        self.on_edit = lambda operations: None
        self._marks = ",", "."
        self.tables, self.keys = {}, {}
        if self.is_book:
            self._read_book()
        else:
            self._read_folder()
        self._saved = {**self.tables, **self.keys}

    @classmethod
    def open(cls, path):
        """Open a job folder, its job.toml or a workbook; InputError if there is no job."""
        return cls(source_of(path))

    # ---- reading

    def _content(self, name):
        """Bytes of a file, None if it is missing or unreadable, which the check reports."""
        path = self.source if self.is_book else self.source / name
        data = read_beside(path.parent, path.name, Log()) if path.exists() else None
        self._saved_bytes[name] = data
        return data

    def _read_folder(self):
        """Read the tables and keys of a job folder."""
        log = Log()
        self.unreadable = log.problems
        data = self._content(SETTINGS_FILE)
        settings = None
        if data is not None:
            settings, _ = read_toml(SETTINGS_FILE, data, log)
        if settings is not None and not log.problems:
            self._add_keys(SETTINGS, SETTINGS_FILE, data)
        marks = csv_marks(SETTINGS_FILE, settings or {}, Log())
        for name in REGISTERS:
            if (self.source / f"{name}.toml").is_file():
                data = self._content(f"{name}.toml")
                if data is not None and parsed_toml(f"{name}.toml", data, log) is not None:
                    self._add_keys(name, f"{name}.toml", data)
        if marks is None:
            return
        self._marks = marks
        for name in TABLES:
            file = f"{name}.csv"
            if (self.source / file).is_file():
                data = self._content(file)
                text = None if data is None else _decode_with_mark(file, data)
                if text is not None:
                    self.tables[name] = read_csv_table(name, file, text, *marks)

    def _add_keys(self, name, file, data):
        """Add keys that both tomllib and tomlkit can read; other files are only checked."""
        import tomlkit
        from tomlkit.exceptions import TOMLKitError  # a key given twice is no ValueError

        with suppress(ValueError, AttributeError, RecursionError, TOMLKitError):
            text = decode_text(data)
            tomlkit.parse(text)
            edited_keys = EditedKeys(name, file, text)
            if edited_keys.entries is not None:
                self.keys[name] = edited_keys

    def _read_book(self):
        """Read the tables and keys of a workbook."""
        data = self._content(self.source.name)
        with suppress(Exception):  # the check reports a damaged file
            self.tables, self.keys, has_formula = read_book(data, self._kind_of)
            self.locked = FORMULAS if has_formula else None

    # ---- content

    @property
    def kind(self):
        """Kind of tank, or None if the settings do not state it."""
        return self._kind_of(self.keys.get(SETTINGS))

    @staticmethod
    def _kind_of(settings):
        """Kind of tank of the settings, also if misspelt, or None."""
        kind = next(
            (
                entry.text
                for entry in (settings.entries if settings is not None else ())
                if (entry.owner, entry.key) == ("tank", "kind")
            ),
            "",
        )
        return kind if kind in KINDS else meant(kind, KINDS) if kind else None

    def value(self, owner, key):
        """Text of a key of the settings, or "" if it is not given."""
        settings = self.keys.get(SETTINGS)
        entries = settings.entries if settings is not None else ()
        return next(
            (entry.text for entry in entries if (entry.owner, entry.key) == (owner, key)), ""
        )

    def fields(self, name):
        """Columns that a table may have, {heading: Field}."""
        return {field.name: field for field in columns_of(name, self.kind)}

    @property
    def is_changed(self):
        """Whether a file differs from the file on the disk."""
        now = {**self.tables, **self.keys}
        return any(state is not self._saved.get(name) for name, state in now.items()) or any(
            name not in now for name in self._saved
        )

    # ---- edits

    def set_cells(self, name, changes):
        """Set the texts of cells, [(row, heading, text)], with rows counted from 0."""
        table = self.tables[name]
        places = [
            (row, table.headings.index(heading), text)
            for row, heading, text in changes
            if 0 <= row < len(table.rows) and heading in table.headings
        ]
        changes = [(row, table.headings[column], text) for row, column, text in places]
        self._commit(("set_cells", name, changes), tables={name: table.set_cells(places)})

    def insert_rows(self, name, place, count=1):
        """Insert blank rows before row `place`."""
        state = self.tables[name].insert_rows(place, count)
        self._commit(("insert_rows", name, place, count), tables={name: state})

    def remove_rows(self, name, places):
        """Remove rows."""
        state = self.tables[name].remove_rows(places)
        self._commit(("remove_rows", name, sorted(places)), tables={name: state})

    def add_column(self, name, heading):
        """Add a blank column at the right, unless it exists."""
        if heading not in self.tables[name].headings:
            state = self.tables[name].add_column(heading)
            self._commit(("add_column", name, heading), tables={name: state})

    def add_table(self, name, headings=None):
        """Add a table without rows; by default with the required columns."""
        required = [
            field.name for field in COLUMNS[name] if field.suits(self.kind) and field.required
        ]
        headings = headings or required or [field.name for field in columns_of(name, self.kind)]
        if self.is_book:
            state = new_sheet_table(name, headings, self.kind)
        else:
            state = new_csv_table(name, f"{name}.csv", headings, *self._marks)
        self._commit(("add_table", name, list(headings)), tables={name: state})
        if not self.is_book:
            self._saved_bytes.setdefault(f"{name}.csv", None)

    def set_value(self, name, owner, key, text):
        """Set the value of a key of the settings or of a list.

        Parameters
        ----------
        name : str
            "job" or the name of a list.
        owner, key : str
            Section or list entry, and key.
        text : str
            Text in the file.

        Raises
        ------
        InputError
            If the key cannot be edited here.
        """
        from tomlkit.exceptions import TOMLKitError

        keys = self.keys[name]
        if owner in READ_ONLY_SECTIONS:
            self._refuse_edit(keys, owner, key)
        try:
            state = keys.set_value(owner, key, text)
        except (TOMLKitError, ValueError, LookupError, TypeError, AttributeError):
            self._refuse_edit(keys, owner, key)
        self._commit(("set_value", name, owner, key, text), keys={name: state})

    def restore(self, files):
        """Replace tables and lists by their content, {name: text or None}; None removes a table.

        The journal repeats Undo and Redo by this edit, because it does not contain the states
        before its beginning.
        """
        self._commit(("restore", files), replaced=self._replace_states(self, files))

    def _replace_states(self, state, files):
        """Tables and keys of a `Draft` or `Step`, with the content of files as in `restore`."""
        tables, keys = dict(state.tables), dict(state.keys)
        for name, text in files.items():
            if text is None:
                tables.pop(name, None)
            elif name in keys:
                keys[name] = replace(keys[name], text=text, ambiguous={})
            else:
                tables[name] = read_csv_table(name, f"{name}.csv", text, *self._marks)
                self._saved_bytes.setdefault(f"{name}.csv", None)
        return tables, keys

    def describe_history(self):
        """Steps of Undo and Redo as plain data, the next first; at most `MOST_HISTORY` letters.

        Returns
        -------
        dict
            {"undo", "redo"}: [operations, {name: text or None}], the content of the files that
            the step restores, as in `restore`. Empty for a workbook, whose steps end with Save.
        """
        history = {}
        for kind, steps in {"undo": self._undo_steps, "redo": self._redo_steps}.items():
            after, size, listed = {**self.tables, **self.keys}, 0, history.setdefault(kind, [])
            for step in reversed(() if self.is_book else steps):
                before = {**step.tables, **step.keys}
                files = {
                    name: before[name].render()[0].decode("utf-8") if name in before else None
                    for name in {**before, **after}
                    if before.get(name) is not after.get(name)
                }
                size += len(str(step.operations)) + sum(map(len, filter(None, files.values())))
                if size > MOST_HISTORY:
                    break
                listed.append([step.operations, files])
                after = before
        return history

    def restore_history(self, history):
        """Take over the steps of an earlier session that ended with the present files."""
        stacks = []
        for kind in ("undo", "redo"):
            state, steps = self, []
            for operations, files in history[kind]:
                state = Step(operations, *self._replace_states(state, files))
                steps.append(state)
            stacks.append(steps[::-1])
        self._undo_steps, self._redo_steps = stacks

    @staticmethod
    def _refuse_edit(keys, owner, key):
        """Raise InputError for a key that cannot be edited here."""
        expected = message("key_not_edited_here", "cannot be edited here; edit the file itself")
        raise InputError(Problem(keys.file, expected, None, f"{owner}.{key}"))

    def _commit(self, operation, tables=(), keys=(), replaced=None):
        """Make an edit the present state; InputError if the job is locked."""
        if self.locked is not None:
            raise InputError(Problem(self.source.name, self.locked))
        before = self.tables, self.keys
        self.tables, self.keys = replaced or (
            {**self.tables, **dict(tables)},
            {**self.keys, **dict(keys)},
        )
        if self._group is None:
            self._finish_edit([operation], before)
        else:
            self._group.append(operation)

    def _finish_edit(self, operations, before):
        """Store the state before an edit for Undo, and report the edit."""
        self._undo_steps.append(Step(operations, *before))
        del self._undo_steps[:-MOST_UNDO]
        self._redo_steps.clear()
        self._count_revision(*before)
        self.on_edit(operations)

    def _count_revision(self, *before):
        """Count a new revision, and keep the state before it for `changes_since`."""
        self._revisions[self.revision] = before
        self._revisions.pop(self.revision - MOST_UNDO, None)
        self.revision += 1

    @contextmanager
    def group_edits(self):
        """Context in which all edits are a single edit for Undo, and are discarded on an error."""
        if self._group is not None:  # a part of a larger edit
            yield
            return
        before, self._group = (self.tables, self.keys), []
        try:
            yield
        except BaseException:
            self.tables, self.keys = before
            raise
        else:
            operations, self._group = self._group, None
            if operations:
                self._finish_edit(operations, before)
        finally:
            self._group = None

    def undo(self):
        """Revert the last edit, and return whether there was an edit."""
        return self._step(self._undo_steps, self._redo_steps)

    def redo(self):
        """Repeat the last reverted edit, and return whether there was an edit."""
        return self._step(self._redo_steps, self._undo_steps)

    def _step(self, steps, opposite):
        """Exchange the present state with the last state of `steps`."""
        if not steps:
            return False
        step, before = steps.pop(), (self.tables, self.keys)
        opposite.append(Step(step.operations, *before))
        self.tables, self.keys = step.tables, step.keys
        self._count_revision(*before)
        is_undo = steps is self._undo_steps
        self.on_edit([("undo" if is_undo else "redo",)] if self.is_book else self._difference())
        return True

    def _difference(self):
        """Operations that repeat the last exchange of states: changed files, ambiguous texts."""
        tables, keys = self._revisions[self.revision - 1]
        old, now = {**tables, **keys}, {**self.tables, **self.keys}
        changed = [name for name in {**old, **now} if old.get(name) is not now.get(name)]
        files = {
            name: now[name].render()[0].decode("utf-8") if name in now else None for name in changed
        }
        operations = [("restore", files)]
        for name in changed:
            if name in self.tables:
                table, numbers = self.tables[name], self.tables[name].render()[1]
                written = [row for row, number in enumerate(numbers) if number is not None]
                texts = [
                    (written.index(row), table.headings[column], table.rows[row].cells[column])
                    for row, column in table.ambiguous
                    if row in written
                ]
                operations += [("set_cells", name, texts)] if texts else []
            elif name in self.keys:
                operations += [
                    ("set_value", name, *place, text)
                    for place, text in self.keys[name].ambiguous.items()
                ]
        return operations

    def apply(self, operations):
        """Repeat an edit from its operations, as `on_edit` reported them."""
        if operations in ([("undo",)], [("redo",)]):
            getattr(self, operations[0][0])()
            return
        with self.group_edits():
            for method, *arguments in operations:
                if method not in OPERATIONS:
                    raise ValueError(f"found the operation {method!r}")
                getattr(self, method)(*arguments)

    @property
    def undo_operations(self):
        """Operations of the edit that Undo would revert; [] if there is no such edit."""
        return self._undo_steps[-1].operations if self._undo_steps else []

    @property
    def redo_operations(self):
        """Operations of the edit that Redo would repeat; [] if there is no such edit."""
        return self._redo_steps[-1].operations if self._redo_steps else []

    def changes_since(self, revision):
        """Determine what differs from an earlier revision.

        Parameters
        ----------
        revision : int
            Earlier value of `revision`.

        Returns
        -------
        dict or None
            {name of a table or of keys: [(row, heading)] or None}; None denotes a change of rows,
            columns or keys. None as a whole: the earlier revision is no longer known.
        """
        if revision == self.revision:
            return {}
        if revision not in self._revisions:
            return None
        tables, keys = self._revisions[revision]
        old, now = {**tables, **keys}, {**self.tables, **self.keys}
        return {
            name: _list_changed_cells(old.get(name), now.get(name))
            for name in {**old, **now}
            if old.get(name) is not now.get(name)
        }

    # ---- files

    def edited_files(self):
        """Files that differ from the disk, {file: bytes}, and row numbers, {table: numbers}."""
        rendered = {name: table.render() for name, table in self.tables.items()}
        numbers = {name: row_numbers for name, (_, row_numbers) in rendered.items()}
        now = {**self.tables, **self.keys}
        changed = [name for name, state in now.items() if state is not self._saved.get(name)]
        if self.is_book:
            if not changed:
                return {}, numbers
            file = self.source.name
            tables = [self.tables[name] for name in changed if name in self.tables]
            keys = [self.keys[name] for name in changed if name in self.keys]
            return {file: write_book(self._saved_bytes[file], tables, keys)}, numbers
        files = {now[name].file: now[name].render()[0] for name in changed}
        return {
            name: data for name, data in files.items() if data != self._saved_bytes[name]
        }, numbers

    def quick_check(self, name, places):
        """Check the text of cells by their fields, without the rest of the job.

        Parameters
        ----------
        name : str
            Name of a table, of a list or of the settings.
        places : list of (int or str, str)
            Row and heading of each cell; for keys, owner and key.

        Returns
        -------
        dict
            {(row, heading): Mark} of the cells whose text is not accepted.
        """
        if name in self.keys:
            file, decimal = self.keys[name].file, "."
            entries = {(entry.owner, entry.key): entry.text for entry in self.keys[name].entries}
            cells = ((field_of(name, *place), entries.get(place, "")) for place in places)
        else:
            table, fields = self.tables[name], self.fields(name)  # once, not for each pasted cell
            file, decimal = table.file, table.decimal
            columns = {heading: column for column, heading in enumerate(table.headings)}
            cells = (
                (fields.get(heading), table.rows[row].cells[columns[heading]])
                for row, heading in places
            )
        marks = {}
        for place, (accepted, raw) in zip(places, cells, strict=True):
            text = AMBIGUOUS if isinstance(raw, AmbiguousNumber) else None
            if text is None and accepted is not None and raw.strip():
                try:
                    read_value(accepted, raw, decimal)
                except Refused as refusal:
                    text = refusal.text
            if text is not None:
                marks[place] = Mark(BAD, Problem(file, text, None, place[1]))
        return marks

    def check(self):
        """Check the job in its edited state, and return a `Check` with all problems by cell."""
        files, numbers = self.edited_files()
        problems, warnings, job = (), (), None
        try:
            job = load_edited(self.source, files)
            warnings = job.warnings
        except InputError as error:
            problems = error.problems
        ambiguous = [*self._ambiguous_values()]
        # Of a value that is not written, only its own problem is reported.
        places = {(problem.file, problem.row, problem.column) for problem in ambiguous}
        problems = [
            problem
            for problem in problems
            if (problem.file, problem.row, problem.column) not in places
            and (problem.file, None, problem.column) not in places
        ]
        off = self._warn_about_comments(numbers)
        return mark_cells(self, numbers, Check((*ambiguous, *problems), (*warnings, *off), job))

    def _ambiguous_values(self):
        """Yield a problem for each ambiguous value."""
        for table in self.tables.values():
            numbers = table.render()[1] if table.ambiguous else ()
            for row, column in table.ambiguous:
                yield Problem(table.file, AMBIGUOUS, numbers[row], table.headings[column])
        for keys in self.keys.values():
            for owner, key in keys.ambiguous:
                yield Problem(keys.file, AMBIGUOUS, None, f"{owner}.{key}")

    def _warn_about_comments(self, numbers):
        """Warnings of rows that an edit made a comment."""
        return [
            Problem(table.file, READ_AS_COMMENT, numbers[name][place], table.headings[0])
            for name, table in self.tables.items()
            for place, row in enumerate(table.rows)
            if row.changed and row.cells and row.cells[0].startswith("#")
        ]

    def save(self):
        """Write the edited files, all or none of them.

        Returns
        -------
        list of Path
            Written files; empty if no file differs.

        Raises
        ------
        InputError
            If a value is ambiguous, or if another program has changed an edited file (any file, if
            no file was edited).
        """
        ambiguous = [*self._ambiguous_values()]
        if ambiguous:
            raise InputError(ambiguous)
        files, _ = self.edited_files()
        folder, paths = self._folder, self._paths(files)
        self.refuse_changed_elsewhere(files or self._saved_bytes)
        _replace_files(
            {paths[name]: data for name, data in files.items()}, self._saved_bytes, paths
        )
        self._saved_bytes.update(files)
        if self.is_book and files:
            self._read_book()
            self._undo_steps.clear()
            self._redo_steps.clear()
        self._saved = {**self.tables, **self.keys}
        return [folder / name for name in files]

    @property
    def _folder(self):
        """Folder of the files."""
        return self.source.parent if self.is_book else self.source

    def _paths(self, names):
        """Absolute paths of files, {name: path}."""
        return {name: (self._folder / name).resolve() for name in names}

    def digests(self):
        """SHA-256 of the files as they were read or saved, {file: digest or None}."""
        return {name: _digest(data) for name, data in self._saved_bytes.items()}

    def refuse_changed_elsewhere(self, names=None):
        """Raise InputError if another program has changed one of these files, or any file."""
        expected = message(
            "changed_elsewhere",
            "another program has changed the file since it was opened here; nothing was written. "
            "Open the notebook again",
        )
        changed = []
        for name, path in self._paths(self._saved_bytes if names is None else names).items():
            data = read_bytes(path, Log()) if path.is_file() else None
            if _digest(data) != _digest(self._saved_bytes[name]):
                changed.append(Problem(name, expected))
        if changed:
            raise InputError(changed)


def _list_changed_cells(old, now):
    """Changed cells [(row, heading)] of two states of a table; None if their forms differ."""
    if old is None or now is None or not hasattr(now, "rows") or not hasattr(now, "headings"):
        return None
    if old.headings != now.headings or len(old.rows) != len(now.rows):
        return None
    return [
        (place, heading)
        for place, (before, row) in enumerate(zip(old.rows, now.rows, strict=True))
        if before is not row  # states share the rows that no edit has changed
        for heading, text, other in zip(now.headings, row.cells, before.cells, strict=True)
        if text != other
    ]


def _decode_with_mark(file, data):
    """Text of a CSV file with its byte order mark, or None if it cannot be decoded.

    Edited files are written in UTF-8. A file in Windows-1252 gets a byte order mark, by which Excel
    recognises UTF-8.
    """
    if is_western(data):
        return f"\ufeff{data.decode(WESTERN)}"
    return data.decode(find_encoding(data)) if decode(file, data, Log()) is not None else None


def _digest(data):
    """SHA-256 of bytes, or None for a missing file."""
    return None if data is None else hashlib.sha256(data).hexdigest()


def _replace_files(contents, before, paths):
    """Replace files by {path: bytes}, all or none of them.

    The new files are first written next to the files that they replace.
    """
    staged, done = {}, []
    names = {path: name for name, path in paths.items()}
    try:
        for path, data in contents.items():
            handle, temporary = tempfile.mkstemp(prefix=".tankcal-", dir=path.parent)
            staged[path] = Path(temporary)
            with os.fdopen(handle, "wb") as file:
                file.write(data)
            mode = path.stat().st_mode & 0o777 if path.exists() else 0o644
            staged[path].chmod(mode)
        for path, temporary in staged.items():
            temporary.replace(path)
            done.append(path)
    except OSError:
        # Restore the files that were already replaced.
        for path in done:
            data = before[names[path]]
            path.unlink() if data is None else path.write_bytes(data)
        raise
    finally:
        for temporary in staged.values():
            temporary.unlink(missing_ok=True)
