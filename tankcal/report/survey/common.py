"""What the pages of the adjustment share: chapters, and long tables cut short."""

from tankcal.report.tables.readings import MOST_IN_SHEET

MOST_ROWS = 50  # of a table; how many there are in all is said beside it
MOST_CAMERAS = 12  # sets of camera parameters that are shown


def chapter(paper, name, found):
    """A heading of level 2 with its blocks; nothing where there are none."""
    return [paper.heading(name, 2), *found] if found else []


def with_note(paper, block, shown, rows):
    """The table of the rows shown, and a sentence when there are more."""
    if len(rows) <= len(shown):
        return [block]
    name = "only_worst" if len(rows) <= MOST_IN_SHEET else "only_worst_of_many"
    return [block, paper.paragraph(name, shown=len(shown), all=len(rows))]
