"""A page in a frame, as a widget that tells which point is looked at in it (anywidget)."""

from pathlib import Path

import anywidget
import traitlets


class Frame(anywidget.AnyWidget):
    """A page of the report in a sandbox; `chosen` is the point that is looked at."""

    _esm = Path(__file__).parent / "frame.js"
    page = traitlets.Unicode().tag(sync=True)
    title = traitlets.Unicode().tag(sync=True)
    height = traitlets.Unicode("44rem").tag(sync=True)
    chosen = traitlets.Unicode().tag(sync=True)
