"""Desk: a job opened in a notebook, with its tables, checks, results and Save.

Without widgets, the same actions are function calls:

    desk = open_job("my-tank")
    desk.enter("points", 0, "x_m", "6.5021")
    desk.problems, desk.save(), desk.run()
"""

import datetime
import os
from importlib.util import find_spec
from pathlib import Path

from tankcal.errors import InputError, TankcalError, reason_of
from tankcal.job.contract import SURVEYS, TABLES_OF_KIND
from tankcal.job.tables import REGISTERS, TABLES
from tankcal.products.workbench.computing import Refusal, Run
from tankcal.products.workbench.display import Reader, list_page, table_page, text_page
from tankcal.products.workbench.draft import Draft
from tankcal.products.workbench.findings import BAD, DOUBTFUL
from tankcal.products.workbench.keys import SETTINGS, field_of
from tankcal.products.workbench.tables import text_for_file
from tankcal.report.folders import default_folder
from tankcal.text.shipped import DEFAULT, nearest_language

# Environment variables of interactive sessions.
SESSION_VARIABLES = ("JPY_SESSION_NAME", "VOILA_REQUEST_URL", "VSCODE_PID")
WIDGETS = ("ipywidgets", "anywidget")  # packages required for grids and buttons


def is_attended():
    """Whether the session is interactive (JupyterLab, Voilà, VS Code)."""
    return any(os.environ.get(name) for name in SESSION_VARIABLES)


def open_job(job=".", *, out=None, language=None, live=None):
    """Open a job in a notebook.

    Parameters
    ----------
    job : path
        A job folder, its job.toml, or a job workbook.
    out : path, optional
        Folder of the results; by default the folder of `tankcal run`.
    language : str, optional
        Language of all texts; by default the language of the job.
    live : bool, optional
        True for grids and buttons. False for plain tables, with results computed when they are
        shown. By default, grids and buttons in interactive sessions only.

    Returns
    -------
    Desk

    Raises
    ------
    Refusal
        If there is no job.

    Examples
    --------
    >>> desk = open_job("examples/silva-1995", live=False)
    >>> desk.names[:3], len(desk.problems)
    (('points', 'courses', 'uncertainty'), 0)
    """
    supported = nearest_language(language)
    try:
        draft = Draft.open(job)
    except InputError as error:
        reader = Reader(supported or DEFAULT)
        lines = [reader.line(problem) for problem in error.problems]
        here = reader.word("counted_from", folder=str(Path.cwd()))
        raise Refusal("\n".join([*lines, here])) from None
    language = supported or nearest_language(draft.value("table", "language")) or DEFAULT
    out = Path(out) if out is not None else default_folder(draft.source)
    is_live = is_attended() if live is None else bool(live)
    return Desk(draft, out, Reader(language), is_live)


