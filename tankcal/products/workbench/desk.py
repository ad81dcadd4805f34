"""Desk: a job opened in a notebook, with its tables, checks, results and Save.

Without widgets, the same actions are function calls:

    desk = open_job("my-tank")
    desk.enter("points", 0, "x_m", "6.5021")
    desk.problems, desk.save(), desk.run()
"""

import os
from importlib.util import find_spec
from pathlib import Path

from tankcal.errors import InputError, TankcalError, reason_of
from tankcal.job.tables import REGISTERS, TABLES
from tankcal.products.desk.computing import Refusal
from tankcal.products.desk.desk import Desk
from tankcal.products.desk.display import Reader
from tankcal.products.desk.draft import BAD, DOUBTFUL, Draft
from tankcal.products.desk.keys import SETTINGS
from tankcal.products.workbench.panels import list_page, table_page, text_page
from tankcal.report.folders import default_folder
from tankcal.text.shipped import DEFAULT, nearest_language

# Environment variables of interactive sessions.
SESSION_VARIABLES = ("JPY_SESSION_NAME", "VSCODE_PID")
WIDGETS = ("ipywidgets", "anywidget")  # packages required for grids and buttons


def is_attended():
    """Whether the session is interactive (JupyterLab, VS Code)."""
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
    NotebookDesk

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
    return NotebookDesk(draft, out, Reader(language), is_live)


class NotebookDesk(Desk):
    """A job in a notebook; its tables are attributes, such as `desk.points` or `desk.cameras`.

    Attributes
    ----------
    is_live : bool
        Whether grids and buttons are shown.
    pending_check : asyncio.TimerHandle or None
        Check that follows the last edit after a pause.
    """

    def __init__(self, draft, out, reader, is_live):
        super().__init__(draft, out, reader)
        self.is_live = is_live and all(map(find_spec, WIDGETS))
        self.pending_check = None

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

    @property
    def problems(self):
        """Problems and warnings of the job, as a list that a notebook can show."""
        return Findings(self)

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

    @property
    def results(self):
        """Run button, progress and results for a notebook.

        Without widgets, the job is computed first, and a Refusal is raised if that fails.
        """
        if not self.is_live and (self.last_run is None or self.is_stale):
            self.run()
        return Results(self)

    @property
    def more(self):
        """Selection of a table to add to the job."""
        return AddableTables(self)

    def _repr_mimebundle_(self, include=None, exclude=None):
        return bundle(self, "head_panel", text_page(self.head_text()))


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
        from tankcal.products.workbench.panels import results_page

        desk = self._desk
        return bundle(desk, "results_panel", "" if desk.is_live else results_page(desk))
