"""Grid: a table of a job as a widget of JupyterLab (anywidget)."""

from pathlib import Path

import anywidget
import traitlets

import tankcal.products.desk

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
