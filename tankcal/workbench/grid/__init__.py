"""The grid: a table of a job as a widget of JupyterLab and Voilà (anywidget)."""

from pathlib import Path

import anywidget
import traitlets

HERE = Path(__file__).parent


class Grid(anywidget.AnyWidget):
    """A table to be filled in; `on_msg` hands over what a person does.

    Its rows are changed in place by `put`, which sends the changed cells alone: a view that comes
    later gets the rows as they are then.
    """

    _esm = HERE / "grid.js"
    _css = HERE / "grid.css"
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
        """Show [(row, column, text)] in place of what these cells show."""
        for row, column, text in cells:
            self.rows[row][column] = text
        self.send({"kind": "cells", "cells": [list(one) for one in cells]})
