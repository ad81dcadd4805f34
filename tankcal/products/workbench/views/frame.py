"""Page in a frame, as a widget that reports the selected point (anywidget)."""

from pathlib import Path

import anywidget
import traitlets


class Frame(anywidget.AnyWidget):
    """A page of the report in a sandbox; `chosen` is the name of the selected point."""

    _esm = Path(__file__).parent / "frame.js"
    page = traitlets.Unicode().tag(sync=True)
    title = traitlets.Unicode().tag(sync=True)
    height = traitlets.Unicode("44rem").tag(sync=True)
    chosen = traitlets.Unicode().tag(sync=True)
