"""The papers of a plan of the bare wall: prediction and field sheets."""

import numpy as np

from tankcal.planning.changes import cost_of
from tankcal.planning.wall.changes import NUMBERED
from tankcal.record.plan import survey_of
from tankcal.report import blocks
from tankcal.report.plain import Column
from tankcal.report.planning.filling import filling, sheet_of_runs
from tankcal.report.planning.improvements import changes, design
from tankcal.report.planning.outlook import result, simulated_surveys, table
from tankcal.report.planning.paper import PlanPaper
from tankcal.report.planning.wall_rows import COURSES, courses_of, field_tables_of_wall

COUNTED = (
    *("circumferences", "strap_readings", "lines", "offsets", "setups", "hits", "tangents"),
    *("runs", "batches"),
)
OF_ALL = ("tangents", "dips")  # what a change is of, where it has no name

ABOUT = {  # what is said before a table of the field sheets
    "circumferences": "wall_circumferences",
    "sight_lines": "wall_offsets",
    "hit_setups": "wall_hits",
    "control_targets": "wall_control_targets",
    "tangent_stations": "wall_tangents",
    "bases": "bases",
}
NARROW = (  # tables of few columns: two side by side
    *("sight_lines", "offsets", "offset_readings", "shared_targets"),
)


class WallPaper(PlanPaper):
    """A `WallPrediction` with the words of a language; as `PlanPaper` otherwise."""

    is_wall = True

    def change(self, change):
        """A `planning.changes.Change` of a WallPlan in words."""
        code = f"{change.action}_wall_{change.item}"
        if change.name in OF_ALL:
            code += f"_of_{change.name}"
        name = change.name
        if change.item in NUMBERED:
            name = name.replace(".", self.marks.decimal)
        return self.word(f"changes.{code}", name=name)


def wall_outlook(paper):
    """The blocks of the prediction of a WallPaper."""
    return [
        *paper.head("prediction"),
        result(paper),
        paper.facts(_counts(paper)),
        *_as_assumed(paper),
        *paper.warnings(paper.prediction.warnings),
        *table(paper),
        *filling(paper),
        *_courses(paper),
        *_reliability(paper),
        *_simulated(paper),
        *changes(paper),
        *design(paper),
    ]


def _as_assumed(paper):
    """What is assumed of a wall of which something is read."""
    return [] if paper.plan.design.is_metered_alone else [paper.paragraph("wall_as_assumed")]


def _courses(paper):
    rows = courses_of(paper.prediction)
    before = [paper.paragraph("courses_before_liquid")] if paper.plan.design.runs else []
    columns = [one for one in COURSES if any(row[one.key] is not None for row in rows)]
    table = paper.table("courses", rows, columns)
    return [paper.heading("courses"), *before, table] if rows else []


def _counts(paper):
    counts, cost = survey_of(paper.plan), cost_of(paper.plan)
    return [
        ("planned_for", paper.day()),
        *((key, _count(paper, getattr(counts, key))) for key in COUNTED),
        ("cost", paper.plain(cost) if cost else None),
    ]


def _count(paper, number):
    return paper.number(number, decimals=0) if number else None


def _reliability(paper):
    rows = [
        {
            "readings": paper.word(f"labels.{one.kind}"),
            "count": one.count,
            "uncontrolled": one.uncontrolled or None,
            "blunder_m": one.mdb_m if np.isfinite(one.mdb_m) else None,
        }
        for one in paper.prediction.reliability
    ]
    columns = [
        Column("readings"), Column("count", decimals=0), Column("uncontrolled", decimals=0),
        Column("blunder_m", "mm", digits=2, heading="blunder"),
    ]  # fmt: skip
    if not rows:
        return []
    return [paper.heading("reliability"), paper.paragraph("wall_reliability"),
            paper.table("reliability", rows, columns)]  # fmt: skip


def _simulated(paper):
    found = paper.simulated
    if found is None:
        return []
    low, median, high = (paper.number(one, decimals=2) for one in found.U_ratios)
    values = {
        "simulated_error": paper.number(found.volume_ratio, decimals=3),
        "simulated_U": paper.word("texts.from_to", middle=median, low=low, high=high),
        "simulated_covered": paper.number(found.covered, "share", decimals=1),
        "simulated_rows": paper.number(float(found.within.mean()), "share", decimals=1),
    }
    return simulated_surveys(paper, "wall_simulated", values)


def wall_sheets(paper):
    """The blocks of the field sheets of a WallPaper."""
    tables = field_tables_of_wall(paper.plan)
    heads = {
        "circumferences": "circumferences",
        "sight_lines": "offsets",
        "hit_setups": "hits",
        "control_targets": "control_targets",
        "tangent_stations": "tangents",
        "bases": "bases",
        "instruments": "equipment",
    }
    found = [*paper.head("field_sheets"), paper.facts(_counts(paper))]
    found += paper.warnings(paper.plan.warnings)
    for name, one in tables.items():
        if name in heads:
            found.append(paper.heading(heads[name]))
        if name in ABOUT:
            found.append(paper.paragraph(ABOUT[name]))
        if name == "sight_lines" and paper.plan.design.lines.faces > 1:
            found.append(paper.paragraph("wall_faces"))
        found += sheet_of_runs(paper, one) if name == "runs" else [_table(paper, name, one)]
    return [
        *found,
        paper.heading("afterwards"),
        blocks.listing([paper.word(f"texts.after_{one}") for one in ("job", "names", "run")]),
        blocks.signature([paper.word("signatures.surveyed")]),
    ]


def _table(paper, name, table):
    return paper.table(name, *table, across=2 if name in NARROW else None)