class Desk:
    """A job in a notebook; its tables are attributes, such as `desk.points` or `desk.cameras`.

    Attributes
    ----------
    draft : Draft
        Edited files of the job.
    reader : Reader
        Texts in the language.
    out : Path
        Folder of the results.
    is_live : bool
        Whether grids and buttons are shown.
    last_run : Run or None
        Last computation.
    is_stale : bool
        Whether the job was edited or overruled since the last computation.
    status : str
        Message about the last action, shown in the head.
    """

    def __init__(self, draft, out, reader, is_live):
        self.draft, self.out, self.reader = draft, out, reader
        self.is_live = is_live and all(map(find_spec, WIDGETS))
        self.last_run, self.is_stale = None, False
        self.every_key, self.status, self.pending_check = {}, "", None
        self._listeners, self._check = [], None

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

    def __getattr__(self, name):
        if not name.startswith("_") and (name in TABLES or name in REGISTERS):
            return self.table(name)
        raise AttributeError(f"a desk has no attribute {name!r}")

    def __dir__(self):
        return sorted({*super().__dir__(), *self.names, *self.lists})

    def table(self, name):
        """View of a table or of a list for a notebook."""
        return TableView(self, name)

    @property
    def settings(self):
        """View of job.toml, or of the sheet of settings."""
        return TableView(self, SETTINGS)

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
    def problems(self):
        """Problems and warnings of the job, as a list that a notebook can show."""
        return Findings(self)

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
        self.notify()
        return written

    def refusal(self, error):
        """`Refusal` with an error of tankcal in the language."""
        return Refusal("\n".join(self.reader.say(text) for text in error.texts))

    # ---- computing

    def prepare_run(self, on_progress=None, papers=True, on_result=None):
        """Save the job, and return a `Run` that is not yet started.

        Parameters
        ----------
        on_progress, papers, on_result
            As in `Run`.

        Returns
        -------
        Run

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

    def run(self, papers=True):
        """Save the job, compute it and write the results as `tankcal run`; return the result.

        Raises
        ------
        Refusal
            If the job cannot be computed, with all problems.
        """
        run = self.prepare_run(papers=papers)
        try:
            run.wait()
        except TankcalError as error:
            raise self.refusal(error) from None
        except OSError as error:
            reason = self.reader.say(reason_of(error))
            raise Refusal(self.reader.word("not_written", reason=reason)) from None
        self.keep_run(run)
        return run.result

    def keep_run(self, run):
        """Store a `Run` as the last computation."""
        self.last_run, self.is_stale = run, False

    @property
    def results(self):
        """Run button, progress and results for a notebook.

        Without widgets, the job is computed first, and a Refusal is raised if that fails.
        """
        if not self.is_live and (self.last_run is None or self.is_stale):
            self.run()
        return Results(self)

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

    @property
    def more(self):
        """Selection of a table to add to the job."""
        return AddableTables(self)

    def _repr_mimebundle_(self, include=None, exclude=None):
        return bundle(self, "head_panel", text_page(self.head_text()))

    def head_text(self):
        """Path of the job and numbers of its problems and warnings, in a few lines."""
        problems, warnings = len(self.outcome.problems), len(self.outcome.warnings)
        word = self.reader.word
        lines = [word("job_is", job=str(self.draft.source.resolve()))]
        lines.append(word("counts", problems=problems, warnings=warnings))
        if self.draft.locked is not None:
            lines.append(self.reader.say(self.draft.locked))
        return "\n".join(lines)


def bundle(desk, panel, page, *arguments):
    """MIME bundle for a notebook: the HTML page, and a panel of widgets if the desk is live.

    Parameters
    ----------
    desk : Desk
        Desk of the job.
    panel : str
        Name of a function of `panels`.
    page : str
        HTML.
    *arguments
        Further arguments of the function.
    """
    shown = {"text/html": page, "text/plain": panel}
    if desk.is_live:
        from tankcal.products.workbench import panels

        widget = getattr(panels, panel)(desk, *arguments)
        shown |= widget._repr_mimebundle_()
    return shown


class TableView:
    """View of a table, a list or the settings for a notebook."""

    def __init__(self, desk, name):
        self.desk, self.name = desk, name

    def _repr_mimebundle_(self, include=None, exclude=None):
        word = self.desk.reader.word
        draft = self.desk.draft
        if self.name not in draft.tables and self.name not in draft.keys:
            return {"text/html": self._missing(), "text/plain": self.name}
        page = table_page(
            self.desk.show(self.name), lambda count: word("rows_left_out", count=count)
        )
        return bundle(self.desk, "table_panel", page, self.name)

    def _missing(self):
        """HTML with the reason why a table cannot be shown: its problems, or that it is missing."""
        reader, check = self.desk.reader, self.desk.outcome
        title = reader.title(self.name)
        lines = [
            (BAD, reader.line(problem))
            for problem in check.problems
            if problem.file.removeprefix("sheet ").rpartition(".")[0] == self.name
            or problem.file.removeprefix("sheet ") == self.name
        ]
        return list_page(lines, reader.word("no_such_table", title=title))


class Findings:
    """Problems of a desk as a sequence; a notebook shows them with the warnings as a list."""

    def __init__(self, desk):
        self._desk = desk

    def __len__(self):
        return len(self._desk.outcome.problems)

    def __iter__(self):
        return iter(self._desk.outcome.problems)

    def __getitem__(self, place):
        return self._desk.outcome.problems[place]

    @property
    def page(self):
        """HTML of problems and warnings."""
        check, line = self._desk.outcome, self._desk.reader.line
        lines = [(BAD, line(problem)) for problem in check.problems]
        lines += [(DOUBTFUL, line(problem)) for problem in check.warnings]
        return list_page(lines, self._desk.reader.word("nothing_wrong"))

    def _repr_mimebundle_(self, include=None, exclude=None):
        return bundle(self._desk, "findings_panel", self.page)


class AddableTables:
    """Tables that can be added to a job."""

    def __init__(self, desk):
        self._desk = desk

    def _repr_mimebundle_(self, include=None, exclude=None):
        reader = self._desk.reader
        titles = ", ".join(f"{reader.title(name)} ({name})" for name in self._desk.addable)
        return bundle(self._desk, "further_panel", text_page(reader.word("further", titles=titles)))


class Results:
    """Results of a desk; with a Run button if the desk is live."""

    def __init__(self, desk):
        self._desk = desk

    def _repr_mimebundle_(self, include=None, exclude=None):
        from tankcal.products.workbench.display import results_page

        desk = self._desk
        return bundle(desk, "results_panel", "" if desk.is_live else results_page(desk))
