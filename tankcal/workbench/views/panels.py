"""Widgets of a result: table and calculators, wall with rejected points, budget."""

from html import escape
from importlib.util import find_spec

import ipywidgets as widgets

from tankcal.workbench.views.calculator import Calculator
from tankcal.workbench.views.page import frame_html, table_page, wall_page
from tankcal.workbench.views.points import PointsPanel
from tankcal.workbench.views.what_if import BudgetPanel

WIDE = {"width": "100%"}  # layout
# Style that prevents truncated titles of tabs.
WHOLE_TITLES = "<style>.tankcal-titled .lm-TabBar-tab { flex: 0 0 auto !important }</style>"


def live_view(result, paper, on_overrule):
    """Widget with all parts of the view as tabs."""
    word = paper.word
    parts = {"views.table": table_part(result, paper)}
    wall = wall_page(paper)
    if wall is not None or paper.record["rejected"]:
        parts["views.wall"] = wall_part(result, paper, wall, on_overrule)
    if result.table.sources:
        parts["views.budget"] = BudgetPanel(result, paper).box
    tabs = widgets.Tab(children=list(parts.values()), titles=[word(name) for name in parts])
    view = widgets.VBox([widgets.HTML(WHOLE_TITLES), tabs], layout=WIDE)
    view.add_class("tankcal-titled")
    return view


def frame_of(html, title):
    """Widget with a page; without anywidget, it does not report the selected point."""
    if find_spec("anywidget") is None:
        return widgets.HTML(frame_html(html, title), layout=WIDE)
    from tankcal.workbench.views.frame import Frame

    return Frame(page=html, title=title)


def table_part(result, paper):
    """Widget with the calculators, and the table with its search below."""
    page = table_page(paper, with_calculator=False)
    table = frame_of(page, paper.word("views.table"))
    return widgets.VBox([CalculatorPanel(result, paper).box, table])


class CalculatorPanel:
    """Three calculators: volume of a dip, dip of a volume, volume between two dips."""

    def __init__(self, result, paper):
        self.calculator = Calculator(result, paper)
        word, heights = paper.word, result.table.height_m
        middle = paper.height(float(heights[len(heights) // 2]), "")
        unit = self.calculator.unit
        self.dip = _field(word("views.dip_m"), middle)
        self.volume = _field(word("views.volume_of", unit=unit))
        self.low, self.high = _field(word("views.from_dip")), _field(word("views.to_dip"))
        self.answers = {name: widgets.HTML() for name in ("volume", "dip", "delivery")}
        asked = {
            "volume": ([self.dip], self.calculator.volume_at),
            "dip": ([self.volume], self.calculator.dip_of),
            "delivery": ([self.low, self.high], self.calculator.delivery),
        }
        rows = []
        for name, (fields, ask) in asked.items():
            show = self._shower(name, fields, ask)
            for field in fields:
                field.observe(show, "value")
            show()
            heading = widgets.HTML(f"<b>{escape(word(f'views.asks_{name}'))}</b>")
            rows.append(widgets.VBox([heading, widgets.HBox(fields), self.answers[name]]))
        self.box = widgets.VBox(rows)

    def _shower(self, name, fields, ask):
        def show(_change=None):
            texts = [field.value for field in fields]
            is_asked = any(text.strip() for text in texts)
            self.answers[name].value = _answer_html(ask(*texts)) if is_asked else ""

        return show


def _field(label, value=""):
    return widgets.Text(
        value=value,
        description=label,
        style={"description_width": "initial"},
        layout={"width": "16rem"},
    )


def _answer_html(answer):
    """HTML of an `Answer`."""
    colour = ' style="color:#a01818"' if answer.is_refused else ' style="font-size:1.1em"'
    facts = "".join(
        f"<br><small>{escape(name)}: {escape(value)}</small>" for name, value in answer.facts
    )
    return f'<div role="status"{colour}>{escape(answer.text)}{facts}</div>'


def wall_part(result, paper, page, on_overrule):
    """List of rejected points and pictures of the wall, with a common selected point."""
    points = PointsPanel(paper, on_overrule)
    if page is None:
        return points.box
    frame = frame_of(page, paper.word("views.wall"))
    if frame.has_trait("chosen"):
        widgets.link((points, "chosen"), (frame, "chosen"))
    return widgets.VBox([points.box, frame])
