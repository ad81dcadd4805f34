"""From the checked tables of hits inside a horizontal tank or a sphere to `WallHits`, in SI."""

from dataclasses import replace

from tankcal.methods.hits.readings import make_hits


def make_inside_hits(tables, registers):
    """Build `WallHits` from tables and registers without problems."""
    table = tables["wall_hits"]
    # A tank of one solid has no courses, so that its table lacks the column.
    without_courses = replace(table, columns=table.columns | {"course": None})
    return make_hits(tables | {"wall_hits": without_courses}, registers)
