"""The field sheets: marks, positions, readings and equipment."""

from math import ceil

from tankcal.planning.places import group_by_ends
from tankcal.report import blocks
from tankcal.report.planning import sketches
from tankcal.report.planning.rows import field_tables, lost_ties
from tankcal.report.planning.stands import stands

SHORT = 12  # rows; shorter tables are not set in groups side by side


def sheets(paper):
    """Return the blocks of the field sheets of a PlanPaper."""
    tables = field_tables(paper.prediction)
    return [
        *paper.head("field_sheets"),
        *_overview(paper, tables),
        *_marks(paper, tables),
        *_stands(paper, tables),
        *_readings(paper, tables),
        *_equipment(paper, tables),
        blocks.signature([paper.word(f"signatures.{name}") for name in ("marked", "surveyed")]),
    ]


def _overview(paper, tables):
    plan = paper.plan
    exposures = sum(photo.readings for photo in plan.photos)
    counts = {
        "targets": len(plan.targets.names),
        "unseen_targets": count_unseen_targets(paper.prediction),
        "rows_and_lines": f"{len(tables['levels'][0])} × {len(tables['lines'][0])}",
        "photo_stations": len(plan.stations),
        "photographs": len(plan.photos),
        "repeated_readings": exposures if exposures > len(plan.photos) else 0,
        "setups": len(plan.setups),
        "tapes": len(plan.ties),
        "lost_ties": len(lost_ties(paper.prediction)),
        "bases": len(group_by_ends(plan.bases)),
        "control_points": len(plan.known),
    }
    shown = [
        (key, value if isinstance(value, str) else paper.number(value, decimals=0))
        for key, value in counts.items()
        if value
    ]
    side = paper.words["sides"][plan.job.survey.side]
    items = [("planned_for", paper.day()), ("side", side), *shown]
    return [paper.facts(items), *paper.warnings(plan.warnings)]


def count_unseen_targets(prediction):
    """Number of targets that the planned survey does not determine."""
    targets = prediction.points[: len(prediction.plan.targets.names)]
    return sum(bool(target.undetermined) for target in targets)


def _marks(paper, tables):
    unseen = [paper.paragraph("unseen")] if paper.prediction.undetermined else []
    marks = [
        paper.heading("marks"),
        paper.paragraph("how_arcs_count"),
        paper.paragraph("marks"),
        *unseen,
        paper.figure(sketches.wall(paper), "wall"),
        paper.table("levels", *tables["levels"]),
        _side_by_side(paper.table("lines", *tables["lines"]), 4),
        paper.table("targets", *tables["targets"], across=2),
    ]
    return marks + [_side_by_side(table, 2) for table in _optional(paper, tables, "others")]


def _side_by_side(table, across):
    """Return a table (Block), with its rows in `across` groups side by side if it is long."""
    data, high = table.data, ceil(len(table.data["rows"]) / across)
    if len(data["rows"]) < SHORT:
        return table
    # Fill the last group, so that all groups have the same number of rows.
    rows = data["rows"] + [[""] * len(data["columns"])] * (across * high - len(data["rows"]))
    wide = [[cell for row in rows[i::high] for cell in row] for i in range(high)]
    more = {key: data[key] * across for key in ("columns", "align")}
    return blocks.Block(data | more | {"rows": wide})


def _optional(paper, tables, *names):
    return [paper.table(name, *tables[name]) for name in names if name in tables]


def _stands(paper, tables):
    positions = [paper.heading("stands"), paper.figure(stands(paper), "stands")]
    if "stations" in tables:
        positions += [
            paper.paragraph("stations"),
            paper.table("stations", *tables["stations"]),
            paper.table("photographs", *tables["photographs"]),
        ]
    return positions + _optional(paper, tables, "setups")


def _readings(paper, tables):
    """Return the blocks of ties, bases and control, each heading directly above its table.

    A page never ends between a heading and its table.
    """
    readings = []
    if "ties" in tables:
        readings += [paper.heading("ties"), paper.table("ties", *tables["ties"])]
        readings.append(paper.paragraph("ties"))
        if any(tie.table == "plumb_lines" for tie in paper.plan.ties):
            readings.append(paper.paragraph("plumb_lines"))
    if "bases" in tables:
        readings += [paper.heading("bases"), paper.table("bases", *tables["bases"])]
        readings.append(paper.paragraph("bases"))
    if "control" in tables:
        readings += [paper.heading("control"), paper.table("control", *tables["control"])]
    return readings


def _equipment(paper, tables):
    steps = ("job", "names", *(("images",) if paper.plan.photos else ()), "run")
    return [
        paper.heading("equipment"),
        *_optional(paper, tables, "cameras", "instruments"),
        paper.heading("afterwards"),
        blocks.listing([paper.word(f"texts.after_{step}") for step in steps]),
    ]
