"""Pages of a result: parts of the page of the report, with its scripts only.

They are shown in a sandbox, which loads no other page and has no access to its surroundings.
"""

from tankcal.report.blocks import document
from tankcal.report.tables import survey
from tankcal.report.tables import tank as tables
from tankcal.report.uncertainty import budget, capacity
from tankcal.report.web import page
from tankcal.report.web.calculator_data import calculator
from tankcal.report.web.tank_shape import tank_view
from tankcal.report.web.wall_map import wall_map_view


def table_page(paper, with_calculator=True):
    """Page of the capacity table, with a search for rows by dip or any number."""
    blocks = [calculator(paper)] if with_calculator else []
    return _page(paper, [*blocks, *capacity.capacity_blocks(paper)])


def wall_page(paper):
    """Page of the wall, unrolled and in three dimensions, or None if it would be empty."""
    blocks = [wall_map_view(paper)] if paper.record["sections"] else []
    shape_view = tank_view(paper)
    if not blocks and shape_view.data["reason"]:
        return None
    return _page(paper, [*blocks, shape_view])


def budget_page(paper):
    """Page of the uncertainty budget, with U if a standard uncertainty is halved; None if empty."""
    if not paper.record["budget"]:
        return None
    return _page(paper, [paper.heading("budget"), *budget.top(paper)])


def whole_page(paper):
    """Page with all parts, for a notebook without widgets or a saved notebook."""
    record, blocks = paper.record, [calculator(paper), *capacity.capacity_blocks(paper)]
    if record["sections"]:
        blocks.append(wall_map_view(paper))
    blocks.append(tank_view(paper))
    if record["rejected"]:
        blocks += [paper.heading("rejected"), paper.show(tables.REJECTED)]
    if record.get("overrulings"):
        blocks += [paper.heading("overrulings"), paper.show(survey.OVERRULINGS)]
    if record["budget"]:
        blocks += [paper.heading("budget"), *budget.top(paper)]
    return _page(paper, blocks)


def _page(paper, blocks):
    """HTML page of blocks."""
    first = document(
        title=f"{paper.word('views.results')}, {paper.subject()}",
        language=paper.words["language"]["code"],
        notice=str(paper.record["job"]["certificate"].get("notice", "")),
    )
    return page([block.data for block in (first, *blocks)], has_contents=False)
