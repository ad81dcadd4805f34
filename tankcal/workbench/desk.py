"""The desk: one job opened in a notebook, with its tables, checks, results and Save.

Without widgets it does the same by calls:

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
from tankcal.report.folders import default_folder
from tankcal.text.languages import DEFAULT, nearest_language
from tankcal.workbench.computing import Run
from tankcal.workbench.decimals import entered_text
from tankcal.workbench.draft import Draft
from tankcal.workbench.findings import BAD, DOUBTFUL
from tankcal.workbench.keys import SETTINGS, field_of
from tankcal.workbench.plain import list_page, table_page, text_page
from tankcal.workbench.shown import Reader

OF_PERSONS = ("JPY_SESSION_NAME", "VOILA_REQUEST_URL", "VSCODE_PID")  # set where somebody looks on
WIDGETS = ("ipywidgets", "anywidget")


class Refusal(TankcalError):
    """What a notebook cannot go on with; it shows as its lines, without a traceback."""

    exit_status = 2

    def _render_traceback_(self):
        return [f"tankcal: {line}" for line in str(self).splitlines()]


def is_attended():
    """Does somebody look on (JupyterLab, Voilà, VS Code), and not a program alone?"""
    return any(os.environ.get(name) for name in OF_PERSONS)


def open_job(job=".", *, out=None, language=None, live=None):
    """Open a job on a desk.

    Parameters
    ----------
    job : path
        A job folder, its job.toml, or a job workbook.
    out : path, optional
        Of the results; None: where `tankcal run` writes them.
    language : str, optional
        Of everything that is shown; None: that of the job.
    live : bool, optional
        True: grids and buttons; False: plain tables, and the results are computed when they are
        shown; None: live where somebody looks on.

    Returns
    -------
    Desk

    Raises
    ------
    Refusal
        Where there is no job.

    Examples
    --------
    >>> desk = open_job("examples/silva-1995", live=False)
    >>> desk.names[:3], len(desk.problems)
    (('points', 'courses', 'uncertainty'), 0)
    """
    known = nearest_language(language)
    try:
        draft = Draft.open(job)
    except InputError as error:
        reader = Reader(known or DEFAULT)
        lines = [reader.line(one) for one in error.problems]
        here = reader.word("counted_from", folder=str(Path.cwd()))
        raise Refusal("\n".join([*lines, here])) from None
    language = known or nearest_language(draft.value("table", "language")) or DEFAULT
    out = Path(out) if out is not None else default_folder(draft.source)
    is_live = is_attended() if live is None else bool(live)
    return Desk(draft, out, Reader(language), is_live)


class Desk:
    """A job on a desk. Its tables are attributes: `desk.points`, `desk.courses`, `desk.cameras`.

    Attributes
    ----------
    draft : Draft
    reader : Reader
    out : Path
    is_live : bool
    last_run : Run or None
    is_stale : bool
        Was something edited or overruled since the last run?
    said : str
        What the head says of the last thing that was done.
    """

    def __init__(self, draft, out, reader, is_live):
        self.draft, self.out, self.reader = draft, out, reader
        self.is_live = is_live and all(map(find_spec, WIDGETS))
        self.last_run, self.is_stale = None, False
        self.every_key, self.said, self.waiting = {}, "", None
        self._listeners, self._checked = [], None

    # ---- what is there

    @property
    def names(self):
        """Names of the tables that the job has, in the order of the contract."""
        return tuple(name for name in TABLES if name in self.draft.tables)

    @property
    def lists(self):
        """Names of its lists: cameras, instruments, clouds, meters."""
        return tuple(name for name in REGISTERS if name in self.draft.keys)

    @property
    def further(self):
        """Names of the tables that it may have, too."""
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
        """The view of a table or of a list, as a notebook shows it."""
        return TableView(self, name)

    @property
    def settings(self):
        """The view of job.toml, or of the sheet of settings."""
        return TableView(self, SETTINGS)

    def show(self, name):
        """The ShownTable of a table, of a list or of the settings ("job")."""
        return self.reader.show(self.draft, self.outcome, name, self.every_key.get(name, False))

    # ---- checks

    @property
    def outcome(self):
        """The Check of the job as it stands here."""
        if self._checked is None:
            self._checked = self.draft.check()
        return self._checked

    @property
    def problems(self):
        """What is wrong with the job, and what deserves a look, as a list that shows itself."""
        return Findings(self)

    def listen(self, act):
        """Call act() whenever something changed."""
        self._listeners.append(act)

    def changed(self):
        """Something was edited: forget what was checked, and tell everybody."""
        self.edited()
        self.tell()

    def edited(self):
        """Something was edited: what was checked and computed counts no more."""
        self._checked, self.said = None, ""
        self.is_stale = self.last_run is not None

    def tell(self):
        """Tell everybody who listens."""
        for act in tuple(self._listeners):
            act()

    # ---- edits

    def enter(self, name, row, column, text):
        """Type a text into a cell, as a person of the language does.

        Parameters
        ----------
        name : str
            Of a table ("points"); of "job" and the lists row is the owner, column the key.
        row : int or str
            From 0.
        column : str
        text : str
        """
        if isinstance(row, str):
            typed = entered_text(field_of(name, row, column), text, ".", self.reader.mark)
            self.draft.set_value(name, row, column, typed)
        else:
            self.reader.enter(self.draft, name, [(row, column, text)])
        self.changed()

    def save(self):
        """Write what was edited into the files of the job, all or nothing; returns their Paths."""
        try:
            written = self.draft.save()
        except InputError as error:
            raise self.refusal(error) from None
        except OSError as error:
            reason = self.reader.say(reason_of(error))
            raise Refusal(self.reader.word("not_saved", reason=reason)) from None
        self._checked = None
        self.tell()
        return written

    def refusal(self, error):
        """A Refusal that says an error of tankcal in the language."""
        return Refusal("\n".join(self.reader.say(one) for one in error.texts))

    # ---- computing

    def begin(self, tell=None, papers=True, on_result=None):
        """Save, and the Run of the job to be started; Refusal: the job cannot be computed."""
        if not self.outcome.is_sound:
            raise Refusal("\n".join(self.reader.line(one) for one in self.outcome.problems))
        try:
            self.draft.refuse_changed_elsewhere()  # what is shown is what is computed
        except InputError as error:
            raise self.refusal(error) from None
        self.save()
        return Run(self.draft.source, self.out, tell, papers, on_result)

    def run(self, papers=True):
        """Save, compute and write the results, as `tankcal run` does; returns the result.

        Raises
        ------
        Refusal
            With every problem, where the job cannot be computed.
        """
        run = self.begin(papers=papers)
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
        """Take a Run for the last one."""
        self.last_run, self.is_stale = run, False

    @property
    def results(self):
        """Run, progress and results, as a notebook shows them.

        Where the desk is not live the job is computed, and a Refusal raised where that fails.
        """
        if not self.is_live and (self.last_run is None or self.is_stale):
            self.run()
        return Results(self)

    def overrule(self, point, decision, reason):
        """Note in the job's table of overrulings what a person decides about a rejected point.

        Parameters
        ----------
        point : str
        decision : {"keep", "leave_out"}
        reason : str
        """
        draft, name = self.draft, "overrulings"
        columns = ("point", "decision", "reason", "date")
        given = {"point": point, "decision": decision, "reason": reason}
        given["date"] = datetime.date.today().isoformat()
        with draft.as_one_edit():
            if name not in draft.tables:
                draft.add_table(name, columns)
            for column in columns:
                draft.add_column(name, column)
            table = draft.tables[name]
            column = table.headings.index("point")
            known = [row.cells[column] for row in table.rows]
            row = known.index(point) if point in known else len(known)
            if row == len(known):
                draft.insert_rows(name, row)
            draft.set_cells(name, [(row, *one) for one in given.items()])
        self.changed()

    @property
    def more(self):
        """What adds a table that the job does not have."""
        return Further(self)

    def _repr_mimebundle_(self, include=None, exclude=None):
        return bundle(self, "head_panel", text_page(self.head_text()))

    def head_text(self):
        """Which job this is, and whether it is sound, in a few lines."""
        problems, warnings = len(self.outcome.problems), len(self.outcome.warnings)
        word = self.reader.word
        lines = [word("job_is", job=str(self.draft.source.resolve()))]
        lines.append(word("counts", problems=problems, warnings=warnings))
        if self.draft.locked is not None:
            lines.append(self.reader.say(self.draft.locked))
        return "\n".join(lines)


def bundle(desk, panel, page, *given):
    """What a notebook shows: a panel of widgets where the desk is live, and the page always."""
    shown = {"text/html": page, "text/plain": panel}
    if desk.is_live:
        from tankcal.workbench import panels

        widget = getattr(panels, panel)(desk, *given)
        shown |= widget._repr_mimebundle_()
    return shown


class TableView:
    """A table, a list or the settings of a desk, as a notebook shows it."""

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
        """Why there is nothing to be shown: what the check says of it, or that it is not there."""
        reader, check = self.desk.reader, self.desk.outcome
        title = reader.title(self.name)
        own = [
            (BAD, reader.line(one))
            for one in check.problems
            if one.file.removeprefix("sheet ").rpartition(".")[0] == self.name
            or one.file.removeprefix("sheet ") == self.name
        ]
        return list_page(own, reader.word("no_such_table", title=title))


class Findings:
    """Problems and warnings of a desk: a sequence of Problem that a notebook shows as a list."""

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
        """As HTML."""
        check, line = self._desk.outcome, self._desk.reader.line
        lines = [(BAD, line(one)) for one in check.problems]
        lines += [(DOUBTFUL, line(one)) for one in check.warnings]
        return list_page(lines, self._desk.reader.word("nothing_wrong"))

    def _repr_mimebundle_(self, include=None, exclude=None):
        return bundle(self._desk, "findings_panel", self.page)


class Further:
    """Tables that a job may have, to be added."""

    def __init__(self, desk):
        self._desk = desk

    def _repr_mimebundle_(self, include=None, exclude=None):
        reader = self._desk.reader
        titles = ", ".join(f"{reader.title(name)} ({name})" for name in self._desk.further)
        return bundle(self._desk, "further_panel", text_page(reader.word("further", titles=titles)))


class Results:
    """The results of a desk: under a button where it is live, else as they are."""

    def __init__(self, desk):
        self._desk = desk

    def _repr_mimebundle_(self, include=None, exclude=None):
        from tankcal.workbench.result_views import results_page

        desk = self._desk
        return bundle(desk, "results_panel", "" if desk.is_live else results_page(desk))
