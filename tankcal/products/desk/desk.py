"""Model of a job that is opened for editing: check, edits, Undo, recovery, Save and Run.

The notebook and the app share this model. It knows no widgets and no server.
"""

import datetime
from contextlib import suppress

from tankcal.errors import InputError, Problem, reason_of
from tankcal.job.contract import SURVEYS, TABLES_OF_KIND
from tankcal.job.tables import REGISTERS, TABLES
from tankcal.messages import message
from tankcal.products.desk.computing import Refusal, Run
from tankcal.products.desk.display import KEY_COLUMNS, VALUE, key_places
from tankcal.products.desk.keys import field_of
from tankcal.products.desk.tables import text_for_file

MOST_INSERTED = 10_000  # largest number of rows that a single action inserts


class Desk:
    """A job that is opened for editing.

    Attributes
    ----------
    draft : Draft
        Edited files of the job.
    reader : Reader
        Texts in the language.
    out : Path
        Folder of the results.
    last_run : Run or None
        Last computation.
    is_stale : bool
        Whether the job was edited or overruled since the last computation.
    every_key : dict
        Tables of keys that show every key, {name: True}.
    status : str
        Message about the last action.
    """

    def __init__(self, draft, out, reader):
        self.draft, self.out, self.reader = draft, out, reader
        self.last_run, self.is_stale = None, False
        self.every_key, self.status = {}, ""
        self._listeners, self._check = [], None
        self._journal, self.unsaved = None, None

    # ---- recovery after a crash

    def keep_journal(self, journal):
        """Write each edit to a journal; `unsaved` are the edits of an earlier session."""
        self.unsaved = journal.read(self.draft.digests())
        history = journal.read_history(self.draft.digests())
        with suppress(InputError, ValueError, LookupError, TypeError, AttributeError):
            if history is not None:
                self.draft.restore_history(history)
        self._journal = journal
        if self.unsaved is None:
            journal.begin(self.draft.digests())
        self.draft.on_edit = self._write_journal

    def _write_journal(self, operations):
        """Write an edit to the journal; an earlier session is forgotten with the first edit."""
        if self.unsaved is not None:
            self.discard_unsaved()
        self._journal.append(operations)

    def recover(self):
        """Repeat the unsaved edits of an earlier session, and return their count.

        An edit that the job does not accept ends the repetition. Edits are not repeated if another
        program has changed the files since then.
        """
        unsaved = self.unsaved
        if unsaved is None or not unsaved.is_applicable:
            return 0
        self.discard_unsaved()
        count = 0
        with suppress(InputError, ValueError, LookupError, TypeError, AttributeError):
            for operations in unsaved.edits:
                self.draft.apply([tuple(operation) for operation in operations])
                count += 1
        self.mark_edited()
        return count

    def discard_unsaved(self):
        """Forget the unsaved edits of an earlier session."""
        self.unsaved = None
        self._journal.begin(self.draft.digests())

    # ---- content

    @property
    def names(self):
        """Names of the tables of the job, in the order of the contract."""
        return tuple(name for name in TABLES if name in self.draft.tables)

    @property
    def lists(self):
        """Names of the lists of the job: cameras, instruments, clouds, meters."""
        return tuple(name for name in REGISTERS if name in self.draft.keys)

    @property
    def addable(self):
        """Names of the tables that can be added to the job."""
        kind = self.draft.kind or "vertical"
        of_surveys = [name for names in SURVEYS.values() for name in names]
        may = [*TABLES_OF_KIND[kind], *(of_surveys if kind == "vertical" else ())]
        return tuple(name for name in TABLES if name in may and name not in self.draft.tables)

    def show(self, name):
        """`ShownTable` of a table, of a list or of the settings ("job")."""
        return self.reader.show(self.draft, self.outcome, name, self.every_key.get(name, False))

    # ---- checks

    @property
    def outcome(self):
        """`Check` of the edited job."""
        if self._check is None:
            self._check = self.draft.check()
        return self._check

    @property
    def present_check(self):
        """`Check` of the edited job if it was checked since the last edit, or None."""
        return self._check

    def keep_check(self, check, revision):
        """Store a check made elsewhere, unless an edit has overtaken it; return whether stored."""
        if revision != self.draft.revision:
            return False
        self._check = check
        return True

    def listen(self, act):
        """Register a function act() that is called after each change."""
        self._listeners.append(act)

    def notify_edit(self):
        """Discard the check after an edit, and notify the listeners."""
        self.mark_edited()
        self.notify()

    def mark_edited(self):
        """Discard the check after an edit, and mark the results as outdated."""
        self._check, self.status = None, ""
        self.is_stale = self.last_run is not None

    def notify(self):
        """Notify the listeners."""
        for act in tuple(self._listeners):
            act()

    # ---- edits

    def enter(self, name, row, column, text):
        """Enter a text in a cell, with the decimal mark of the language.

        Parameters
        ----------
        name : str
            Name of a table ("points"), of a list, or "job".
        row : int or str
            Row from 0; for "job" and lists, the owner of a key.
        column : str
            Column; for "job" and lists, the key.
        text : str
            Entered text.
        """
        if isinstance(row, str):
            typed = text_for_file(field_of(name, row, column), text, ".", self.reader.mark)
            self.draft.set_value(name, row, column, typed)
        else:
            self.reader.enter(self.draft, name, [(row, column, text)])
        self.notify_edit()

    def act(self, name, action, revision=None):
        """Carry out an action of a grid.

        Parameters
        ----------
        name : str
            Name of a table, of a list, or "job".
        action : dict
            Its "kind" is "enter" (changes: [(row, column, text)]), "paste" (row, column, cells),
            "insert" (row, count), "remove" (rows), "column" (name), "every" (value), "undo" or
            "redo". Rows are counted as shown.
        revision : int, optional
            Revision of the draft that the user saw.

        Returns
        -------
        list of (int or str, str)
            Places of the entered cells, as in `Draft.quick_check`.

        Raises
        ------
        InputError
            If the job cannot be edited, or if a cell has changed since the revision.
        """
        draft, kind = self.draft, action["kind"]
        content = {key: value for key, value in action.items() if key != "kind"}
        if kind == "every":
            self.every_key[name] = bool(content["value"])
            return []
        if kind in ("undo", "redo"):
            getattr(draft, kind)()
            self.mark_edited()
            return []
        changes = self._changes_of(name, kind, content)
        self._refuse_conflict(name, kind, changes, revision)
        with draft.group_edits():
            if kind == "paste" and name in draft.tables:
                count = len(draft.tables[name].rows)
                added = content["row"] + len(content["cells"]) - count
                if added > 0:
                    draft.insert_rows(name, count, added)
            if changes:
                self.reader.enter(draft, name, changes, self.every_key.get(name, False))
            elif kind == "insert":
                draft.insert_rows(name, content["row"], min(content["count"], MOST_INSERTED))
            elif kind == "remove":
                draft.remove_rows(name, content["rows"])
            elif kind == "column" and content["name"] in draft.fields(name):
                draft.add_column(name, content["name"])
        self.mark_edited()
        return self._places_of(name, changes)

    def _changes_of(self, name, kind, content):
        """Changes [(row, column, text)] of an action."""
        if kind == "enter":
            return [tuple(change) for change in content["changes"]]
        if kind != "paste":
            return []
        columns = self.shown_columns(name)
        return [
            (content["row"] + down, columns[content["column"] + right], text)
            for down, line in enumerate(content["cells"])
            for right, text in enumerate(line)
            if content["column"] + right < len(columns)
        ]

    def shown_columns(self, name):
        """Names of the columns of a table as shown."""
        if name in self.draft.keys:
            return KEY_COLUMNS
        return self.draft.tables[name].headings

    def _places_of(self, name, changes):
        """Places of changed cells in the draft: row and heading, or owner and key."""
        if name not in self.draft.keys:
            table = self.draft.tables[name]
            return [
                (row, column)
                for row, column, _ in changes
                if column in table.headings and 0 <= row < len(table.rows)
            ]
        places = key_places(self.draft, name, self.every_key.get(name, False))
        return [places[row] for row, column, _ in changes if column == VALUE and row < len(places)]

    def _refuse_conflict(self, name, kind, changes, revision):
        """Raise InputError if the edited cells have changed since the user saw them."""
        since = {} if revision is None else self.draft.changes_since(revision)
        if since is not None and name not in since:
            return
        cells = None if since is None else since[name]
        if kind == "column" or (cells is None and name in self.draft.keys):
            return
        file = (self.draft.tables.get(name) or self.draft.keys[name]).file
        if cells is None:
            expected = message(
                "rows_changed_meanwhile",
                "rows were changed in another window meanwhile; the entry was not made. Enter it "
                "again in the table that is shown now",
            )
            raise InputError(Problem(file, expected))
        table, mark = self.draft.tables[name], self.reader.mark
        for row, column, text in changes:
            if (row, column) in cells:
                now = table.rows[row].cells[table.headings.index(column)]
                expected = message(
                    "cell_changed_meanwhile",
                    "the cell was changed to {now!r} in another window meanwhile; your entry "
                    "{text!r} was not made. Enter it again if it is the correct value",
                    now=now.replace(table.decimal, mark),
                    text=text,
                )
                raise InputError(Problem(file, expected, row + 1, column))

    def import_rows(self, name, headings, rows, is_replacing):
        """Add rows to a table, or replace its rows, as a single edit.

        Parameters
        ----------
        name : str
            Name of the table, which is added if the job does not have it.
        headings : tuple of str
            Columns of the job.
        rows : list of tuple of str
            Cells with decimal points.
        is_replacing : bool
            Whether the present rows are removed.
        """
        draft = self.draft
        with draft.group_edits():
            if name not in draft.tables:
                draft.add_table(name)
            for heading in headings:
                draft.add_column(name, heading)
            table, fields = draft.tables[name], draft.fields(name)
            blank = [place for place, row in enumerate(table.rows) if row.is_blank]
            removed = range(len(table.rows)) if is_replacing else blank
            if removed:
                draft.remove_rows(name, removed)
            first, decimal = len(draft.tables[name].rows), table.decimal
            draft.insert_rows(name, first, len(rows))
            marked = [fields[heading].kind == "number" and decimal != "." for heading in headings]
            draft.set_cells(
                name,
                [
                    (first + place, heading, text.replace(".", decimal) if is_marked else text)
                    for place, row in enumerate(rows)
                    for heading, text, is_marked in zip(headings, row, marked, strict=True)
                    if text
                ],
            )
        self.notify_edit()

    def save(self):
        """Write the edited files of the job, all or none of them, and return their paths."""
        try:
            written = self.draft.save()
        except InputError as error:
            raise self.refusal(error) from None
        except OSError as error:
            reason = self.reader.say(reason_of(error))
            raise Refusal(self.reader.word("not_saved", reason=reason)) from None
        self._check = None
        if self._journal is not None:
            self._journal.begin(self.draft.digests())
            self._journal.keep_history(self.draft.digests(), self.draft.describe_history())
        self.notify()
        return written

    def refusal(self, error):
        """`Refusal` with an error of tankcal in the language."""
        return Refusal("\n".join(self.reader.say(text) for text in error.texts))

    # ---- computing

    def prepare_run(self, on_progress=None, papers=True, on_result=None):
        """Save the job, and return a `Run` that is not yet started.

        Raises
        ------
        Refusal
            If the job cannot be computed or saved.
        """
        if not self.outcome.is_valid:
            raise Refusal("\n".join(self.reader.line(problem) for problem in self.outcome.problems))
        try:
            self.draft.refuse_changed_elsewhere()  # so that the shown job is computed
        except InputError as error:
            raise self.refusal(error) from None
        self.save()
        return Run(self.draft.source, self.out, on_progress, papers, on_result)

    def keep_run(self, run):
        """Store a `Run` as the last computation."""
        self.last_run, self.is_stale = run, False

    def overrule(self, point, decision, reason):
        """Enter the user's decision about a rejected point in the table of overrulings.

        Parameters
        ----------
        point : str
            Name of the point.
        decision : {"keep", "leave_out"}
            Decision.
        reason : str
            Reason of the decision.
        """
        draft, name = self.draft, "overrulings"
        columns = ("point", "decision", "reason", "date")
        given = {"point": point, "decision": decision, "reason": reason}
        given["date"] = datetime.date.today().isoformat()
        with draft.group_edits():
            if name not in draft.tables:
                draft.add_table(name, columns)
            for column in columns:
                draft.add_column(name, column)
            table = draft.tables[name]
            column = table.headings.index("point")
            points = [row.cells[column] for row in table.rows]
            row = points.index(point) if point in points else len(points)
            if row == len(points):
                draft.insert_rows(name, row)
            draft.set_cells(name, [(row, *entry) for entry in given.items()])
        self.notify_edit()

    def head_text(self):
        """Path of the job and numbers of its problems and warnings, in a few lines."""
        problems, warnings = len(self.outcome.problems), len(self.outcome.warnings)
        word = self.reader.word
        lines = [word("job_is", job=str(self.draft.source.resolve()))]
        lines.append(word("counts", problems=problems, warnings=warnings))
        if self.draft.locked is not None:
            lines.append(self.reader.say(self.draft.locked))
        return "\n".join(lines)
