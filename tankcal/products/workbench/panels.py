"""Widgets of a desk, and its tables, lists and results as plain HTML."""

import asyncio
from html import escape
from pathlib import Path

import anywidget
import ipywidgets as widgets
import traitlets

import tankcal.products.desk
from tankcal.errors import InputError, TankcalError, reason_of
from tankcal.products.desk.computing import Refusal
from tankcal.products.desk.draft import DOUBTFUL
from tankcal.record import record_of

MOST_ROWS = 400  # largest number of rows of a page; the middle of a longer table is omitted
STYLE = """<style>
.tankcal-plain { border-collapse: collapse; font-size: 13px; }
.tankcal-plain th, .tankcal-plain td { border: 1px solid #bbb; padding: 2px 6px; text-align: left; }
.tankcal-plain th small { display: block; font-weight: normal; }
.tankcal-plain td.number { text-align: right; font-variant-numeric: tabular-nums; }
.tankcal-plain .bad { background: #f7c6c5; color: #5c0a09; }
.tankcal-plain .doubtful { background: #fbe6b4; color: #4d3800; }
.tankcal-plain td.bad small, .tankcal-plain td.doubtful small, .tankcal-plain .reason {
  display: block; white-space: pre-line; }
ul.tankcal-list { padding-left: 1.2em; }
ul.tankcal-list li.bad { color: #8c1d18; } ul.tankcal-list li.doubtful { color: #6b4e00; }
</style>"""


def table_page(shown, left_out):
    """HTML of a ShownTable, with the problem in each marked cell.

    `left_out(count)` returns the text of the row that replaces omitted rows.
    """
    head = "".join(
        f"<th{_class_of(shown.marks, None, place)}>{escape(column.heading)}"
        f"<small>{escape(column.name if shown.takes_rows else column.unit)}</small>"
        f"{_reason(shown.marks, None, place)}</th>"
        for place, column in enumerate(shown.columns)
    )
    half = MOST_ROWS // 2
    cut = len(shown.rows) > MOST_ROWS
    marked = {row for row, _ in shown.marks if row is not None}
    body = []
    for row in range(len(shown.rows)):
        if not cut or row < half or row >= len(shown.rows) - half or row in marked:
            body.append(_row(shown, row))
        elif row == half:
            gone = len(shown.rows) - 2 * half
            span = len(shown.columns) + 1
            body.append(f'<tr><td colspan="{span}">{escape(left_out(gone))}</td></tr>')
    reason = _reason(shown.marks, None, None)
    level = shown.marks.get((None, None), ("",))[0]
    above = (
        f'<div class="tankcal-plain"><div class="{level}">{reason}</div></div>' if reason else ""
    )
    return (
        f'{STYLE}{above}<table class="tankcal-plain"><thead><tr><th>#</th>{head}</tr></thead>'
        f"<tbody>{''.join(body)}</tbody></table>"
    )


def _row(shown, row):
    """HTML of a row."""
    cells = "".join(
        f"<td{_class_of(shown.marks, row, place, 'number' if column.is_number else '')}>"
        f"{escape(text)}{_reason(shown.marks, row, place)}</td>"
        for place, (column, text) in enumerate(zip(shown.columns, shown.rows[row], strict=True))
    )
    whole = f"{row + 1}{_reason(shown.marks, row, None)}"
    return f"<tr><th{_class_of(shown.marks, row, None)}>{whole}</th>{cells}</tr>"


def _class_of(marks, row, column, also=""):
    """HTML attribute with the classes of a cell."""
    level = marks.get((row, column), ("",))[0]
    names = " ".join(name for name in (also, level) if name)
    return f' class="{names}"' if names else ""


def _reason(marks, row, column):
    """HTML of the problem of a cell, or ""."""
    mark = marks.get((row, column))
    return f'<small class="reason">{escape(mark[1])}</small>' if mark else ""


