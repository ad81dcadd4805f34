"""The field sheets: what to mark, where to stand, what to take along and to read."""

from math import ceil

from tankcal.planning.bases import by_ends
from tankcal.report import blocks
from tankcal.report.planning import sketches
from tankcal.report.planning.rows import lost_ties
from tankcal.report.planning.stands import stands
from tankcal.report.planning.tables import field_tables

SHORT = 12  # rows: fewer stand one below the other


def sheets(paper):
    """The blocks of the field sheets of a PlanPaper."""
    tables = field_tables(paper.prediction)
    return [
        *paper.head("field_sheets"),
        *_overview(paper, tables),
        *_marks(paper, tables),
        *_stands(paper, tables),
        *_readings(paper, tables),
        *_equipment(paper, tables),
        blocks.signature([paper.word(f"signatures.{one}") for one in ("marked", "surveyed")]),
    ]


def _overview(paper, tables):
    plan = paper.plan
    exposures = sum(one.readings for one in plan.photos)
    counts = {
        "targets": len(plan.targets.names),
        "unseen_targets": unseen_targets(paper.prediction),
        "rows_and_lines": f"{len(tables['levels'][0])} × {len(tables['lines'][0])}",
        "photo_stations": len(plan.stations),
        "photographs": len(plan.photos),
        "repeated_readings": exposures if exposures > len(plan.photos) else 0,
        "setups": len(plan.setups),
        "tapes": len(plan.ties),
        "lost_ties": len(lost_ties(paper.prediction)),
        "bases": len(by_ends(plan.bases)),
        "control_points": len(plan.known),
    }
    shown = [
        (key, value if isinstance(value, str) else paper.number(value, decimals=0))
        for key, value in counts.items()
        if value
    ]
    items = [("planned_for", paper.day()), ("side", _side(paper)), *shown]
    return [paper.facts(items), *paper.warnings(plan.warnings)]


def unseen_targets(prediction):
    """How many targets the planned survey does not determine."""
    targets = prediction.points[: len(prediction.plan.targets.names)]
    return sum(bool(one.undetermined) for one in targets)


def _side(paper):
    return paper.words["sides"][paper.plan.job.survey.side]


def _marks(paper, tables):
    unseen = [paper.paragraph("unseen")] if paper.prediction.undetermined else []
    found = [
        paper.heading("marks"),
        paper.paragraph("how_arcs_count"),
        paper.paragraph("marks"),
        *unseen,
        paper.figure(sketches.wall(paper), "wall"),
        paper.table("levels", *tables["levels"]),
        _side_by_side(paper.table("lines", *tables["lines"]), 4),
        paper.table("targets", *tables["targets"], across=2),
    ]
    others = [_side_by_side(one, 2) for one in _optional(paper, tables, "others")]
    return found + others


def _side_by_side(table, across):
    """A table (Block) with its rows in groups side by side where there are many."""
    data, high = table.data, ceil(len(table.data["rows"]) / across)
    if len(data["rows"]) < SHORT:
        return table
    rows = data["rows"] + [[""] * len(data["columns"])] * (across * high - len(data["rows"]))
    wide = [[cell for row in rows[i::high] for cell in row] for i in range(high)]
    more = {key: data[key] * across for key in ("columns", "align")}
    return blocks.Block(data | more | {"rows": wide})


def _optional(paper, tables, *names):
    return [paper.table(name, *tables[name]) for name in names if name in tables]


def _stands(paper, tables):
    found = [paper.heading("stands"), paper.figure(stands(paper), "stands")]
    if "stations" in tables:
        found += [
            paper.paragraph("stations"),
            paper.table("stations", *tables["stations"]),
            paper.table("photographs", *tables["photographs"]),
        ]
    return found + _optional(paper, tables, "setups")


def _readings(paper, tables):
    """Headings stand right above their tables: a page never ends between them."""
    found = []
    if "ties" in tables:
        found += [paper.heading("ties"), paper.table("ties", *tables["ties"])]
        found.append(paper.paragraph("ties"))
        if any(one.table == "plumb_lines" for one in paper.plan.ties):
            found.append(paper.paragraph("plumb_lines"))
    if "bases" in tables:
        found += [paper.heading("bases"), paper.table("bases", *tables["bases"])]
        found.append(paper.paragraph("bases"))
    if "control" in tables:
        found += [paper.heading("control"), paper.table("control", *tables["control"])]
    return found


def _equipment(paper, tables):
    found = _optional(paper, tables, "cameras", "instruments")
    steps = ("job", "names", *(("images",) if paper.plan.photos else ()), "run")
    return [
        paper.heading("equipment"),
        *found,
        paper.heading("afterwards"),
        blocks.listing([paper.word(f"texts.after_{one}") for one in steps]),
    ]
