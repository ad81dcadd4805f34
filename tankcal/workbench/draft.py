"""A job under edit: its files as they stand on the disk and as they are to be.

draft = Draft.open("my-tank")
draft.set_cells("points", [(0, "x_m", "6.5021")])
draft.check().problems
draft.save()
"""

import hashlib
import os
import tempfile
from contextlib import contextmanager, suppress
from pathlib import Path

from tankcal.errors import InputError, Problem
from tankcal.job.contract import COLUMNS, KINDS, columns_of
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
from tankcal.text.decoding import WESTERN, decode_text, find_encoding, is_western
from tankcal.workbench.book import new_sheet_table, read_book, written_book
from tankcal.workbench.findings import Check, found_in
from tankcal.workbench.keys import NOT_HERE, SETTINGS, EditedKeys
from tankcal.workbench.tables import new_csv_table, read_csv_table

NOT_TOLD_APART = message(
    "entry_not_told_apart",
    "which of two numbers is meant cannot be told from the decimal mark; expected the mark of the "
    "language. The entry is not written",
)
OFF = message("entry_switches_off", "begins with #: the row is not read")
FORMULAS = message(
    "workbook_has_formulas",
    "has formulas in the sheets of the job; edit it in Excel or LibreOffice, for their values "
    "would be lost here",
)
KEPT_EDITS = 200  # that Undo takes back


def source_of(path):
    """The job that a path names: its folder or its workbook; InputError: there is none."""
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