def list_page(lines, nothing):
    """HTML of a list [(level, text)], or the text `nothing` if the list is empty."""
    if not lines:
        return f"{STYLE}<p>{escape(nothing)}</p>"
    items = "".join(f'<li class="{level}">{escape(text)}</li>' for level, text in lines)
    return f'{STYLE}<ul class="tankcal-list">{items}</ul>'


def text_page(text):
    """HTML of a text with a paragraph for each line."""
    return "".join(f"<p>{escape(line)}</p>" for line in text.splitlines())


# ---- results of the last computation


def warnings_page(desk):
    """HTML of warnings of the last computation that the check did not give, or ""."""
    result = desk.last_run.result
    known = {warning.text for warning in result.job.warnings}
    warnings = [warning for warning in result.warnings if warning.text not in known]
    if not warnings:
        return ""
    return list_page([(DOUBTFUL, desk.reader.line(warning)) for warning in warnings], "")


def results_page(desk):
    """HTML of the last computation, without buttons, below the list of written files."""
    from tankcal.products.workbench.views import SavedView
    from tankcal.record import record_of
    from tankcal.report.paper import Paper

    paper = Paper(record_of(desk.last_run.result), language=desk.reader.language)
    names = ", ".join(path.name for path in desk.last_run.files)
    written = desk.reader.word("written", folder=str(desk.out.resolve()), files=names)
    above = f"<p>{escape(written)}</p>{warnings_page(desk)}"
    return f"{above}{SavedView(paper)._repr_html_()}"


PAUSE_S = 0.3  # pause after an edit before the job is checked


def check_later(desk):
    """Check the job after a pause without edits, and notify the listeners."""
    try:
        loop = asyncio.get_running_loop()
    except RuntimeError:  # without an event loop there is no pause
        desk.notify()
        return
    if desk.pending_check is not None:
        desk.pending_check.cancel()
    desk.pending_check = loop.call_later(PAUSE_S, desk.notify)


def _button(text, act, style="", icon=""):
    """Button that calls act()."""
    button = widgets.Button(
        description=text, button_style=style, icon=icon, layout={"width": "auto"}
    )
    button.on_click(lambda _: act())
    return button


# ---- tables


def table_panel(desk, name):
    """Grid of a table, a list or the settings."""
    return widgets.VBox([TableGrid(desk, name).grid])


class TableGrid:
    """Grid of a table of a desk; edits are passed to the desk, which returns marks."""

    def __init__(self, desk, name):
        self.desk, self.name = desk, name
        shown = desk.show(name)
        words = desk.reader.words["workbench"]["grid"]
        self.grid = Grid(
            name=name, label=shown.title, words=words, takes_rows=shown.takes_rows,
            **self._content(shown),
        )  # fmt: skip
        self.grid.on_msg(self._handle_message)
        desk.listen(self.refresh)

    def _content(self, shown):
        """Traits of the grid for a ShownTable."""
        return {
            "columns": [vars(column) for column in shown.columns],
            "rows": shown.rows,
            # Marks as lists [row, column, level, text].
            "marks": [[*place, *mark] for place, mark in shown.marks.items()],
            "addable": list(shown.addable),
            "every_key": self.desk.every_key.get(self.name, False),
            "locked": self.desk.draft.locked is not None,
        }

    def refresh(self):
        """Update the grid; if only cells have changed, only these cells are sent."""
        desk, grid = self.desk, self.grid
        if self.name not in desk.draft.tables and self.name not in desk.draft.keys:
            return  # removed by Undo; the check reports a missing table
        shown = desk.show(self.name)
        content = self._content(shown)
        is_same_form = len(shown.rows) == len(grid.rows) and content["columns"] == grid.columns
        if is_same_form:
            cells = [
                (row, place, text)
                for row, (new, old) in enumerate(zip(shown.rows, grid.rows, strict=True))
                if new != old
                for place, text in enumerate(new)
                if text != old[place]
            ]
            if cells:
                grid.put(cells)
            content.pop("rows")
            content.pop("columns")
        with grid.hold_sync():
            for key, value in content.items():
                setattr(grid, key, value)

    def _handle_message(self, _widget, content, _buffers):
        """Handle a message of the grid: an action of the desk."""
        desk = self.desk
        try:
            desk.act(self.name, content)
        except InputError as error:  # a locked workbook, or a key that cannot be edited here
            show_status(desk, "\n".join(desk.reader.say(text) for text in error.texts))
            self.refresh()
            return
        if content["kind"] not in ("enter", "paste"):
            self.refresh()
        if content["kind"] != "every":
            check_later(desk)


