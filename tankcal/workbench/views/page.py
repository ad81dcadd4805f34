"""Pages that a notebook frames: parts of the report's page, with its scripts and no others.

The frame is a sandbox: a page in it reaches nothing of the notebook, and asks the network for
nothing. The same page stands in a saved notebook, where its calculators and pictures still work.
"""

from html import escape

from tankcal.report.blocks import document
from tankcal.report.tables import overrulings
from tankcal.report.tables import tank as tables
from tankcal.report.uncertainty import budget, capacity
from tankcal.report.web import page
from tankcal.report.web.capacity_data import calculator
from tankcal.report.web.tank_shape import tank_view
from tankcal.report.web.wall_map import wall_map_view

HEIGHT = "44rem"


def table_page(paper, with_calculator=True):
    """The page of the capacity table; its finder finds a row by its dip or any number."""
    blocks = [calculator(paper)] if with_calculator else []
    return _page(paper, [*blocks, *capacity.capacity_blocks(paper)])


def wall_page(paper):
    """The page of the wall, unrolled and in three dimensions; None where there is nothing."""
    blocks = [wall_map_view(paper)] if paper.record["sections"] else []
    seen = tank_view(paper)
    if not blocks and seen.data["reason"]:
        return None
    return _page(paper, [*blocks, seen])


def whole_page(paper):
    """Everything on one page: of a notebook without widgets, or a saved one."""
    record, blocks = paper.record, [calculator(paper), *capacity.capacity_blocks(paper)]
    if record["sections"]:
        blocks.append(wall_map_view(paper))
    blocks.append(tank_view(paper))
    if record["rejected"]:
        blocks += [paper.heading("rejected"), paper.show(tables.REJECTED)]
    if record.get("overrulings"):
        blocks += [paper.heading("overrulings"), paper.show(overrulings.OVERRULINGS)]
    if record["budget"]:
        blocks += [paper.heading("budget"), *budget.top(paper)]
    return _page(paper, blocks)


def _page(paper, blocks):
    first = document(
        title=f"{paper.word('views.results')}, {paper.subject()}",
        language=paper.words["language"]["code"],
        notice=str(paper.record["job"]["certificate"].get("notice", "")),
    )
    return page([one.data for one in (first, *blocks)], has_contents=False)


def framed(html, title, height=HEIGHT):
    """A page in a frame, as HTML."""
    style = f"box-sizing:border-box;width:100%;height:{height};border:1px solid #c3cad2"
    return (
        f'<iframe sandbox="allow-scripts" title="{escape(title)}" style="{style}" '
        f'srcdoc="{escape(html)}"></iframe>'
    )


class SavedView:
    """The results as one page; `html` is that page."""

    def __init__(self, paper):
        self._paper = paper

    @property
    def html(self):
        """The page, whole."""
        return whole_page(self._paper)

    def _repr_html_(self):
        return framed(self.html, self._paper.word("views.results"))