class Draft:
    """The state of the files of a job, with what was before.

    Attributes
    ----------
    source : Path
        Folder or workbook.
    tables : dict of EditedTable
    keys : dict of EditedKeys
        "job", and the lists of cameras, instruments, clouds and meters that are there.
    locked : Message or None
        Why nothing may be edited.
    unreadable : list of Problem
        Files of keys that cannot be read, and so cannot be edited here.
    """

    def __init__(self, source):
        self.source = source
        self.is_book = source.is_file()
        self.locked = None
        self.unreadable = []
        self._disk = {}  # {file: its bytes, None: not there}
        self._first = {}  # {file of a table or of keys: state that is on the disk}
        self._before, self._marks = [], (",", ".")
        self.tables, self.keys = {}, {}
        if self.is_book:
            self._read_book()
        else:
            self._read_folder()
        self._first = {**self.tables, **self.keys}

    @classmethod
    def open(cls, path):
        """The Draft of a job folder, its job.toml or a workbook; InputError: there is no job."""
        return cls(source_of(path))

    # ---- reading

    def _content(self, name):
        """The bytes of a file, None where it is not there or cannot be read (the check tells)."""
        path = self.source if self.is_book else self.source / name
        data = read_beside(path.parent, path.name, Log()) if path.exists() else None
        self._disk[name] = data
        return data

    def _read_folder(self):
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
                text = None if data is None else _edited_text(file, data)
                if text is not None:
                    self.tables[name] = read_csv_table(name, file, text, *marks)

    def _add_keys(self, name, file, data):
        """Keys that tomllib and tomlkit both read; others are looked at by the check alone."""
        import tomlkit
        from tomlkit.exceptions import TOMLKitError  # a key given twice is no ValueError

        with suppress(ValueError, AttributeError, RecursionError, TOMLKitError):
            text = decode_text(data)
            tomlkit.parse(text)
            made = EditedKeys(name, file, text)
            if made.entries is not None:
                self.keys[name] = made

    def _read_book(self):
        data = self._content(self.source.name)
        with suppress(Exception):  # whatever ails a damaged file: the check tells it in words
            self.tables, self.keys, has_formula = read_book(data, self._kind_of)
            self.locked = FORMULAS if has_formula else None

    # ---- what is there

    @property
    def kind(self):
        """The kind of tank, None where the settings do not say it."""
        return self._kind_of(self.keys.get(SETTINGS))

    @staticmethod
    def _kind_of(settings):
        given = next(
            (
                one.text
                for one in (settings.entries if settings is not None else ())
                if (one.owner, one.key) == ("tank", "kind")
            ),
            "",
        )
        return given if given in KINDS else meant(given, KINDS) if given else None

    def value(self, owner, key):
        """The text of a key of the settings; "" where it is not given."""
        settings = self.keys.get(SETTINGS)
        entries = settings.entries if settings is not None else ()
        return next((one.text for one in entries if (one.owner, one.key) == (owner, key)), "")

    def fields(self, name):
        """{heading: Field} of the columns that a table may have."""
        return {one.name: one for one in columns_of(name, self.kind)}

    @property
    def is_changed(self):
        """Does a file differ from the one on the disk?"""
        now = {**self.tables, **self.keys}
        return any(state is not self._first.get(name) for name, state in now.items()) or any(
            name not in now for name in self._first
        )

    # ---- edits

    def set_cells(self, name, changes):
        """Put texts of the file into cells: [(row, heading, text)], row counted from 0."""
        table = self.tables[name]
        places = [
            (row, table.headings.index(heading), text)
            for row, heading, text in changes
            if 0 <= row < len(table.rows) and heading in table.headings
        ]
        self._keep()
        self.tables[name] = table.set_cells(places)

    def insert_rows(self, name, place, count=1):
        """Put blank rows before row `place`."""
        self._keep()
        self.tables[name] = self.tables[name].insert_rows(place, count)

    def remove_rows(self, name, places):
        """Take rows out."""
        self._keep()
        self.tables[name] = self.tables[name].remove_rows(places)

    def add_column(self, name, heading):
        """Put a blank column at the right."""
        if heading not in self.tables[name].headings:
            self._keep()
            self.tables[name] = self.tables[name].add_column(heading)

    def add_table(self, name, headings=None):
        """A table that the job did not have, without rows.

        headings  None: the columns that it must have
        """
        needed = [one.name for one in COLUMNS[name] if one.suits(self.kind) and one.required]
        needed = headings or needed or [one.name for one in columns_of(name, self.kind)]
        self._keep()
        if self.is_book:
            self.tables[name] = new_sheet_table(name, needed, self.kind)
            return
        self._disk.setdefault(f"{name}.csv", None)
        self.tables[name] = new_csv_table(name, f"{name}.csv", needed, *self._marks)

    def set_value(self, name, owner, key, text):
        """Give a key of the settings or of a list a value, in the text of the file."""
        from tomlkit.exceptions import TOMLKitError

        keys = self.keys[name]
        if owner in NOT_HERE:
            self._refuse(keys, owner, key)
        try:
            state = keys.set_value(owner, key, text)
        except (TOMLKitError, ValueError, LookupError, TypeError, AttributeError):
            self._refuse(keys, owner, key)
        self._keep()
        self.keys[name] = state

    @staticmethod
    def _refuse(keys, owner, key):
        expected = message("key_not_edited_here", "cannot be edited here; edit the file itself")
        raise InputError(Problem(keys.file, expected, None, f"{owner}.{key}"))

    def _keep(self):
        if self.locked is not None:
            raise InputError(Problem(self.source.name, self.locked))
        self._before.append((dict(self.tables), dict(self.keys)))
        del self._before[:-KEPT_EDITS]

    @contextmanager
    def as_one_edit(self):
        """What is edited within is one edit for Undo; on an error nothing of it stays."""
        state, before = (dict(self.tables), dict(self.keys)), [*self._before]
        try:
            yield
        except BaseException:
            (self.tables, self.keys), self._before = state, before
            raise
        if self._before and (not before or self._before[-1] is not before[-1]):
            self._before = [*before, state][-KEPT_EDITS:]

    def undo(self):
        """Take the last edit back; False: there is none."""
        if not self._before:
            return False
        self.tables, self.keys = self._before.pop()
        return True

    # ---- files

    def edited(self):
        """({file: bytes} of the files that differ from the disk, {table: numbers of its rows})."""
        rendered = {name: table.render() for name, table in self.tables.items()}
        numbers = {name: one for name, (_, one) in rendered.items()}
        now = {**self.tables, **self.keys}
        changed = [name for name, state in now.items() if state is not self._first.get(name)]
        if self.is_book:
            if not changed:
                return {}, numbers
            file = self.source.name
            tables = [self.tables[name] for name in changed if name in self.tables]
            keys = [self.keys[name] for name in changed if name in self.keys]
            return {file: written_book(self._original, tables, keys)}, numbers
        files = {now[name].file: now[name].render()[0] for name in changed}
        return {name: data for name, data in files.items() if data != self._disk[name]}, numbers

    @property
    def _original(self):
        return self._disk[self.source.name]

    def check(self):
        """Read the job as it would be after saving: `Check` with every problem, by cell."""
        files, numbers = self.edited()
        problems, warnings, job = (), (), None
        try:
            job = load_edited(self.source, files)
            warnings = job.warnings
        except InputError as error:
            problems = error.problems
        own = [*self._not_written()]
        places = {(one.file, one.row, one.column) for one in own}
        problems = [
            one
            for one in problems
            if (one.file, one.row, one.column) not in places
            and (one.file, None, one.column) not in places
        ]
        off = self._switched_off(numbers)
        return found_in(self, numbers, Check((*own, *problems), (*warnings, *off), job))

    def _not_written(self):
        for table in self.tables.values():
            numbers = table.render()[1] if table.unwritten else ()
            for row, column in table.unwritten:
                yield Problem(table.file, NOT_TOLD_APART, numbers[row], table.headings[column])
        for keys in self.keys.values():
            for owner, key in keys.unwritten:
                yield Problem(keys.file, NOT_TOLD_APART, None, f"{owner}.{key}")

    def _switched_off(self, numbers):
        """Rows that an edit made a comment of."""
        return [
            Problem(table.file, OFF, numbers[name][place], table.headings[0])
            for name, table in self.tables.items()
            for place, row in enumerate(table.rows)
            if row.changed and row.cells and row.cells[0].startswith("#")
        ]

    def save(self):
        """Write the files that were edited, all or nothing.

        Returns
        -------
        list of Path
            What was written; nothing where nothing differs.

        Raises
        ------
        InputError
            Where an entry cannot be written, or a file is no longer as it was read: of those
            that are to be written, or of all where nothing is.
        """
        waiting = [*self._not_written()]
        if waiting:
            raise InputError(waiting)
        files, _ = self.edited()
        folder, paths = self._folder, self._paths(files)
        self.refuse_changed_elsewhere(files or self._disk)
        _replace_all({paths[name]: data for name, data in files.items()}, self._disk, paths)
        self._disk.update(files)
        if self.is_book and files:
            self._read_book()
            self._before.clear()
        self._first = {**self.tables, **self.keys}
        return [folder / name for name in files]

    @property
    def _folder(self):
        return self.source.parent if self.is_book else self.source

    def _paths(self, names):
        return {name: (self._folder / name).resolve() for name in names}

    def refuse_changed_elsewhere(self, names=None):
        """InputError where one of these files, or of all, is no longer as it was read."""
        expected = message(
            "changed_elsewhere",
            "another program has changed the file since it was opened here; nothing was written. "
            "Open the notebook again",
        )
        changed = []
        for name, path in self._paths(self._disk if names is None else names).items():
            data = read_bytes(path, Log()) if path.is_file() else None
            if _digest(data) != _digest(self._disk[name]):
                changed.append(Problem(name, expected))
        if changed:
            raise InputError(changed)


def _edited_text(file, data):
    """The text of a CSV file with its byte order mark, or None where it cannot be read.

    An edited file is written in UTF-8. One in Windows-1252 gets the mark, by which Excel
    recognises UTF-8.
    """
    if is_western(data):
        return f"\ufeff{data.decode(WESTERN)}"
    return data.decode(find_encoding(data)) if decode(file, data, Log()) is not None else None


def _digest(data):
    return None if data is None else hashlib.sha256(data).hexdigest()


def _replace_all(contents, before, paths):
    """Write {path: bytes} beside their goals, then put all in place; on an error none of them."""
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
        for path in done:
            data = before[names[path]]
            path.unlink() if data is None else path.write_bytes(data)
        raise
    finally:
        for temporary in staged.values():
            temporary.unlink(missing_ok=True)