def show_status(desk, text):
    """Show a message in the head of the desk."""
    desk.status = text
    desk.notify()


# ---- head, problems, further tables


def head_panel(desk):
    """Path and state of the job, with Save and Undo."""
    word, page = desk.reader.word, widgets.HTML()

    def save():
        """Save the job, and show the names of the files or the reason of the refusal."""
        try:
            written = desk.save()
        except Refusal as error:
            show_status(desk, str(error))
            return
        names = ", ".join(path.name for path in written)
        show_status(desk, word("saved", files=names) if written else word("nothing_to_save"))

    def undo():
        """Revert the last edit."""
        if desk.draft.undo():
            desk.notify_edit()

    save_button = _button(word("save"), save, "primary", "save")
    save_button.add_class("tankcal-save")

    def refresh():
        state = word("unsaved") if desk.draft.is_changed else word("as_on_disk")
        lines = [*desk.head_text().splitlines(), state, *desk.status.splitlines()]
        page.value = "".join(f"<div>{escape(line)}</div>" for line in lines)

    page.add_class("tankcal-head")
    desk.listen(refresh)
    refresh()
    return widgets.VBox(
        [page, widgets.HBox([save_button, _button(word("undo"), undo, "", "undo")])]
    )


def findings_panel(desk):
    """Problems and warnings, updated after each edit."""
    page = widgets.HTML()
    page.add_class("tankcal-findings")

    def refresh():
        page.value = desk.problems.page

    desk.listen(refresh)
    refresh()
    return widgets.VBox([page])


def further_panel(desk):
    """Selection of a table to add, and the grids of added tables."""
    reader = desk.reader
    names = {f"{reader.title(name)} ({name})": name for name in desk.addable}
    choice = widgets.Dropdown(options={"": None, **names}, layout={"width": "24em"})
    grids = widgets.VBox([])

    def add():
        if choice.value is None:
            return
        name = choice.value
        try:
            if name not in desk.draft.tables:
                desk.draft.add_table(name)
        except InputError as error:
            show_status(desk, "\n".join(reader.say(text) for text in error.texts))
            return
        heading = widgets.HTML(
            f"<h3>{escape(reader.title(name))}</h3><p>{escape(reader.note(name))}</p>"
        )
        grids.children = (*grids.children, heading, TableGrid(desk, name).grid)
        desk.notify_edit()

    button = _button(reader.word("add_table"), add)
    return widgets.VBox([widgets.HBox([choice, button]), grids])


# ---- results


def results_panel(desk):
    """Run, Stop, progress with the remaining time, and the results."""
    return ResultsPanel(desk).box


class ResultsPanel:
    """Computes the saved job in a thread; only the event loop of the notebook changes widgets."""

    def __init__(self, desk):
        word = desk.reader.word
        self.desk, self.run = desk, None
        self.button = _button(word("run"), self.start, "success", "play")
        self.button.add_class("tankcal-run")
        self.stopper = _button(word("stop"), self.stop, "warning", "stop")
        self.stopper.disabled = True
        self.papers = widgets.Checkbox(value=True, description=word("with_papers"), indent=False)
        self.bar = widgets.FloatProgress(min=0, max=1, layout={"width": "16em"})
        self.step, self.state, self.view = widgets.HTML(), widgets.HTML(), widgets.VBox([])
        self.step.add_class("tankcal-step")
        self.state.add_class("tankcal-state")
        self.view.add_class("tankcal-view")
        tools = [self.button, self.stopper, self.papers, self.bar, self.step]
        self.box = widgets.VBox([widgets.HBox(tools), self.state, self.view])
        desk.listen(self.refresh)

    def refresh(self):
        """Show a message if the results are older than the job."""
        if self.desk.is_stale and self.run is None:
            self._show_state(self.desk.reader.word("stale"), "#6b4e00")

    def start(self):
        """Save the job and start the computation."""
        if self.run is not None:
            return
        loop = asyncio.get_running_loop()

        def on_loop(act):
            """Function that calls act on the event loop, from any thread."""
            return lambda *arguments: loop.call_soon_threadsafe(act, *arguments)

        try:
            self.run = self.desk.prepare_run(
                on_loop(self._show_progress), self.papers.value, on_loop(self._show_result)
            )
        except Refusal as error:
            self._show_state(str(error))
            return
        self.button.disabled, self.stopper.disabled = True, False
        self._show_state("", "")
        thread = self.run.start()
        self.waiting = loop.create_task(self._finish(thread))

    def stop(self):
        """Stop the computation at its next step."""
        if self.run is not None:
            self.run.stop()
            self.step.value = escape(self.desk.reader.word("stopping"))

    def _show_progress(self, text, share):
        """Show the progress of a step."""
        self.step.value = escape(self.desk.reader.say(text))
        if share is not None:
            self.bar.value = share

    def _show_result(self, result):
        """Show the results while the reports are still being written."""
        self.desk.keep_run(self.run)
        from tankcal.products.workbench.views import results_view

        desk = self.desk
        record = record_of(result)
        view = results_view(result, record, desk.reader.language, desk.overrule)
        self.view.children = (view,)

    async def _finish(self, thread):
        """Wait for the end of the computation, and show its files or its error."""
        await asyncio.to_thread(thread.join)
        run, self.run = self.run, None
        self.button.disabled, self.stopper.disabled = False, True
        self.step.value, self.bar.value = "", 0
        word = self.desk.reader.word
        if run.error is None:
            names = ", ".join(path.name for path in run.files)
            self._show_state(
                word("written", folder=str(self.desk.out.resolve()), files=names), "#1b5e20"
            )
            self.state.value += warnings_page(self.desk)
        elif isinstance(run.error, TankcalError):
            self._show_state("\n".join(self.desk.reader.say(text) for text in run.error.texts))
        elif isinstance(run.error, OSError):
            reason = self.desk.reader.say(reason_of(run.error))
            self._show_state(word("not_written", reason=reason))
        else:
            self._show_state(f"{type(run.error).__name__}: {run.error}")

    def _show_state(self, text, colour="#8c1d18"):
        """Show a message below the buttons; red by default."""
        lines = "".join(f"<div>{escape(line)}</div>" for line in text.splitlines())
        self.state.value = f'<div style="color: {colour}">{lines}</div>' if lines else ""


# ---- grid: a table of a job as a widget of JupyterLab (anywidget)


FOLDER = Path(tankcal.products.desk.__file__).parent


class Grid(anywidget.AnyWidget):
    """An editable table; `on_msg` passes on the actions of the user.

    `put` changes rows in place and sends only the changed cells. A view that is opened later gets
    the current rows.
    """

    _esm = FOLDER / "grid.js"
    _css = FOLDER / "grid.css"
    name = traitlets.Unicode().tag(sync=True)
    label = traitlets.Unicode().tag(sync=True)
    columns = traitlets.List().tag(sync=True)
    rows = traitlets.List().tag(sync=True)
    marks = traitlets.List().tag(sync=True)
    addable = traitlets.List().tag(sync=True)
    words = traitlets.Dict().tag(sync=True)
    takes_rows = traitlets.Bool().tag(sync=True)
    every_key = traitlets.Bool().tag(sync=True)
    locked = traitlets.Bool().tag(sync=True)

    def put(self, cells):
        """Show new texts in cells, [(row, column, text)]."""
        for row, column, text in cells:
            self.rows[row][column] = text
        self.send({"kind": "cells", "cells": [list(cell) for cell in cells]})
